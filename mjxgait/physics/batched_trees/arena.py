"""Physics step of a modular body, its opponent, and a cube between them (Sims 1994, competition).

The body's own state is as on open ground. All else is its `Arena`, in `BodyState.ground`: the
opponent with its brain, and the cube. All three push each other.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.physics.batched_trees.collision import Boxes, gap, pushes
from mjxgait.physics.batched_trees.dynamics import generalised, velocities
from mjxgait.physics.batched_trees.plant import Moment, TreePlant
from mjxgait.physics.batched_trees.tree import (
    ModularSensed,
    Tree,
    centres,
    frames,
    lows,
    posture,
)
from mjxgait.physics.lane_major.lanes import (
    axes,
    cross,
    one_kernel,
    pinned_by,
    plus,
    total,
    turn_each,
)
from mjxgait.types import BodyState, Plant, Sensed, pytree

Act = Callable[[Any, Any, Sensed], tuple[jax.Array, Any]]
"""From the opponent's brain, memory and observations (one lane) to torques [J] and memory."""


@pytree
class Arena:
    """What is around a body. opponent, cube: states. brain, mind: the opponent's, and its memory.

    torque: [J] N·m, the opponent's latest. count: [] steps so far.
    """

    opponent: BodyState
    cube: BodyState
    brain: Any
    mind: Any
    torque: jax.Array
    count: jax.Array


@pytree
class ArenaMoment:
    """Step data. both: of the body's lanes and then the opponent's. sensed: the opponent's.

    push: generalised forces [nv, L] by each other on body, opponent and cube.
    """

    both: Moment
    cube: Moment
    sensed: Sensed
    push: tuple[jax.Array, jax.Array, jax.Array]


@dataclasses.dataclass(frozen=True, eq=False)
class ArenaPlant(Plant[ArenaMoment]):
    """One MuJoCo step of two bodies and a cube. every: steps per command of the opponent."""

    one: TreePlant
    act: Act
    every: int
    note: str = ""
    lane_axis: int = -1

    @override
    def forward(self, state: BodyState) -> tuple[Sensed, ArenaMoment]:
        arena: Arena = state.ground
        bodies = _beside(_alone(state), arena.opponent)
        seen, both = self.one.forward(bodies)
        of_cube, cube = self.one.forward(arena.cube)
        (mine, its), (first, second) = _halves(seen), _halves(both)
        states = (_alone(state), arena.opponent, arena.cube)
        parts = (mine, its, of_cube), (first, second, cube)
        boxes = [one_kernel(_boxes)(*each) for each in zip(states, *parts, strict=True)]
        boxes[2] = jax.tree.map(lambda leaf: leaf[:1], boxes[2])
        push = self._generalised(states, parts[1], boxes)
        place = of_cube.trunk_pos
        gaps = jnp.stack([gap(each, (place[0], place[1], place[2])) for each in boxes[:2]])
        mine, its = (_with_cube(each, place, gaps) for each in (mine, its))
        return mine, ArenaMoment(both, cube, its, push)

    @override
    def solve_damped(
        self, step_data: ArenaMoment, damping: jax.Array, force: jax.Array
    ) -> jax.Array:
        return self.one.solve_damped(_halves(step_data.both)[0], damping, force)

    @override
    def advance(self, state: BodyState, step_data: ArenaMoment, torque: jax.Array) -> BodyState:
        arena: Arena = state.ground
        acts, mind = self._acted(arena, step_data.sensed)
        mine, its, on_cube = step_data.push
        its = its.at[6:].add(acts)
        bodies = _beside(_alone(state), arena.opponent)
        applied = jnp.concatenate([torque + mine, its], axis=-1)
        own, opponent = _halves(self.one.advance(bodies, step_data.both, applied))
        cube = self.one.advance(arena.cube, step_data.cube, on_cube)
        after = Arena(opponent, cube, arena.brain, mind, acts, arena.count + 1)
        return dataclasses.replace(own, ground=after)

    @override
    def overlap(self, state: BodyState) -> jax.Array:
        return self.one.overlap(_alone(state))

    def _acted(self, arena: Arena, sensed: Sensed) -> tuple[jax.Array, Any]:
        """Return the opponent's torques [J, L] and memory. All lanes act in the same steps."""

        def acted() -> tuple[jax.Array, Any]:
            return jax.vmap(self.act, -1, -1)(arena.brain, arena.mind, sensed)

        if self.every == 1:
            return acted()
        due = arena.count.reshape(-1)[0] % self.every == 0
        return jax.lax.cond(due, acted, lambda: (arena.torque, arena.mind))

    def _generalised(
        self, states: tuple[BodyState, ...], moments: tuple[Moment, ...], boxes: list[Boxes]
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Return the generalised forces by which body, opponent and cube push each other."""
        step = self.one.around.step
        mine, its, cube = one_kernel(partial(_pushed, step))(*boxes)
        missing = ((0, states[2].parameters.links - 1), (0, 0), (0, 0))
        force = (mine, its, jnp.pad(cube, missing))
        on = zip(states, moments, boxes, force, strict=True)
        own, other, last = (jnp.stack(one_kernel(_projected)(*each)) for each in on)
        return own, other, last


def resting(tree: Tree, start: jax.Array) -> BodyState:
    """Return the state of a body at rest. start: [nq]; arrays without lanes."""
    still = jnp.zeros(tree.links + 5)
    return BodyState(start, still, still, still, jnp.ones(()), parameters=tree)


def cube_tree(side: float, density: float) -> Tree:
    """Return a cube: one block, and a link that is missing. side: m. density: kg/m³."""
    first, zero, none = jnp.array([1.0, 0.0]), jnp.zeros(2), jnp.zeros((2, 3))
    mass, same = density * side**3, jnp.broadcast_to(jnp.eye(3), (2, 3, 3))
    return Tree(
        parent=jnp.zeros((2, 2)),
        above=jnp.eye(2),
        place=none,
        turn=same,
        moves=zero,
        mass=mass * first,
        com=none,
        axes=same,
        inertia=mass * side**2 / 6 * jnp.outer(first, jnp.ones(3)),
        half=side / 2 * jnp.outer(first, jnp.ones(3)),
        solid=first,
        armature=zero,
        damping=zero,
        low=zero,
        high=zero,
        body_weight=first / mass,
        dof_weight=zero,
    )


def reach(tree: Tree) -> jax.Array:
    """Return the largest sum [] in m of x and height over all corners, at rest with angles of 0.

    A plane that leans back over the body by 45° meets the ground there (Sims 1994).
    """
    lane = jax.tree.map(lambda leaf: leaf[..., None], tree)
    rest = jnp.zeros((tree.links + 6, 1)).at[3].set(1.0)
    poses = posture(lane, rest, pinned_by(jnp.ones(1)))
    rot, middle = frames(poses), centres(lane, poses)
    own = [turn_each(rot, lane.axes[:, k]) for k in range(3)]
    leaning = total([lane.half[:, k] * abs(axis[0] + axis[2]) for k, axis in enumerate(own)])
    far = jnp.where(lane.solid > 0, middle[0] + middle[2] + leaning, -jnp.inf)
    return jnp.max(far) - jnp.min(lows(lane, poses))


def _alone(state: BodyState) -> BodyState:
    return dataclasses.replace(state, ground=None)


def _beside(one: Any, other: Any) -> Any:
    """Return two pytrees with the lanes of the second after those of the first."""
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b], axis=-1), one, other)


def _halves(both: Any) -> tuple[Any, Any]:
    """Split what `_beside` joined."""

    def half(which: int) -> Any:
        return jax.tree.map(lambda leaf: jnp.split(leaf, 2, axis=-1)[which], both)

    return half(0), half(1)


def _with_cube(sensed: Sensed, place: jax.Array, gaps: jax.Array) -> Sensed:
    own: ModularSensed = sensed.body
    return dataclasses.replace(sensed, body=dataclasses.replace(own, cube=place, gaps=gaps))


def _boxes(state: BodyState, sensed: Sensed, moment: Moment) -> Boxes:
    """Return the blocks of a body in the world."""
    tree: Tree = state.parameters
    own: ModularSensed = sensed.body
    assert own.geom_rot is not None
    pin, middle = pinned_by(state.friction), axes(sensed.geom_pos)
    moving = velocities(tree, moment.turns, moment.motion, list(state.qvel), pin)
    spin, slide = axes(moving), axes(moving[:, 3:])
    x, y, z = (m - state.qpos[c] for c, m in enumerate(middle))
    drift = plus(slide, cross(spin, (x, y, z)))
    return Boxes(
        middle=middle,
        axes=(axes(own.geom_rot[:, 0]), axes(own.geom_rot[:, 1]), axes(own.geom_rot[:, 2])),
        half=axes(tree.half),
        mass=tree.mass,
        solid=tree.solid,
        spin=spin,
        drift=(drift[0], drift[1], drift[2]),
    )


def _pushed(step: float, *boxes: Boxes) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return moments about the middles and forces [n, 6, L] on the blocks of three bodies."""
    own, other, cube = boxes
    pin = pinned_by(own.mass[0])
    by_other, on_other = pushes(own, other, step, pin)
    by_cube, on_cube = pushes(own, cube, step, pin)
    its, also = pushes(other, cube, step, pin)
    return by_other + by_cube, on_other + its, on_cube + also


def _projected(state: BodyState, moment: Moment, boxes: Boxes, force: jax.Array) -> list[jax.Array]:
    """Return the generalised force [nv] of [L]. force: [n, 6, L], moments first."""
    pull, pin = axes(force[:, 3:]), pinned_by(state.friction)
    x, y, z = (m - state.qpos[c] for c, m in enumerate(boxes.middle))
    about_root = plus(axes(force), cross((x, y, z), pull))
    wrench = pin(jnp.stack([*about_root, *pull], axis=1))
    return generalised(state.parameters, moment.turns, moment.motion, wrench, pin)
