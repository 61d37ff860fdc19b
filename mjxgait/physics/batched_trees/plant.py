"""Physics step of a mixed population."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.physics.batched_trees import within
from mjxgait.physics.batched_trees.dynamics import (
    bias_links,
    deepest,
    drag_links,
    generalised,
    mass_rows,
    sizes,
    velocities,
)
from mjxgait.physics.batched_trees.footing import (
    BlockFooting,
    Touch,
    lowest_corners,
    make_constraints,
)
from mjxgait.physics.batched_trees.tree import (
    FAR,
    Medium,
    ModularSensed,
    Surroundings,
    Tree,
    centres,
    frames,
    lows,
    motions,
    posture,
    root_turns,
)
from mjxgait.physics.lane_major.dynamics import inertias, unpack
from mjxgait.physics.lane_major.kinematics import Motion, Pose
from mjxgait.physics.lane_major.lanes import (
    one_kernel,
    pinned_by,
    turn_each,
)
from mjxgait.physics.lane_major.newton import Problem, constrained_acceleration
from mjxgait.physics.lane_major.plant import turned
from mjxgait.physics.lane_major.treematrix import Rows, factor, on_pivot, solve, sparsity
from mjxgait.types import BodyState, Plant, Sensed, pytree


@pytree
class Moment:
    """Step data of the current state.

    turns: [3, 3, L] the root's axes. freedom: components [n, L] of each hinge's motion.
    mass: rows. bias: [nv, L]. touch: None without a floor. within: of the blocks with each other;
    None if they pass through each other.
    """

    turns: jax.Array
    freedom: tuple[jax.Array, ...]
    mass: Rows
    bias: jax.Array
    touch: Touch | None
    within: within.OwnTouch | None

    @property
    def motion(self) -> Motion:
        """Each hinge's motion."""
        x, y, z, *shift = self.freedom
        return Motion((x, y, z), (shift[0], shift[1], shift[2]))


@dataclasses.dataclass(frozen=True)
class TreePlant(Plant[Moment]):
    """One MuJoCo step of modular bodies; `BodyState.parameters` holds each lane's own tree."""

    around: Surroundings
    note: str = ""
    lane_axis: int = -1

    @override
    def forward(self, state: BodyState) -> tuple[Sensed, Moment]:
        return one_kernel(self._forward)(state)

    @override
    def solve_damped(self, step_data: Moment, damping: jax.Array, force: jax.Array) -> jax.Array:
        return jnp.stack(one_kernel(_solve_damped)(step_data.mass, damping, force))

    def overlap(self, state: BodyState) -> jax.Array:
        """Any pose counts, because these bodies have no drawn pose."""
        tree: Tree = state.parameters
        return deepest(tree, posture(tree, state.qpos, pinned_by(state.friction)))

    def prepared(self, tree: Tree) -> Tree:
        """Return one body, arrays without lanes, with the pairs of blocks that push each other."""
        if not self.around.collide:
            return tree
        return dataclasses.replace(tree, meets=within.meeting(tree))

    def rested(self, tree: Tree, qpos: jax.Array) -> jax.Array:
        """Raise or lower the start [nq] of one body, arrays without lanes, onto the ground."""
        if not self.around.floor:
            return qpos
        lane = jax.tree.map(lambda leaf: leaf[..., None], tree)
        poses = posture(lane, qpos[:, None], pinned_by(jnp.ones(1)))
        return qpos.at[2].add(-jnp.min(lows(lane, poses)))

    @override
    def advance(self, state: BodyState, step_data: Moment, torque: jax.Array) -> BodyState:
        after = one_kernel(self._advance)(state, step_data, torque)
        return dataclasses.replace(after, parameters=state.parameters, ground=state.ground)

    def _forward(self, state: BodyState) -> tuple[Sensed, Moment]:
        tree: Tree = state.parameters
        around, like = self.around, state.friction
        pin = pinned_by(like)
        poses = posture(tree, state.qpos, pin)
        freedom, turns = motions(tree, poses, pin), root_turns(poses)
        body = inertias(tree, poses, like, pin)
        moving = velocities(tree, turns, freedom, list(state.qvel), pin)
        medium: Medium | None = state.ground
        gravity: float | jax.Array = around.gravity
        drag: float | jax.Array = around.drag
        if medium is not None:
            gravity, drag = gravity * (1 - medium.wet), drag * medium.wet
        force = bias_links(tree, body, freedom, moving, state.qvel, gravity, pin)
        washed = jnp.zeros_like(moving)
        if around.drag:
            washed = drag_links(tree, poses, body, moving, drag, pin)
            force = force - washed
        bias = jnp.stack(generalised(tree, turns, freedom, force, pin))
        resisted = jnp.concatenate([jnp.zeros_like(bias[:6]), tree.damping[1:] * state.qvel[6:]])
        moment = Moment(
            turns=turns,
            freedom=freedom.parts,
            mass=mass_rows(tree, turns, freedom, body, pin),
            bias=pin(bias + resisted),
            touch=pin(self._touch(tree, poses, medium)) if around.floor else None,
            within=within.touches(tree, poses, pin) if around.collide else None,
        )
        momentum = jnp.stack([jnp.sum(x, axis=0) for x in body.times(unpack(moving)).shift])
        sensed = self._sensed(state, poses, moving, moment.bias, momentum, washed)
        if around.touch and moment.within is not None:
            near = within.nearest(moment.within, tree.links)
            sensed = dataclasses.replace(
                sensed, body=dataclasses.replace(sensed.body, nearest=near)
            )
        return sensed, moment

    def _touch(self, tree: Tree, poses: Sequence[Pose], medium: Medium | None) -> Touch:
        touch = lowest_corners(tree, poses)
        if medium is None:
            return touch
        return dataclasses.replace(touch, distance=jnp.where(medium.wet > 0, FAR, touch.distance))

    def _sensed(
        self,
        state: BodyState,
        poses: Sequence[Pose],
        moving: jax.Array,
        bias: jax.Array,
        momentum: jax.Array,
        washed: jax.Array,
    ) -> Sensed:
        """Sense the root as trunk and every block as watched.

        Missing blocks are far up, in water all are.
        """
        tree: Tree = state.parameters
        centre = [c + state.qpos[i] for i, c in enumerate(centres(tree, poses))]
        weight, low = tree.mass / jnp.sum(tree.mass, axis=0), lows(tree, poses)
        if state.ground is not None:
            low = jnp.where(state.ground.wet > 0, FAR, low)
        own = ModularSensed(
            com=jnp.stack([jnp.sum(weight * c, axis=0) for c in centre]),
            momentum=momentum,
            water_force=jnp.sum(washed[:, 3:], axis=0),
            limit_excess=jnp.max(jnp.abs(state.qpos[7:]) - tree.high[1:], axis=0),
            depth=jnp.max(-low / sizes(tree), axis=0),
            geom_rot=_block_axes(tree, poses) if self.around.lit else None,
        )
        return Sensed(
            joint_pos=state.qpos[7:],
            joint_vel=state.qvel[6:],
            bias=bias,
            trunk_pos=state.qpos[:3],
            trunk_rot=jnp.stack(poses[0].rot, axis=1),
            trunk_vel=state.qvel[:3],
            trunk_angvel=moving[0, :3],
            geom_pos=jnp.stack(centre, axis=1),
            geom_low=low if self.around.floor else jnp.full_like(low, FAR),
            body=own,
        )

    def _advance(self, state: BodyState, moment: Moment, torque: jax.Array) -> BodyState:
        tree: Tree = state.parameters
        step, touch, pin = self.around.step, moment.touch, pinned_by(state.friction)
        freedom = moment.motion
        points = (moment.turns[0],) * 3 if touch is None else touch.points
        footing = BlockFooting(tree, moment.turns, freedom, points, pin)
        constraints = make_constraints(
            tree, self.around, footing, touch, state.friction, state.qpos, state.qvel
        )
        force = torque - moment.bias
        if moment.within is not None:
            pushing = within.Pushing(
                tree, moment.turns, freedom, moment.mass, moment.within, step, pin
            )
            force = force + pushing.force(state.qvel, list(force))
        problem = Problem(moment.mass, list(force), constraints, pin)
        acceleration, pushed = constrained_acceleration(problem, list(state.warmstart))
        warmstart = jnp.stack(acceleration)
        qvel = state.qvel + step * warmstart
        turned_root = turned(state.qpos[3:7], qvel[3:6], step)
        shifted, bent = state.qpos[:3] + step * qvel[:3], state.qpos[7:] + step * qvel[6:]
        qpos = jnp.concatenate([shifted, jnp.stack(turned_root), bent])
        return BodyState(qpos, qvel, warmstart, jnp.stack(pushed), state.friction)


def _block_axes(tree: Tree, poses: Sequence[Pose]) -> jax.Array:
    """Return the own axes (rows) of each block in the world, [n, 3, 3]."""
    rot = frames(poses)
    own = [jnp.stack(turn_each(rot, tree.axes[:, k]), axis=1) for k in range(3)]
    return jnp.stack(own, axis=1)


def _solve_damped(mass: Rows, damping: jax.Array, force: jax.Array) -> list[jax.Array]:
    pattern = sparsity(range(-1, len(mass) - 1))
    damped = tuple(on_pivot(row, damping[k]) for k, row in enumerate(mass))
    return solve(pattern, factor(pattern, damped), list(force))
