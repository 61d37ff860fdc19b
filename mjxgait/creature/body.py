"""A body as controllers, tasks and observations use it.

Either the `Creature` itself, with its numbers as constants of the compiled program, or its numbers
as inputs of the program, which then serves every body of the same structure.
"""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.creature import Creature
from mjxgait.creature.anatomy import (
    Corrections,
    Feet,
    Frame,
    Gains,
    Joints,
    Mirror,
    Stepping,
)
from mjxgait.creature.settings import Termination
from mjxgait.types import Number, pytree

for part in (Frame, Joints, Gains, Mirror, Stepping, Corrections, Feet):
    fields = dataclasses.fields(part)
    static = [field.name for field in fields if field.metadata.get("static")]
    numbers = [field.name for field in fields if field.name not in static]
    jax.tree_util.register_dataclass(part, numbers, static)


@pytree
class GivenBody:
    """A body with its numbers as inputs of the program; see `Creature`."""

    frame: Frame
    joints: Joints
    gains: Gains
    mirror: Mirror
    corrections: Corrections
    feet: Feet
    nv: int = dataclasses.field(metadata={"static": True})


Body = Creature | GivenBody


@pytree
class Ends:
    """A `Termination` with its numbers as inputs of the program.

    min_up: [], height: ([], []). touch: whether a touch ends an episode.
    """

    min_up: Number
    height: tuple[Number, Number]
    touch: bool = dataclasses.field(metadata={"static": True})


def given_body(creature: Creature) -> GivenBody:
    """A creature's numbers in single precision.

    Names become numbers: they do not affect the program.
    """
    given = GivenBody(
        frame=creature.frame,
        joints=dataclasses.replace(creature.joints, names=_numbered(creature.joints.names)),
        gains=creature.gains,
        mirror=creature.mirror,
        corrections=creature.corrections,
        feet=dataclasses.replace(
            creature.feet, names=_numbered(creature.feet.names), watched_ids=(), ground_ids=()
        ),
        nv=creature.nv,
    )
    return jax.tree.map(lambda value: jnp.asarray(value, jnp.float32), given)


def given_ends(ends: Termination) -> Ends:
    """The termination settings in single precision."""
    low, high = (jnp.float32(height) for height in ends.height)
    return Ends(jnp.float32(ends.min_up), (low, high), ends.touch)


def _numbered(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(map(str, range(len(names))))
