"""Physics step of a mixed population."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp

from mjxgait.physics.batched_trees.dynamics import (
    bias_links,
    generalised,
    mass_rows,
    velocities,
)
from mjxgait.physics.batched_trees.motion import (
    centres,
    frames,
    lows,
    motions,
    posture,
    root_turns,
)
from mjxgait.physics.batched_trees.overlap import deepest, sizes
from mjxgait.physics.batched_trees.touch import (
    BlockFooting,
    Touch,
    lowest_corners,
    make_constraints,
)
from mjxgait.physics.batched_trees.tree import FAR, Surroundings, Tree
from mjxgait.physics.batched_trees.water import drag_links
from mjxgait.physics.lane_major.dynamics import inertias, unpack
from mjxgait.physics.lane_major.kernel import one_kernel
from mjxgait.physics.lane_major.kinematics import Motion, Pose
from mjxgait.physics.lane_major.lanes import pinned_by, turn_each
from mjxgait.physics.lane_major.newton import Problem, constrained_acceleration
from mjxgait.physics.lane_major.plant import turned
from mjxgait.physics.lane_major.treematrix import (
    Rows,
    factor,
    on_pivot,
    solve,
    sparsity,
)
from mjxgait.types import BodyState, Sensed, pytree


@pytree
class Moment:
    """Step data of the current state.

    turns: [3, 3, L] the root's axes. freedom: components [n, L] of each hinge's motion.
    mass: rows. bias: [nv, L]. touch: None without a floor.
    """

    turns: jax.Array
    freedom: tuple[jax.Array, ...]
    mass: Rows
    bias: jax.Array
    touch: Touch | None


@dataclasses.dataclass(frozen=True)
class TreePlant:
    """One MuJoCo step of modular bodies; `BodyState.parameters` holds each lane's own tree."""

    around: Surroundings
    note: str = ""
    lane_axis: int = -1

    def forward(self, state: BodyState) -> tuple[Sensed, Moment]:
        """See `Plant.forward`."""
        return one_kernel(self._forward)(state)

    def solve_damped(self, workings: Moment, damping: jax.Array, force: jax.Array) -> jax.Array:
        """See `Plant.solve_damped`."""
        return jnp.stack(one_kernel(_solve_damped)(workings.mass, damping, force))

    def overlap(self, state: BodyState) -> jax.Array:
        """See `Plant.overlap`; any pose counts, because these bodies have no drawn pose."""
        tree: Tree = state.parameters
        return deepest(tree, posture(tree, state.qpos, pinned_by(state.friction)))

    def rested(self, tree: Tree, qpos: jax.Array) -> jax.Array:
        """Raise or lower the start [nq] of one body, arrays without lanes, onto the ground."""
        if not self.around.floor:
            return qpos
        lane = jax.tree.map(lambda leaf: leaf[..., None], tree)
        poses = posture(lane, qpos[:, None], pinned_by(jnp.ones(1)))
        return qpos.at[2].add(-jnp.min(lows(lane, poses)))

    def advance(self, state: BodyState, workings: Moment, torque: jax.Array) -> BodyState:
        """See `Plant.advance`."""
        after = one_kernel(self._advance)(state, workings, torque)
        return dataclasses.replace(after, parameters=state.parameters)

    def _forward(self, state: BodyState) -> tuple[Sensed, Moment]:
        tree: Tree = state.parameters
        around, like = self.around, state.friction
        pin = pinned_by(like)
        poses = posture(tree, state.qpos, pin)
        freedom, turns = motions(tree, poses, pin), root_turns(poses)
        body = inertias(tree, poses, like, pin)
        moving = velocities(tree, turns, freedom, list(state.qvel), pin)
        force = bias_links(tree, body, freedom, moving, state.qvel, around.gravity, pin)
        washed = jnp.zeros_like(moving)
        if around.drag:
            washed = drag_links(tree, poses, body, moving, around.drag, pin)
            force = force - washed
        bias = jnp.stack(generalised(tree, turns, freedom, force, pin))
        resisted = jnp.concatenate([jnp.zeros_like(bias[:6]), tree.damping[1:] * state.qvel[6:]])
        moment = Moment(
            turns=turns,
            freedom=freedom.parts,
            mass=mass_rows(tree, turns, freedom, body, pin),
            bias=pin(bias + resisted),
            touch=pin(lowest_corners(tree, poses)) if around.floor else None,
        )
        sensed = dataclasses.replace(
            _sensed(tree, state, poses, moving, moment.bias),
            momentum=jnp.stack([jnp.sum(x, axis=0) for x in body.times(unpack(moving)).shift]),
            washed=jnp.sum(washed[:, 3:], axis=0),
        )
        if around.lit:
            rot = frames(poses)
            own = [jnp.stack(turn_each(rot, tree.axes[:, k]), axis=1) for k in range(3)]
            sensed = dataclasses.replace(sensed, geom_rot=jnp.stack(own, axis=1))
        if not around.floor:
            nowhere = jnp.full_like(sensed.geom_low, FAR)
            sensed = dataclasses.replace(sensed, geom_low=nowhere)
        return sensed, moment

    def _advance(self, state: BodyState, moment: Moment, torque: jax.Array) -> BodyState:
        tree: Tree = state.parameters
        step, touch, pin = self.around.step, moment.touch, pinned_by(state.friction)
        spin_x, spin_y, spin_z, *shift = moment.freedom
        freedom = Motion((spin_x, spin_y, spin_z), (shift[0], shift[1], shift[2]))
        points = (moment.turns[0],) * 3 if touch is None else touch.points
        footing = BlockFooting(tree, moment.turns, freedom, points, pin)
        constraints = make_constraints(
            tree, self.around, footing, touch, state.friction, state.qpos, state.qvel
        )
        problem = Problem(moment.mass, list(torque - moment.bias), constraints, pin)
        acceleration, pushed = constrained_acceleration(problem, list(state.warmstart))
        warmstart = jnp.stack(acceleration)
        qvel = state.qvel + step * warmstart
        turned_root = turned(state.qpos[3:7], qvel[3:6], step)
        shifted, bent = state.qpos[:3] + step * qvel[:3], state.qpos[7:] + step * qvel[6:]
        qpos = jnp.concatenate([shifted, jnp.stack(turned_root), bent])
        return BodyState(qpos, qvel, warmstart, jnp.stack(pushed), state.friction)


def _sensed(
    tree: Tree, state: BodyState, poses: Sequence[Pose], moving: jax.Array, bias: jax.Array
) -> Sensed:
    """Sense the root as trunk and every block as watched; missing blocks are far up."""
    centre = [c + state.qpos[i] for i, c in enumerate(centres(tree, poses))]
    weight, low = tree.mass / jnp.sum(tree.mass, axis=0), lows(tree, poses)
    return Sensed(
        joint_pos=state.qpos[7:],
        joint_vel=state.qvel[6:],
        bias=bias,
        trunk_pos=state.qpos[:3],
        trunk_rot=jnp.stack(poses[0].rot, axis=1),
        trunk_vel=state.qvel[:3],
        trunk_angvel=moving[0, :3],
        past=jnp.max(jnp.abs(state.qpos[7:]) - tree.high[1:], axis=0),
        middle=jnp.stack([jnp.sum(weight * c, axis=0) for c in centre]),
        geom_pos=jnp.stack(centre, axis=1),
        geom_low=low,
        sunk=jnp.max(-low / sizes(tree), axis=0),
    )


def _solve_damped(mass: Rows, damping: jax.Array, force: jax.Array) -> list[jax.Array]:
    pattern = sparsity(range(-1, len(mass) - 1))
    damped = tuple(on_pivot(row, damping[k]) for k, row in enumerate(mass))
    return solve(pattern, factor(pattern, damped), list(force))
