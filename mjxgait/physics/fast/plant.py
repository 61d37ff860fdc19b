"""The fast physics behind the `Plant` protocol."""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.overlap import Crossings
from mjxgait.physics.fast.constraints import make_constraints, touch
from mjxgait.physics.fast.dynamics import bias_force, inertias, mass_rows, motion_paths
from mjxgait.physics.fast.footing import Touch
from mjxgait.physics.fast.kernel import one_kernel
from mjxgait.physics.fast.kinematics import WORLD, Pose, motions, posture, unit_quaternion
from mjxgait.physics.fast.lanes import (
    Constants,
    Matrix,
    add,
    columns,
    constant,
    constants,
    cross,
    mul,
    parts,
    pinned_by,
    sin_cos,
    sub,
    table,
    turn,
)
from mjxgait.physics.fast.newton import Problem, constrained_acceleration
from mjxgait.physics.fast.overlap import bar_places
from mjxgait.physics.fast.structure import BALL, FREE, Structure, read_structure
from mjxgait.physics.fast.treematrix import Rows, factor, solve
from mjxgait.physics.layout import SenseLayout
from mjxgait.physics.overlap import deepest
from mjxgait.types import BodyState, Sensed, pytree


@pytree
class Workings:
    """mass: rows of the mass matrix. bias: [nv, L]. touch: the contacts' geometry."""

    mass: Rows
    bias: jax.Array
    touch: Touch | None


@dataclasses.dataclass(frozen=True)
class Watched:
    """A geom: its body (-1: world), centre and axes in the body's frame, and the radius, box and ellipsoid of its support function."""

    body: int
    pos: Constants
    rot: Matrix
    radius: float
    box: Constants
    ellipsoid: Constants


@dataclasses.dataclass(frozen=True, eq=False)
class FastPlant:
    """One MuJoCo step with the lanes innermost; see the package's docstring."""

    structure: Structure
    layout: SenseLayout
    watched: tuple[Watched, ...]
    crossings: Crossings | None = None
    note: str = ""
    lane_axis: int = -1

    def forward(self, state: BodyState) -> tuple[Sensed, Workings]:
        """See `Plant.forward`."""
        return one_kernel(self._forward)(state)

    def solve_damped(self, workings: Workings, damping: jax.Array, force: jax.Array) -> jax.Array:
        """See `Plant.solve_damped`."""
        return jnp.stack(one_kernel(self._solve_damped)(workings.mass, damping, force))

    def advance(self, state: BodyState, workings: Workings, torque: jax.Array) -> BodyState:
        """See `Plant.advance`."""
        return one_kernel(self._advance)(state, workings, torque)

    def overlap(self, state: BodyState) -> jax.Array:
        """See `Plant.overlap`."""
        if self.crossings is None or not len(self.crossings.first):
            return jnp.full_like(state.friction, -jnp.inf)
        places = one_kernel(partial(bar_places, self.structure, self.crossings))
        return deepest(self.crossings, *places(state.qpos, state.friction))

    def _forward(self, state: BodyState) -> tuple[Sensed, Workings]:
        structure, like = self.structure, state.friction
        pin = pinned_by(like)
        poses, freedoms = posture(structure, state.qpos, pin)
        freedom = motions(freedoms, like, pin)
        body = inertias(structure, poses, like, pin)
        bias, moving = bias_force(structure, body, freedom, state.qvel, pin)
        bias = pin(bias + self._resistance(state))
        paths = motion_paths(structure, freedom, pin)
        mass = mass_rows(structure, body, freedom, paths, pin)
        return self._sense(state, poses, moving, bias), Workings(
            mass, bias, touch(structure, poses, freedom, paths, pin)
        )

    def _resistance(self, state: BodyState) -> jax.Array:
        """Spring and damper forces against the motion, [nv, L]."""
        s = self.structure
        spring, reference, damping = (
            np.array(x, state.qpos.dtype)[:, None]
            for x in (s.spring, s.spring_reference, s.damping)
        )
        stretched: Any = (
            spring * (take(state.qpos, np.array(s.dof_qpos)) - reference) if np.any(spring) else 0.0
        )
        return stretched + damping * state.qvel

    def _sense(
        self, state: BodyState, poses: Sequence[Pose], moving: Sequence[jax.Array], bias: jax.Array
    ) -> Sensed:
        pose, motion = poses[self.layout.trunk - 1], moving[self.layout.trunk - 1]
        seen = [self._look(w, poses) for w in self.watched]
        shift = [
            m + c
            for m, c in zip(motion[3:], cross(tuple(motion[:3]), parts(pose.pos)), strict=True)
        ]
        like = state.friction
        return Sensed(
            joint_pos=take(state.qpos, self.layout.qpos_adr),
            joint_vel=take(state.qvel, self.layout.dof_adr),
            bias=bias,
            trunk_pos=table([pose.far_point((0.0, 0.0, 0.0))], like)[0],
            trunk_rot=jnp.moveaxis(table(pose.rot, like), 0, 1),
            trunk_vel=jnp.stack(shift),
            trunk_angvel=motion[:3],
            geom_pos=table([pos for pos, _ in seen], like),
            geom_low=jnp.stack([low for _, low in seen]),
        )

    def _look(self, geom: Watched, poses: Sequence[Pose]) -> tuple[Any, jax.Array]:
        """Centre of a geom and the height of its lowest point."""
        pose = WORLD if geom.body < 0 else poses[geom.body]
        pos = pose.far_point(geom.pos)
        down = [turn(pose.rot, column)[2] for column in geom.rot]
        box = add(*(mul(b, abs(d)) for b, d in zip(geom.box, down, strict=True)))
        round_reach = (
            jnp.sqrt(add(*(mul(e * e, d * d) for e, d in zip(geom.ellipsoid, down, strict=True))))
            if any(geom.ellipsoid)
            else 0.0
        )
        return pos, sub(sub(pos[2] - geom.radius, box), round_reach)

    def _solve_damped(self, mass: Rows, damping: jax.Array, force: jax.Array) -> list[jax.Array]:
        pattern = self.structure.pattern
        damped = []
        for k, row in enumerate(mass):
            last = np.zeros((row.shape[0], 1), row.dtype)
            last[-1] = 1.0
            damped.append(row + last * damping[k])
        return solve(pattern, factor(pattern, tuple(damped)), list(force))

    def _advance(self, state: BodyState, workings: Workings, torque: jax.Array) -> BodyState:
        structure = self.structure
        pin, force = pinned_by(state.friction), list(torque - workings.bias)
        constraints = make_constraints(
            structure, workings.touch, state.friction, state.qpos, state.qvel, pin
        )
        if constraints is None or not structure.warm_start:
            guess = solve(structure.pattern, factor(structure.pattern, workings.mass), force)
        else:
            guess = list(state.warmstart)
        if constraints is None:
            acceleration, pushed = guess, [jnp.zeros_like(state.friction)] * len(force)
        else:
            problem = Problem(workings.mass, force, constraints, pin)
            acceleration, pushed = constrained_acceleration(problem, guess)
        warmstart = jnp.stack(acceleration)
        qvel = state.qvel + structure.step * warmstart
        return BodyState(
            self._moved(state.qpos, qvel), qvel, warmstart, jnp.stack(pushed), state.friction
        )

    def _moved(self, qpos: jax.Array, qvel: jax.Array) -> jax.Array:
        """Positions after a step at these velocities (semi-implicit Euler)."""
        step = self.structure.step
        parts = []
        for joint in (j for body in self.structure.bodies for j in body.joints):
            q, v = joint.qpos, joint.dof
            if joint.kind == FREE:
                parts += [qpos[q + n] + step * qvel[v + n] for n in range(3)]
                parts += turned(qpos[q + 3 : q + 7], qvel[v + 3 : v + 6], step)
            elif joint.kind == BALL:
                parts += turned(qpos[q : q + 4], qvel[v : v + 3], step)
            else:
                parts.append(qpos[q] + step * qvel[v])
        return jnp.stack(parts)


def turned(quat: jax.Array, spin: jax.Array, step: float) -> list[jax.Array]:
    """Quaternion [4, L] after turning at body-frame angular velocity [3, L] for a time in s."""
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


def take(rows: jax.Array, addresses: np.ndarray) -> jax.Array:
    """Rows at constant addresses; neighbouring ones as a slice, which costs nothing."""
    first, count = int(addresses[0]), len(addresses)
    if np.array_equal(addresses, np.arange(first, first + count)):
        return rows[first : first + count]
    return jnp.stack([rows[int(a)] for a in addresses])


def fast_plant(
    model: mujoco.MjModel, layout: SenseLayout, crossings: Crossings | None = None
) -> FastPlant:
    """A plant for a model that the fast physics knows.

    Raises:
      UnsupportedModel: it does not; the message says why.
    """
    watched = tuple(_watched(model, int(g)) for g in layout.watched)
    return FastPlant(read_structure(model), layout, watched, crossings)


def _watched(model: mujoco.MjModel, geom: int) -> Watched:
    radius, box, ellipsoid = geometry.support_extents(model.geom_type[geom], model.geom_size[geom])
    return Watched(
        body=int(model.geom_bodyid[geom]) - 1,
        pos=constants(model.geom_pos[geom]),
        rot=columns(model.geom_quat[geom]),
        radius=constant(radius),
        box=constants(np.asarray(box)),
        ellipsoid=constants(np.asarray(ellipsoid)),
    )
