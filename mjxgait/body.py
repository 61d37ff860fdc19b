"""A body as controllers, tasks and senses know it.

Either the `Creature` itself, whose numbers are constants of the compiled program, or its numbers as
inputs of the program, which then serves every body of the same make-up.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.settings import Termination
from mjxgait.types import Number, pytree

NUMBERS = (
    *("forward", "left", "up", "stand_pos", "stand_height"),
    *("stand", "pose_low", "pose_high", "joint_low", "joint_high"),
    *("kp", "kd", "torque_limit", "sign"),
    *("steer_bend", "steer_stride", "balance_pitch", "balance_roll"),
    *("hip_height", "body_length", "mass"),
)
"""Of a creature, by the names that it has for them."""


@dataclasses.dataclass(frozen=True)
class Makeup:
    """What must be the same in two bodies that one program serves; names are numbered.

    dof_adr, partner: [J]. foot_of: [F]; see `Creature`.
    """

    dof_adr: tuple[int, ...]
    partner: tuple[int, ...]
    foot_of: tuple[int, ...]
    feet: int
    symmetric: bool
    nv: int


@pytree
class GivenBody:
    """A body whose numbers are inputs of the program; numbers by the names of `NUMBERS`."""

    numbers: dict[str, Number]
    axes: tuple[Number, Number]
    makeup: Makeup = dataclasses.field(metadata={"static": True})

    def __getattr__(self, name: str) -> Any:
        if name in NUMBERS:
            return self.numbers[name]
        raise AttributeError(f"a body in a compiled program has no {name}")

    @property
    def start_axes(self) -> tuple[Any, Any]:
        """See `Creature`."""
        return self.axes

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Numbers instead of names: those are no part of a program."""
        return tuple(map(str, range(len(self.makeup.dof_adr))))

    @property
    def foot_names(self) -> tuple[str, ...]:
        """See `joint_names`."""
        return tuple(map(str, range(self.makeup.feet)))

    @property
    def dof_adr(self) -> np.ndarray:
        """See `Creature`."""
        return np.array(self.makeup.dof_adr)

    @property
    def partner(self) -> np.ndarray:
        """See `Creature`."""
        return np.array(self.makeup.partner)

    @property
    def foot_of(self) -> np.ndarray:
        """See `Creature`."""
        return np.array(self.makeup.foot_of)

    @property
    def symmetric(self) -> bool:
        """See `Creature`."""
        return self.makeup.symmetric

    @property
    def nv(self) -> int:
        """See `Creature`."""
        return self.makeup.nv


Body = Creature | GivenBody


@pytree
class Ends:
    """A `Termination` whose numbers are inputs of the program.

    min_up: [], height: ([], []). touch: whether one ends an episode.
    """

    min_up: Number
    height: tuple[Number, Number]
    touch: bool = dataclasses.field(metadata={"static": True})


def given_body(creature: Creature) -> GivenBody:
    """A creature's numbers in single precision."""

    def single(value: Any) -> jax.Array:
        return jnp.asarray(value, jnp.float32)

    forward, left = creature.start_axes
    return GivenBody(
        numbers={name: single(getattr(creature, name)) for name in NUMBERS},
        axes=(single(forward), single(left)),
        makeup=Makeup(
            dof_adr=tuple(map(int, creature.dof_adr)),
            partner=tuple(map(int, creature.partner)),
            foot_of=tuple(map(int, creature.foot_of)),
            feet=len(creature.foot_names),
            symmetric=creature.symmetric,
            nv=creature.nv,
        ),
    )


def given_ends(ends: Termination) -> Ends:
    """What ends an episode, in single precision."""
    low, high = (jnp.float32(height) for height in ends.height)
    return Ends(jnp.float32(ends.min_up), (low, high), ends.touch)
