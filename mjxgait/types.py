"""Pytrees that packages exchange, and the letters of their shapes.

Letters used in every shape: `P` population, `N` individuals being evaluated, `R` starts per
individual, `L` lanes (simulations in flight), `K` key poses, `J` actuated joints, `G` watched geoms
(the `F` feet first), `E` tuning genes, `nq nv` as in MuJoCo.
"""

import dataclasses
from typing import Any, Protocol, Self, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np

T = TypeVar("T")
Tree = TypeVar("Tree")
"""A pytree of any structure."""
Number = jax.Array | np.ndarray
"""A NumPy array is a constant of the program."""


@dataclass_transform(frozen_default=True)
def pytree(cls: type[T]) -> type[T]:
    """Make a class a frozen dataclass that JAX treats as a pytree."""
    return jax.tree_util.register_dataclass(dataclasses.dataclass(frozen=True)(cls))


def by_name(tree: object) -> dict[str, Any]:
    """Return the leaves of a pytree by dotted name, as in checkpoints."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in leaves}


def choose(condition: Number | bool, yes: Tree, no: Tree) -> Tree:
    """Return `yes` where the condition [...] holds, else `no`; both with leaves [..., *].

    A condition [] chooses whole pytrees, one [M] chooses row by row.
    """
    shape = jnp.shape(condition)

    def pick(one: jax.Array, other: jax.Array) -> jax.Array:
        more = one.ndim - len(shape)
        where = jnp.reshape(condition, (*shape, *[1] * more)) if shape and more else condition
        return jnp.where(where, one, other)

    return jax.tree.map(pick, yes, no)


@pytree
class BodyState:
    """State that the physics carries from one step to the next.

    qpos: [nq] m, rad, unit quaternion.
    qvel: [nv] m/s, rad/s.
    warmstart: [nv] previous acceleration, where the contact solver starts.
    constraint_force: [nv] N, N·m; generalised force of the previous contact solve.
    friction: [] factor on the floor's sliding friction.
    parameters: this lane's own body parameters, as from `ModelPlant.parameters_of`; None where
    the plant's apply.
    ground: a `Ground` under this lane's creature, or the `Medium` of a modular body; None for the
    plane z = 0, which costs nothing.
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
    """Quantities of one moment that a controller and the fitness may use.

    joint_pos, joint_vel: [J] rad, rad/s.
    bias: [nv] Coriolis and gravity less passive forces (`C` of stable PD).
    trunk_pos: [3] m, body origin. trunk_rot: [3, 3], columns are the trunk's axes in the world.
    trunk_vel: [3] m/s of the body origin, trunk_angvel: [3] rad/s; both in the world frame.
    geom_pos: [G, 3] m, centres of the watched geoms. geom_low: [G] m, height of their lowest points
    above the ground under them.
    floor: [] m, height of the ground under the trunk; None where it is the plane z = 0.
    body: a pytree of what only the plant's kind of bodies has; None for bodies of a model.
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
    body: Any = None


@pytree
class Evaluation:
    """Results of N genomes in R trials each.

    terms: [N, R, F], of the fitness. outcome: [N, R, O], metrics. failed: [N, R] whether the
    episode ended early. sim_steps, computed_steps: [].
    """

    terms: jax.Array
    outcome: jax.Array
    failed: jax.Array
    sim_steps: jax.Array
    computed_steps: jax.Array


@pytree
class RequestedTrials:
    """Trials of some genomes to run, and the known results of the others.

    wanted: [B, N, R]. known: leaves [B, N, R, ...], NaN where unknown; its steps, [B], are those
    spent on them so far.
    """

    wanted: Number
    known: Evaluation


StepData = TypeVar("StepData")
Parameters = TypeVar("Parameters")


class Plant(Protocol[StepData]):
    """Batched physics, one step split around the controller.

    Every array has one more axis than documented on the state: the lanes, at position `lane_axis`
    (0 in front, -1 innermost).
    """

    @property
    def lane_axis(self) -> int:
        """Position of the axis of the lanes."""
        ...

    @property
    def note(self) -> str:
        """Note to the user about the choice of this plant; empty if there is none."""
        ...

    def forward(self, state: BodyState) -> tuple[Sensed, StepData]:
        """Compute the current state's position and velocity dependent terms.

        Also return the plant's step data (`step_data`) for the two calls below.
        """
        ...

    def solve_damped(self, step_data: StepData, damping: jax.Array, force: jax.Array) -> jax.Array:
        """Return accelerations `(M + diag(damping))^-1 force`; both arguments `[nv]` per lane."""
        ...

    def advance(self, state: BodyState, step_data: StepData, torque: jax.Array) -> BodyState:
        """Return the state one `sim_dt` later under applied generalised forces `torque` `[nv]`.

        Friction passes through.
        """
        ...

    def overlap(self, state: BodyState) -> jax.Array:
        """Return the deepest overlap [] of parts, m, beyond their overlap when standing.

        Neighbouring parts do not count; negative where all are apart.
        """
        ...


class ModelPlant(Plant[StepData], Protocol[StepData, Parameters]):
    """Physics of one creature's model with replaceable parameters."""

    @property
    def parameters(self) -> Parameters:
        """Parameters of the body that all lanes have: the plant's own pytree, without lanes.

        They are constants of the program, or its inputs (`with_parameters`). A `BodyState` with
        parameters uses those instead.
        """
        ...

    def parameters_of(self, model: Any, layout: Any, crossings: Any = None) -> Parameters:
        """Return the parameters of another body of the same topology.

        model, layout, crossings: the other body's, as in the construction of this plant.

        Raises:
          OtherTopology: more than numbers differs; the message says what.
        """
        ...

    def with_parameters(self, parameters: Parameters) -> Self:
        """Return the plant of another body: constants as from `parameters_of`, or traced arrays."""
        ...

    def with_mass_scale(self, parameters: Parameters, factor: Number) -> Parameters:
        """Return one body's parameters with masses and inertias times factor, [] or [nbody - 1].

        Dependent numbers (the weights of constraints) are computed anew.
        """
        ...

    def with_length_scale(self, parameters: Parameters, factor: Number) -> Parameters:
        """Return one body's parameters with each part's lengths times factor [nbody - 1].

        Its mass is scaled by the third power and its inertia by the fifth (`creature.scale`).
        Weights of constraints are computed anew. The allowed standing overlap of two bars is scaled
        by the mean of their factors.
        """
        ...
