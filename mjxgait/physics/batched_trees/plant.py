"""Physics step of a mixed population.

Contacts' values are [4 n, L]: corner by corner, each of all links.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from typing_extensions import override

from mjxgait.physics.batched_trees import within
from mjxgait.physics.batched_trees.dynamics import (
    bias_links,
    deepest,
    drag_links,
    generalised,
    mass_rows,
    sizes,
    tree_rows,
    velocities,
)
from mjxgait.physics.batched_trees.tree import (
    FAR,
    Dense,
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
    up,
)
from mjxgait.physics.lane_major.constraints import Constraints, Springs, contact_terms, limit_terms
from mjxgait.physics.lane_major.dynamics import inertias, pack, unpack
from mjxgait.physics.lane_major.footing import Directions, Level, resistance, spatial
from mjxgait.physics.lane_major.kinematics import Motion, Pose
from mjxgait.physics.lane_major.lanes import (
    Pin,
    axes,
    cross,
    one_kernel,
    pinned_by,
    plus,
    total,
    turn_each,
)
from mjxgait.physics.lane_major.newton import Problem, constrained_acceleration
from mjxgait.physics.lane_major.parameters import Softness
from mjxgait.physics.lane_major.plant import turned
from mjxgait.physics.lane_major.treematrix import Rows, factor, on_pivot, solve, sparsity
from mjxgait.types import BodyState, Plant, Sensed, pytree

CORNERS = 4
IMPEDANCE = np.array([0.9, 0.95, 0.001, 0.5], np.float32).reshape(1, 4, 1)
POWER = (2.0,)
"""MuJoCo's default `solimp`."""
TIME_CONSTANT = 0.02
"""s, MuJoCo's default `solref`, used for the limits of hinges."""
LEVEL = Level()


@pytree
class Touch:
    """Geometry of all contacts.

    distance: [4 n, L] m above the ground, `FAR` for missing blocks and in water.
    points: x, y, z [4 n, L] m from the origin.
    """

    distance: jax.Array
    points: tuple[jax.Array, jax.Array, jax.Array]


def lowest_corners(tree: Tree, poses: Sequence[Pose]) -> Touch:
    """Find the four corners of each block below its centre: those that may touch a plane.

    K, A and B are the half axes pointing down; K is the steepest. The corners are K + A + B,
    K + A - B, K - A + B, and K - A - B or, if that is above the centre, its opposite.
    """
    rot = frames(poses)
    halves = [turn_each(rot, tree.axes[:, k] * tree.half[:, k, None]) for k in range(3)]
    down = [[-jnp.where(half[2] > 0, 1.0, -1.0) * x for x in half] for half in halves]
    steep = [half[2] for half in down]
    first = (steep[0] <= steep[1]) & (steep[0] <= steep[2])
    last = ~first & (steep[2] < steep[1])
    most = [jnp.where(first, x, jnp.where(last, z, y)) for x, y, z in zip(*down, strict=True)]
    one = [jnp.where(first, y, x) for x, y in zip(down[0], down[1], strict=True)]
    other = [jnp.where(last, y, z) for y, z in zip(down[1], down[2], strict=True)]
    below = jnp.where(most[2] - one[2] - other[2] > 0, -1.0, 1.0)
    x, y, z = (
        jnp.concatenate([c + k + a + b, c + k + a - b, c + k - a + b, c + below * (k - a - b)])
        for c, k, a, b in zip(centres(tree, poses), most, one, other, strict=True)
    )
    distance = z + poses[0].origin[2]
    there = jnp.concatenate([tree.solid] * CORNERS) > 0
    return Touch(jnp.where(there, distance, FAR), (x, y, z - 0.5 * distance))


@dataclasses.dataclass(frozen=True)
class BlockFooting:
    """Operators of the contact Jacobian in one state; compare `lane_major.footing`."""

    tree: Tree
    turns: jax.Array
    freedom: Motion
    points: tuple[jax.Array, jax.Array, jax.Array]
    pin: Pin

    def along(self, vector: Sequence[jax.Array]) -> Directions:
        """J x for x [nv] of [L]."""
        moving = velocities(self.tree, self.turns, self.freedom, vector, self.pin)
        motion = jnp.concatenate([moving] * CORNERS)
        velocity = plus(axes(motion[:, 3:]), cross(axes(motion), self.points))
        return self.pin(LEVEL.into((velocity[0], velocity[1], velocity[2])))

    def gathered(self, force: Directions) -> dict[int, jax.Array]:
        """J^T f: [L] per degree of freedom."""
        pull = LEVEL.out(force)
        wrench = self._folded([*cross(self.points, pull), *pull])
        shares = generalised(self.tree, self.turns, self.freedom, wrench, self.pin)
        return dict(enumerate(self.pin(shares)))

    def stiffened(self, mass: Rows, stiffness: Sequence[jax.Array]) -> Rows:
        """Rows of M + J^T D J; stiffness as in `lane_major.footing`."""
        held = up(
            self.tree, self._folded(spatial(LEVEL.stiffness(stiffness), self.points)), self.pin
        )
        entries = [held[:, c] for c in range(21)]
        force = Motion(*_halves(resistance(entries, self.freedom)))
        spin = (self.turns[:, 0], self.turns[:, 1], self.turns[:, 2])
        turning = Motion(spin, (0.0, 0.0, 0.0))
        root = Motion(*_halves(resistance([held[0, c] for c in range(21)], turning)))
        rows = tree_rows(self.tree, self.turns, self.freedom, force, root, self.pin)
        xx, yy, zz, xy, xz, yz = (held[0, c] for c in range(15, 21))
        rows[:3] = [jnp.stack([xx]), jnp.stack([xy, yy]), jnp.stack([xz, yz, zz])]
        return tuple(a + b for a, b in zip(mass, rows, strict=True))

    def _folded(self, values: Sequence[jax.Array]) -> jax.Array:
        """Sum contacts' components [4 n, L] over each block: [n, components, L]."""
        n = self.tree.links
        corners = [[value[k * n : (k + 1) * n] for k in range(CORNERS)] for value in values]
        return pack([total(corner) for corner in corners], self.pin)


def make_constraints(
    tree: Tree,
    around: Surroundings,
    footing: BlockFooting,
    touch: Touch | None,
    friction: jax.Array,
    qpos: jax.Array,
    qvel: jax.Array,
) -> Constraints:
    """Make the constraints of this state: all corners, all limits. friction: [L], a factor."""
    pin, shape = footing.pin, Dense(tree.links, around.iterations, around.line_iterations)
    over_low, under_high = qpos[7:] - tree.low[1:], tree.high[1:] - qpos[7:]
    hinges = Springs(_softness(max(TIME_CONSTANT, 2 * around.step)), POWER, tree.dof_weight[1:])
    limit = limit_terms(hinges, over_low, under_high, qvel[6:], pin)
    if touch is None:
        empty = jnp.zeros((0, *friction.shape), friction.dtype)
        return Constraints(shape, None, empty, (empty, empty, empty), empty, *limit)
    softness = _softness(around.contact)
    corners = Springs(softness, POWER, jnp.concatenate([tree.body_weight] * CORNERS))
    mu = jnp.broadcast_to(around.friction * friction, touch.distance.shape)
    contact = contact_terms(corners, touch.distance, mu, footing.along(list(qvel)), pin)
    return Constraints(shape, footing, *contact, *limit)


def _softness(time_constant: float) -> Softness:
    """Softness of a critically damped constraint (computation docs, "Reference")."""
    time = float(IMPEDANCE[0, 1, 0]) * time_constant
    stiffness, damping, none = (
        np.full((1, 1), x, np.float32) for x in (1 / time**2, 2 / time, 0.0)
    )
    return Softness(stiffness, damping, IMPEDANCE, none)


def _halves(
    values: tuple[jax.Array, ...],
) -> tuple[tuple[jax.Array, jax.Array, jax.Array], tuple[jax.Array, jax.Array, jax.Array]]:
    a, b, c, d, e, f = values
    return (a, b, c), (d, e, f)


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
        spin_x, spin_y, spin_z, *shift = moment.freedom
        freedom = Motion((spin_x, spin_y, spin_z), (shift[0], shift[1], shift[2]))
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
