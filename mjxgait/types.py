"""Shapes and the pytrees that rooms hand to each other.

Letters used in every shape: `P` population, `N` individuals being evaluated, `R` starts per
individual, `L` lanes (simulations in flight), `K` key poses, `J` actuated joints, `G` watched geoms
(the `F` feet first), `E` tuning genes, `nq nv` as in MuJoCo.
"""

import dataclasses
from typing import Any, Protocol, Self, TypeVar, dataclass_transform

import jax
import numpy as np

T = TypeVar("T")
Number = jax.Array | np.ndarray
"""A constant of the program where it is of NumPy."""


@dataclass_transform(frozen_default=True)
def pytree(cls: type[T]) -> type[T]:
    """Makes a class a frozen dataclass that JAX treats as a pytree."""
    return jax.tree_util.register_dataclass(dataclasses.dataclass(frozen=True)(cls))


@pytree
class BodyState:
    """All that the physics carries from one step to the next.

    qpos: [nq] m, rad, unit quaternion.
    qvel: [nv] m/s, rad/s.
    warmstart: [nv] previous acceleration, where the contact solver starts.
    constraint_force: [nv] N, N·m; generalised force of the previous contact solve.
    friction: [] factor on the floor's sliding friction.
    parameters: the numbers of this lane's own body, as `Plant.parameters_of` reads them; None
      where it has the plant's.
    ground: a `Ground`, what this lane's creature walks on; None for the plane z = 0, which costs
      nothing.
    """

    qpos: jax.Array
    qvel: jax.Array
    warmstart: jax.Array
    constraint_force: jax.Array
    friction: jax.Array
    parameters: Any = None
    ground: Any = None


@pytree
class Sensed:
    """What a controller and the fitness may know of one moment.

    joint_pos, joint_vel: [J] rad, rad/s.
    bias: [nv] Coriolis and gravity less passive forces (`C` of stable PD).
    trunk_pos: [3] m, body origin. trunk_rot: [3, 3], columns are the trunk's axes in the world.
    trunk_vel: [3] m/s of the body origin, trunk_angvel: [3] rad/s; both in the world frame.
    geom_pos: [G, 3] m, centres of the watched geoms. geom_low: [G] m, height of their lowest points
    above the ground under them.
    floor: [] m, height of the ground under the trunk; None where it is the plane z = 0.
    middle: [3] m, of all mass; momentum: [3] kg·m/s of all; washed: [3] N, what the water does to it
    as a whole, 0 where there is none; past: [] rad, how far the hinge that is furthest past its range
    is past it; sunk: [] how deep the block that is deepest in the ground is in it, of its size (the
    cube root of its volume), negative where all are above; geom_rot: [G, 3, 3], rows are the own axes
    of each watched block in the world, where there is something to see. None of bodies of a model.
    """

    joint_pos: jax.Array
    joint_vel: jax.Array
    bias: jax.Array
    trunk_pos: jax.Array
    trunk_rot: jax.Array
    trunk_vel: jax.Array
    trunk_angvel: jax.Array
    geom_pos: jax.Array
    geom_low: jax.Array
    floor: jax.Array | None = None
    middle: jax.Array | None = None
    momentum: jax.Array | None = None
    washed: jax.Array | None = None
    past: jax.Array | None = None
    sunk: jax.Array | None = None
    geom_rot: jax.Array | None = None


@pytree
class Judged:
    """The verdict on N genomes in R trials each.

    terms: [N, R, F], of the fitness. outcome: [N, R, O], what a person would measure. failed: [N, R]
    whether the episode ended early. sim_steps, computed_steps: [].
    """

    terms: jax.Array
    outcome: jax.Array
    failed: jax.Array
    sim_steps: jax.Array
    computed_steps: jax.Array


@pytree
class Asked:
    """Which trials of some genomes are to be run, and what is known of the others.

    wanted: [B, N, R]. known: leaves [B, N, R, ...], NaN where nothing is; its steps, [B], are those
    that have been spent on them.
    """

    wanted: Number
    known: Judged


class Plant(Protocol):
    """Batched physics, one step split around the controller.

    Every array has one more axis than documented on the state: the lanes, at position `lane_axis`
    (0 in front, -1 innermost).
    """

    @property
    def lane_axis(self) -> int:
        """Where the axis of the lanes is."""
        ...

    @property
    def note(self) -> str:
        """What a user should know about the choice of this plant; empty if nothing."""
        ...

    def forward(self, state: BodyState) -> tuple[Sensed, Any]:
        """Position and velocity dependent terms of the current state, and the plant's own
        workings for the two calls below.
        """
        ...

    def solve_damped(self, workings: Any, damping: jax.Array, force: jax.Array) -> jax.Array:
        """Accelerations `(M + diag(damping))^-1 force`; damping and force: `[nv]` per lane."""
        ...

    def advance(self, state: BodyState, workings: Any, torque: jax.Array) -> BodyState:
        """The state one `sim_dt` later under applied generalised forces `torque` `[nv]`;
        friction passes through.
        """
        ...

    def overlap(self, state: BodyState) -> jax.Array:
        """The deepest [] m that parts are in each other, beyond their depth when standing.

        Parts that are neighbours do not count; negative where all are apart.
        """
        ...


class ModelPlant(Plant, Protocol):
    """The physics of one creature's model, whose numbers may be others."""

    @property
    def parameters(self) -> Any:
        """The numbers of the body that all lanes have: the plant's own pytree, without lanes.

        They are constants of the program, or its inputs (`with_parameters`). A `BodyState` with
        parameters has its own instead.
        """
        ...

    def parameters_of(self, model: Any, layout: Any, crossings: Any = None) -> Any:
        """The numbers of another body of the same topology, from what this plant was made of.

        Raises:
          OtherTopology: more than numbers differs; the message says what.
        """
        ...

    def with_parameters(self, parameters: Any) -> Self:
        """The plant of another body: constants as `parameters_of` reads them, or traced arrays."""
        ...

    def heavier(self, parameters: Any, factor: Number) -> Any:
        """One body's numbers with its masses and inertias times factor, [] or [nbody - 1].

        What follows from them (the weights of constraints) is computed anew.
        """
        ...

    def resized(self, parameters: Any, factor: Number) -> Any:
        """One body's numbers with each part's lengths times factor [nbody - 1], its mass times the
        third power and its inertia times the fifth (`creature.scale`).

        Weights of constraints are computed anew. The depth at which two bars may stand is scaled
        by the mean of their factors.
        """
        ...
