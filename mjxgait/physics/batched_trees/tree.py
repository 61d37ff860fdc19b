"""Tree of a body as data.

Letters: `n` links, the root first and parents before children; `L` lanes. Every array has the
lanes as one more, innermost axis.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp

from mjxgait.physics.lane_major.kinematics import Motion, Pose, unit_quaternion
from mjxgait.physics.lane_major.lanes import (
    Pin,
    Vector,
    axes,
    cross,
    parts,
    plus,
    rotation,
    sin_cos,
    total,
    turn,
    turn_each,
)
from mjxgait.physics.lane_major.treematrix import Sparsity, sparsity
from mjxgait.types import pytree

FAR = 1e3
"""m above the ground, for blocks that are missing, and for all where there is no ground."""


@pytree
class ModularSensed:
    """Quantities of a modular body, `Sensed.body`.

    com: [3] m, centre of all mass. momentum: [3] kg·m/s, total.
    water_force: [3] N, total; 0 without water.
    limit_excess: [] rad, largest excess of a hinge beyond its range.
    depth: [] of the deepest block in the ground, in units of the block's size (the cube root of its
    volume); negative where all are above.
    nearest: [G] m from each watched block to the nearest other one of its body that it can push,
    along their normals, negative inside it; None where nothing senses it.
    geom_rot: [G, 3, 3], rows are the own axes of each watched block in the world; only where vision
    needs it.
    cube: [3] m, middle of the cube of a contest. gaps: [2] m from there to the nearest block of the
    body and of its opponent. None without one.
    """

    com: jax.Array
    momentum: jax.Array
    water_force: jax.Array
    limit_excess: jax.Array
    depth: jax.Array
    nearest: jax.Array | None = None
    geom_rot: jax.Array | None = None
    cube: jax.Array | None = None
    gaps: jax.Array | None = None


@pytree
class Tree:
    """Numbers of a modular body.

    A link turns about the z axis of its own frame. A part with several hinges is several links in
    a row, and the last of them carries its block. A part that is rigid on its parent is a link that
    does not move. Links that a lane does not have come last, move nothing and weigh nothing.

    parent: [n, n] 1 where the column is the row's parent; above: [n, n] 1 where it is the row
    itself or above it. place: [n, 3] m of the hinge, and turn: [n, 3, 3] the axes (rows) of a link
    at angle 0, in the parent's frame. moves: [n] 1 for a hinge.
    mass: [n] kg; com: [n, 3] m; axes: [n, 3, 3] the block's own axes (rows) in the link's frame;
    inertia: [n, 3] kg·m² about them; half: [n, 3] m, half of the block's sides; solid: [n] 1 for a
    link with a block.
    armature: [n] kg·m²; damping: [n] N·m·s/rad; low, high: [n] rad, where limits' springs begin.
    body_weight: [n] 1/kg, dof_weight: [n] 1/(kg·m²), as MuJoCo's `invweight0`.
    meets: [n, n] 1 where two blocks push each other; None if all pass through each other.
    """

    parent: jax.Array
    above: jax.Array
    place: jax.Array
    turn: jax.Array
    moves: jax.Array
    mass: jax.Array
    com: jax.Array
    axes: jax.Array
    inertia: jax.Array
    half: jax.Array
    solid: jax.Array
    armature: jax.Array
    damping: jax.Array
    low: jax.Array
    high: jax.Array
    body_weight: jax.Array
    dof_weight: jax.Array
    meets: jax.Array | None = None

    @property
    def links(self) -> int:
        """Number of links, n."""
        return self.mass.shape[0]


@pytree
class Medium:
    """Medium of a lane, `BodyState.ground`. wet: [] 1 in water, 0 on land."""

    wet: jax.Array


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """Settings that all lanes share, constants of the program.

    Where lanes have a `Medium`, floor and gravity are those of land, and the drag is that of water.

    step: s. friction: of the ground. contact: s, time constant of a contact (`solref`). floor:
    whether there is one, z = 0. gravity: m/s². drag: N·s/m³, the resistance of a face to its normal
    velocity, per area; 0 without water. lit: whether there is a light to sense. collide: whether
    the blocks of a body push each other, unless a single joint is between them. touch: whether to
    sense how near they are.
    iterations, line_iterations: of the contact solver.
    """

    step: float = 0.005
    friction: float = 0.9
    contact: float = 0.02
    floor: bool = True
    gravity: float = 9.81
    drag: float = 0.0
    iterations: int = 3
    line_iterations: int = 6
    lit: bool = False
    collide: bool = False
    touch: bool = False


@dataclasses.dataclass(frozen=True)
class Hinge:
    """Degree of freedom of a limit, for the solver."""

    dof: int


@dataclasses.dataclass(frozen=True)
class Dense:
    """Shape of the solver's problem; every degree of freedom may move every other."""

    links: int
    iterations: int
    line_iterations: int

    @property
    def pattern(self) -> Sparsity:
        """Single chain of all degrees of freedom."""
        return sparsity(range(-1, self.links + 4))

    @property
    def limits(self) -> tuple[Hinge, ...]:
        """Limits of all hinges."""
        return tuple(Hinge(6 + j) for j in range(self.links - 1))


def posture(tree: Tree, qpos: jax.Array, pin: Pin) -> list[Pose]:
    """Forward kinematics of qpos [7 + n - 1, L]: pose of every link."""
    columns = [jnp.stack(column) for column in rotation(unit_quaternion(qpos[3:7]))]
    none = jnp.zeros_like(columns[0])
    known = [pin(jnp.concatenate([*columns, none]))]
    sines, cosines = sin_cos(qpos[7:])
    for link in range(1, tree.links):
        above = total([known[a] * tree.parent[link, a] for a in range(link)])
        rot, pos = [above[:3], above[3:6], above[6:9]], above[9:]
        x, y, z = (turn(rot, parts(tree.turn[link, axis])) for axis in range(3))
        sin, cos = sines[link - 1], cosines[link - 1]
        place = pos + turn(rot, parts(tree.place[link]))
        known.append(pin(jnp.concatenate([x * cos + y * sin, y * cos - x * sin, z, place])))
    origin = qpos[:3]
    return [Pose(origin, k[9:], (k[:3], k[3:6], k[6:9])) for k in known]


def motions(tree: Tree, poses: Sequence[Pose], pin: Pin) -> Motion:
    """Motion that each hinge at unit velocity gives its link and all below.

    Components [n, L]; zero for the root and for links that do not move.
    """
    axis = jnp.stack([pose.rot[2] for pose in poses]) * tree.moves[:, None]
    place = jnp.stack([pose.pos for pose in poses])
    shift = cross(axes(place), axes(axis))
    return Motion(axes(pin(axis)), pin(shift))


def frames(poses: Sequence[Pose]) -> list[jax.Array]:
    """Stack the three axes of all links, [n, 3, L] each; see `turn_each`."""
    return [jnp.stack([pose.rot[j] for pose in poses]) for j in range(3)]


def centres(tree: Tree, poses: Sequence[Pose]) -> Vector:
    """Centres of all blocks, components [n, L] m from the origin."""
    return plus(hinges(poses), turn_each(frames(poses), tree.com))


def hinges(poses: Sequence[Pose]) -> Vector:
    """Places of all links' hinges, components [n, L] m from the origin."""
    return axes(jnp.stack([pose.pos for pose in poses]))


def lows(tree: Tree, poses: Sequence[Pose]) -> jax.Array:
    """Height [n, L] m of each block's lowest point above z = 0; `FAR` of missing blocks."""
    rot = frames(poses)
    heights = [turn_each(rot, tree.axes[:, k])[2] for k in range(3)]
    reach = total([tree.half[:, k] * jnp.abs(height) for k, height in enumerate(heights)])
    middle = centres(tree, poses)[2] + poses[0].origin[2]
    return jnp.where(tree.solid > 0, middle - reach, FAR)


def root_turns(poses: Sequence[Pose]) -> jax.Array:
    """Axes [3, 3, L] about which the root turns."""
    return jnp.stack(poses[0].rot)


def down(tree: Tree, own: jax.Array, pin: Pin) -> jax.Array:
    """Sum own [n, c, L] over each link and all links above it: [c, L] per link."""
    return pin(
        jnp.stack(
            [
                total([own[a] * tree.above[link, a] for a in range(link + 1)])
                for link in range(tree.links)
            ]
        )
    )


def up(tree: Tree, own: jax.Array, pin: Pin) -> jax.Array:
    """Sum own [n, c, L] over each link and all links below it: [c, L] per link."""
    return pin(
        jnp.stack(
            [
                total([own[below] * tree.above[below, link] for below in range(link, tree.links)])
                for link in range(tree.links)
            ]
        )
    )


def root_motion(turns: jax.Array, vector: Sequence[jax.Array]) -> jax.Array:
    """Root's motion [6, L], angular first, from the first six of [nv] velocities."""
    spin = total([turns[j] * vector[3 + j] for j in range(3)])
    return jnp.concatenate([spin, jnp.stack(vector[:3])])
