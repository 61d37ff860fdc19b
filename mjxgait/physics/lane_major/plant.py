"""Lane-major physics behind the `Plant` protocol."""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any, Self

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.creature.ground.surface import Ground, clearance, height, pulled
from mjxgait.creature.overlap import Crossings
from mjxgait.physics.derived import ObservationLayout, OtherTopology, deepest
from mjxgait.physics.lane_major.constraints import make_constraints, touch
from mjxgait.physics.lane_major.dynamics import (
    bias_force,
    inertias,
    mass_rows,
    motion_paths,
    reweighed,
)
from mjxgait.physics.lane_major.footing import Touch
from mjxgait.physics.lane_major.kinematics import (
    WORLD,
    Pose,
    bar_places,
    motions,
    posture,
    unit_quaternion,
)
from mjxgait.physics.lane_major.lanes import (
    Column,
    add,
    column,
    cross,
    mul,
    one_kernel,
    parts,
    pinned_by,
    sin_cos,
    sub,
    table,
    turn,
)
from mjxgait.physics.lane_major.model import UnsupportedModel, fuse
from mjxgait.physics.lane_major.newton import Problem, constrained_acceleration
from mjxgait.physics.lane_major.padded import difference, make_room
from mjxgait.physics.lane_major.parameters import Parameters, read_parameters, with_length_scale
from mjxgait.physics.lane_major.structure import Geom, Structure, join
from mjxgait.physics.lane_major.topology import Topology, read_topology
from mjxgait.physics.lane_major.treematrix import (
    BALL,
    FREE,
    Rows,
    factor,
    on_pivot,
    solve,
)
from mjxgait.physics.lane_major.water import fluid_force
from mjxgait.types import (
    BodyState,
    Number,
    Sensed,
    pytree,
)


@pytree
class StepData:
    """Step data. mass: rows of the mass matrix. bias: [nv, L]. touch: the contacts' geometry."""

    mass: Rows
    bias: jax.Array
    touch: Touch | None


@dataclasses.dataclass(frozen=True, eq=False)
class LaneMajorPlant:
    """One MuJoCo step with the lanes innermost; see the package's docstring.

    parameters: of the body that all lanes share. In NumPy they are constants of the program, else
      its inputs.
    """

    topology: Topology
    parameters: Parameters
    note: str = ""
    lane_axis: int = -1

    @property
    def structure(self) -> Structure:
        """Body that all lanes share."""
        return join(self.topology, self.parameters, np.dtype(np.float32))

    def parameters_of(
        self, model: mujoco.MjModel, layout: ObservationLayout, crossings: Crossings | None = None
    ) -> Parameters:
        """See `ModelPlant.parameters_of`."""
        try:
            other = lane_major_plant(model, layout, crossings, padded=self.topology.open_pairs)
            reason = difference(self.topology, other.topology)
        except UnsupportedModel as error:
            reason = f"the fast physics does not support this: {error}"
        if reason:
            raise OtherTopology(reason)
        return other.parameters

    def with_parameters(self, parameters: Parameters) -> Self:
        """See `ModelPlant.with_parameters`."""
        return dataclasses.replace(self, parameters=parameters)

    def with_mass_scale(self, parameters: Parameters, factor: Number) -> Parameters:
        """See `ModelPlant.with_mass_scale`."""
        factor = self._of_moving(factor)
        heavy = dataclasses.replace(
            parameters,
            mass=parameters.mass * factor,
            inertia=parameters.inertia * factor[:, None],
        )
        return self._reweighed(parameters, heavy)

    def with_length_scale(self, parameters: Parameters, factor: Number) -> Parameters:
        """See `ModelPlant.with_length_scale`."""
        large = with_length_scale(self.topology, parameters, self._of_moving(factor))
        return self._reweighed(parameters, large)

    def _of_moving(self, factor: Number) -> Number:
        """Return the factors [B] from [] or [nbody - 1]; a welded body has its carrier's factor."""
        moving = np.array(self.topology.moving)
        return (
            jnp.broadcast_to(factor, np.shape(moving)) if np.ndim(factor) == 0 else factor[moving]
        )

    def _reweighed(self, before: Parameters, after: Parameters) -> Parameters:
        """Update the weights after a change of numbers."""
        weighed = reweighed(self.topology, after)
        if not self.topology.welded:
            return weighed
        # MuJoCo weighs a contact at the welded body's own centre, which merging has dropped.
        ratio = weighed.contacts.weight / reweighed(self.topology, before).contacts.weight
        contacts = dataclasses.replace(weighed.contacts, weight=before.contacts.weight * ratio)
        return dataclasses.replace(weighed, contacts=contacts)

    def forward(self, state: BodyState) -> tuple[Sensed, StepData]:
        """See `Plant.forward`."""
        return one_kernel(self._forward)(state)

    def solve_damped(self, step_data: StepData, damping: jax.Array, force: jax.Array) -> jax.Array:
        """See `Plant.solve_damped`."""
        return jnp.stack(one_kernel(self._solve_damped)(step_data.mass, damping, force))

    def advance(self, state: BodyState, step_data: StepData, torque: jax.Array) -> BodyState:
        """See `Plant.advance`."""
        # Numbers and ground bypass the kernel, which would copy them.
        after = one_kernel(self._advance)(state, step_data, torque)
        return dataclasses.replace(after, parameters=state.parameters, ground=state.ground)

    def overlap(self, state: BodyState) -> jax.Array:
        """See `Plant.overlap`."""
        topology = self.topology
        if not (topology.first or topology.open_pairs):
            return jnp.full_like(state.friction, -jnp.inf)
        structure = self._body(state)
        bars = structure.exact.bars
        places = one_kernel(partial(bar_places, structure))(state.qpos, state.friction)
        if bars.first is None or bars.second is None:
            return deepest(topology.first, topology.second, bars, *places)
        return deepest(bars.first[..., 0], bars.second[..., 0], bars, *places)

    def _body(self, state: BodyState) -> Structure:
        """Body of these lanes: their own, or the plant's."""
        if state.parameters is None:
            return join(self.topology, self.parameters, state.qpos.dtype)
        return join(self.topology, state.parameters, state.qpos.dtype, per_lane=True)

    def _forward(self, state: BodyState) -> tuple[Sensed, StepData]:
        structure, like = self._body(state), state.friction
        pin = pinned_by(like)
        poses, freedoms = posture(structure, state.qpos, pin)
        freedom = motions(freedoms, like, pin)
        body = inertias(structure.columns, poses, like, pin)
        gravity = pulled(state.ground, structure.gravity)
        bias, moving = bias_force(structure, body, freedom, state.qvel, gravity, pin)
        bias = bias + _resistance(structure, state)
        if self.topology.water:
            bias = bias - fluid_force(structure, poses, body, freedom, moving, pin)
        bias = pin(bias)
        paths = motion_paths(structure, freedom, pin)
        mass = mass_rows(structure, body, freedom, paths, pin)
        return _sense(structure, state, poses, moving, bias), StepData(
            mass, bias, touch(structure, poses, freedom, paths, pin, state.ground)
        )

    def _solve_damped(self, mass: Rows, damping: jax.Array, force: jax.Array) -> list[jax.Array]:
        pattern = self.topology.pattern
        damped = tuple(on_pivot(row, damping[k]) for k, row in enumerate(mass))
        return solve(pattern, factor(pattern, damped), list(force))

    def _advance(self, state: BodyState, step_data: StepData, torque: jax.Array) -> BodyState:
        structure = self._body(state)
        pin, force = pinned_by(state.friction), list(torque - step_data.bias)
        constraints = make_constraints(
            structure, step_data.touch, state.friction, state.qpos, state.qvel, pin
        )
        if constraints is None or not self.topology.warm_start:
            guess = solve(structure.pattern, factor(structure.pattern, step_data.mass), force)
        else:
            guess = list(state.warmstart)
        if constraints is None:
            acceleration, pushed = guess, [jnp.zeros_like(state.friction)] * len(force)
        else:
            problem = Problem(step_data.mass, force, constraints, pin)
            acceleration, pushed = constrained_acceleration(problem, guess)
        warmstart = jnp.stack(acceleration)
        qvel = state.qvel + self.topology.step * warmstart
        return BodyState(
            self._moved(state.qpos, qvel), qvel, warmstart, jnp.stack(pushed), state.friction
        )

    def _moved(self, qpos: jax.Array, qvel: jax.Array) -> jax.Array:
        """Positions after a step at these velocities (semi-implicit Euler)."""
        step = self.topology.step
        parts = []
        for joint in self.topology.joints:
            q, v = joint.qpos, joint.dof
            if joint.kind == FREE:
                parts += [qpos[q + n] + step * qvel[v + n] for n in range(3)]
                parts += turned(qpos[q + 3 : q + 7], qvel[v + 3 : v + 6], step)
            elif joint.kind == BALL:
                parts += turned(qpos[q : q + 4], qvel[v : v + 3], step)
            else:
                parts.append(qpos[q] + step * qvel[v])
        return jnp.stack(parts)


def _resistance(structure: Structure, state: BodyState) -> jax.Array:
    """Spring and damper forces against the motion, [nv, L]."""
    x: Any = structure.columns
    resistance = x.damping * state.qvel
    if not isinstance(x.spring, np.ndarray) or np.any(x.spring):
        position = take(state.qpos, structure.topology.dof_qpos)
        return x.spring * (position - x.spring_reference) + resistance
    return 0.0 + resistance


def _sense(
    structure: Structure,
    state: BodyState,
    poses: Sequence[Pose],
    moving: Sequence[jax.Array],
    bias: jax.Array,
) -> Sensed:
    topology, like = structure.topology, state.friction
    pose, motion = poses[topology.trunk], moving[topology.trunk]
    seen = [_look(geom, poses) for geom in structure.geoms]
    trunk = table([pose.far_point((0.0, 0.0, 0.0))], like)[0]
    if state.ground is None:
        floor, lows = None, jnp.stack([low for _, low in seen])
    else:
        floor = height(state.ground, trunk[0], trunk[1])
        lows = _above(structure, poses, state.ground, like)
    lever = cross(tuple(motion[:3]), parts(pose.pos))
    shift = [m + c for m, c in zip(motion[3:], lever, strict=True)]
    return Sensed(
        joint_pos=take(state.qpos, topology.joint_qpos),
        joint_vel=take(state.qvel, topology.joint_dof),
        bias=bias,
        trunk_pos=trunk,
        trunk_rot=jnp.moveaxis(table(pose.rot, like), 0, 1),
        trunk_vel=jnp.stack(shift),
        trunk_angvel=motion[:3],
        geom_pos=table([pos for pos, _ in seen], like),
        geom_low=lows,
        floor=floor,
    )


def _look(geom: Geom, poses: Sequence[Pose]) -> tuple[Column, jax.Array]:
    """Centre of a geom and the height of its lowest point."""
    pose = WORLD if geom.body < 0 else poses[geom.body]
    pos = pose.far_point(geom.pos)
    down = [turn(pose.rot, column)[2] for column in geom.rot]
    box = add(*(mul(b, abs(d)) for b, d in zip(geom.box, down, strict=True)))
    square = add(*(mul(mul(e, e), mul(d, d)) for e, d in zip(geom.ellipsoid, down, strict=True)))
    round_reach = 0.0 if isinstance(square, float) else jnp.sqrt(square)
    return pos, sub(sub(pos[2] - geom.radius, box), round_reach)


def _above(
    structure: Structure, poses: Sequence[Pose], ground: Ground, like: jax.Array
) -> jax.Array:
    """Height [G, L] m of each geom's lowest point above the ground."""
    cores = table([_core(geom, poses) for geom in structure.geoms], like)
    radius = column([geom.radius for geom in structure.geoms], like.dtype)
    return clearance(ground, cores[:, 0], cores[:, 1], cores[:, 2], radius)


def _core(geom: Geom, poses: Sequence[Pose]) -> Column:
    """Lowest point [3, L] of a geom without its radius."""
    pose = WORLD if geom.body < 0 else poses[geom.body]
    axes = [turn(pose.rot, column) for column in geom.rot]
    place = pose.far_point(geom.pos)
    for axis, box in zip(axes, geom.box, strict=True):
        place = sub(place, mul(box, jnp.sign(axis[2]) * axis))
    squares = [mul(e, e) for e in geom.ellipsoid]
    square = add(*(mul(e, axis[2] * axis[2]) for e, axis in zip(squares, axes, strict=True)))
    if isinstance(square, float):
        return place
    reach = jnp.sqrt(jnp.maximum(square, 1e-12))
    return sub(
        place, add(*(mul(e, axis[2] / reach * axis) for e, axis in zip(squares, axes, strict=True)))
    )


def turned(quat: jax.Array, spin: jax.Array, step: float) -> list[jax.Array]:
    """Turn a quaternion [4, L] at body-frame angular velocity [3, L] for a time in s."""
    w, x, y, z = unit_quaternion(quat)
    speed = jnp.sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2])
    half = 0.5 * step * speed
    sin, cos = sin_cos(half)
    sine = jnp.where(speed > 0, sin / jnp.where(speed > 0, speed, 1.0), 0.5 * step)
    a, (b, c, d) = cos, (sine * spin[0], sine * spin[1], sine * spin[2])
    product = (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )
    return list(unit_quaternion(product))


def take(rows: jax.Array, addresses: Sequence[int]) -> jax.Array:
    """Take rows at constant addresses; neighbouring rows are sliced, which costs nothing."""
    first, count = addresses[0], len(addresses)
    if addresses == tuple(range(first, first + count)):
        return rows[first : first + count]
    return jnp.stack([rows[a] for a in addresses])


def lane_major_plant(
    model: mujoco.MjModel,
    layout: ObservationLayout,
    crossings: Crossings | None = None,
    padded: bool = False,
) -> LaneMajorPlant:
    """Make a plant for a model that the lane-major physics supports.

    Args:
      padded: with spare places, so that bodies with other shapes share its program.

    Raises:
      UnsupportedModel: the model is not supported; the message says why.
    """
    seen = fuse(model, layout, crossings)
    topology, parameters = read_topology(*seen), read_parameters(*seen)
    if padded:
        topology, parameters = make_room(topology, parameters, layout.feet)
    return LaneMajorPlant(topology, parameters)
