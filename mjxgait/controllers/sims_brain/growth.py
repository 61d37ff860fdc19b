"""Growth of a graph into the parts of a body: breadth first, in the order of the connections.

Letters: see `genotype`. A part does not grow, and nothing grows on it, if parts or links are used
up or other blocks are in its place.
"""

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.sims_brain.genotype import Capacity, Graph
from mjxgait.controllers.sims_brain.reference_body import AXES, LARGEST, ROOM, SMALLEST
from mjxgait.types import choose, pytree


@pytree
class Boxes:
    """Blocks at rest in the root's frame. middle, half: [..., 3] m. axes: [..., 3, 3] rows."""

    middle: jax.Array
    half: jax.Array
    axes: jax.Array


def inside(one: Boxes, others: Boxes) -> jax.Array:
    """Return the overlap depth [P] of one block with each other, over the smaller one's size.

    Negative if one of their six normals separates them (`dynamics.deepest`). A size is the cube
    root of a volume.
    """
    apart = others.middle - one.middle
    reach = jnp.abs(others.axes @ one.axes.T)  # [P, other's axis, own axis]
    own = one.half + jnp.einsum("pi,pij->pj", others.half, reach) - jnp.abs(apart @ one.axes.T)
    along = jnp.abs(jnp.einsum("pij,pj->pi", others.axes, apart))
    theirs = others.half + jnp.einsum("j,pij->pi", one.half, reach) - along
    depth = jnp.minimum(own, theirs).min(axis=1)
    return depth / jnp.minimum(size(one.half), size(others.half))


def size(half: jax.Array) -> jax.Array:
    """Return the cube root [...] in m of the volume of blocks with half sizes [..., 3]."""
    return 2 * jnp.cbrt(jnp.prod(half, axis=-1))


HINGES = np.array([len(axes) for axes in AXES])
"""Number of hinges of each of `JOINTS`."""


@pytree
class Parts:
    """Grown body, part by part; parents come first, the root is part 0.

    exists: [P]. node, parent: [P]. copies: [P], 1 for a mirror image of its node, else 0.
    half: [P, 3] m. place: [P, 3] m of the joint in the parent's frame. turn: [P, 3, 3] axes (rows)
    of the part there, before the joint turns. last: [P] last of the part's links (one per hinge),
    which carries the block. depth: [P] earlier occurrences of the node on the branch.
    """

    exists: jax.Array
    node: jax.Array
    parent: jax.Array
    copies: jax.Array
    half: jax.Array
    place: jax.Array
    turn: jax.Array
    last: jax.Array
    depth: jax.Array


@pytree
class _Growing:
    """State of growth.

    parts: so far. boxes: their blocks at rest. count: [] parts. links: [] used. branch: [P, N]
    occurrences of each node on a part's branch. scale: [P] of each part.
    """

    parts: Parts
    boxes: Boxes
    count: jax.Array
    links: jax.Array
    branch: jax.Array
    scale: jax.Array


def grown(graph: Graph, capacity: Capacity) -> Parts:
    """Return the body of a graph."""
    connections = graph.target.shape[1]

    def step(turn: jax.Array, growing: _Growing) -> _Growing:
        part, connection = turn // connections, turn % connections
        place = growing.parts.node[part], connection
        grows = _grows(graph, capacity, growing, part, place)
        mirror = graph.mirror[place]
        before, room = growing, jnp.bool_(True)
        for image in (0, 1):
            wanted = grows & ((mirror == image) | (mirror == 2))
            growing, fits = _with_part(graph, growing, part, place, image, wanted)
            room = room & fits
        return choose(room, growing, before)

    growing = jax.lax.fori_loop(0, capacity.parts * connections, step, _seed(graph, capacity))
    return growing.parts


def _seed(graph: Graph, capacity: Capacity) -> _Growing:
    """Return the state with the root alone."""
    most = capacity.parts
    one = jnp.arange(most) == 0
    none = jnp.zeros(most, jnp.int32)
    half = jnp.where(one[:, None], _size(graph.half[0], jnp.float32(1.0)), 1.0)
    axes, nowhere = jnp.tile(jnp.eye(3), (most, 1, 1)), jnp.zeros((most, 3))
    return _Growing(
        Parts(
            exists=one,
            node=none,
            parent=none,
            copies=none,
            half=half * one[:, None],
            place=nowhere,
            turn=axes,
            last=none,
            depth=none,
        ),
        boxes=Boxes(nowhere, half, axes),
        count=jnp.int32(1),
        links=jnp.int32(1),
        branch=jnp.outer(one, jnp.arange(graph.half.shape[0]) == 0).astype(jnp.int32),
        scale=jnp.ones(most),
    )


Place = tuple[jax.Array, jax.Array]
"""Connection: its node, and its index among the node's connections."""


def _grows(
    graph: Graph, capacity: Capacity, growing: _Growing, part: jax.Array, place: Place
) -> jax.Array:
    """Return whether [] a connection grows on a part; a pair grows together or not at all."""
    source, target = place[0], graph.target[place]
    times, limit = growing.branch[part], graph.recursion + 1
    allowed = (times[target] < limit[target]) & (
        ~graph.terminal[place] | (times[source] >= limit[source])
    )
    images = jnp.where(graph.mirror[place] == 2, 2, 1)
    room = (growing.count + images <= capacity.parts) & (
        growing.links + images * _links(graph, target) <= capacity.links
    )
    return growing.parts.exists[part] & graph.used[place] & allowed & room


def _links(graph: Graph, node: jax.Array) -> jax.Array:
    """Return the number of links that a part of this node needs."""
    return jnp.maximum(jnp.asarray(HINGES)[graph.joint[node]], 1)


def _with_part(
    graph: Graph,
    growing: _Growing,
    part: jax.Array,
    at: Place,
    image: int,
    grows: jax.Array,
) -> tuple[_Growing, jax.Array]:
    """Add a part if it `grows`; also return False [] if other blocks are in its place.

    image: 1 for the mirrored copy.
    """
    parts, boxes = growing.parts, growing.boxes
    target, times = graph.target[at], growing.branch[part]
    needed = _links(graph, target)
    here = (jnp.arange(len(parts.node)) == growing.count) & grows
    copies = parts.copies[part] ^ image
    scale = growing.scale[part] * graph.scale[at]
    joint, axes = joined(parts.half[part], graph.place[at], graph.turn[at])
    # A part's frame is at its joint, its block's middle half a block further; the root has none.
    outward = jnp.array([1.0, 0.0, 0.0]) * jnp.where(part > 0, parts.half[part, 0], 0.0)
    flip = jnp.where(copies > 0, jnp.array([1.0, -1.0, 1.0]), 1.0)
    joint, turn = joint * flip, axes * flip[:, None] * flip
    box = _hung(boxes, part, _size(graph.half[target], scale), joint, turn)
    crowded = (inside(box, boxes) > ROOM) & parts.exists & (jnp.arange(len(parts.node)) != part)

    def put(array: jax.Array, value: jax.Array) -> jax.Array:
        # Not a scatter, which takes the compiler longer.
        return jnp.where(here.reshape(-1, *[1] * (array.ndim - 1)), value, array)

    grown = _Growing(
        Parts(
            exists=put(parts.exists, jnp.bool_(True)),
            node=put(parts.node, target),
            parent=put(parts.parent, part),
            copies=put(parts.copies, copies),
            half=put(parts.half, box.half),
            place=put(parts.place, joint + outward),
            turn=put(parts.turn, turn),
            last=put(parts.last, growing.links + needed - 1),
            depth=put(parts.depth, times[target]),
        ),
        boxes=jax.tree.map(put, boxes, box),
        count=growing.count + grows,
        links=growing.links + jnp.where(grows, needed, 0),
        branch=put(growing.branch, times + (jnp.arange(len(times)) == target)),
        scale=put(growing.scale, scale),
    )
    return grown, ~(grows & crowded.any())


def _hung(
    boxes: Boxes, part: jax.Array, half: jax.Array, joint: jax.Array, turn: jax.Array
) -> Boxes:
    """Return a child's block at rest. joint: m from the middle of the parent's block."""
    axes = turn @ boxes.axes[part]
    middle = boxes.middle[part] + joint @ boxes.axes[part] + half[0] * axes[0]
    return Boxes(middle, half, axes)


def joined(half: jax.Array, place: jax.Array, turn: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return a child's joint [3] in m from a block's middle, and its axes [3, 3] (rows) there.

    The first axis is normal to the face. The axes are then turned by `turn[0]` about the first
    axis, then about the second and the third.
    """
    steepest = jnp.argmax(jnp.abs(place))
    sign = jnp.where(place[steepest] < 0, -1.0, 1.0)
    reach = jnp.maximum(jnp.abs(place[steepest]), 1e-6)
    outward = jnp.eye(3)[steepest] * sign
    second = jnp.eye(3)[(steepest + 1) % 3]
    base = jnp.stack([outward, second, jnp.cross(outward, second)])
    return half * place / reach, _about(2, turn[2]) @ _about(1, turn[1]) @ _about(0, turn[0]) @ base


def _about(axis: int, angle: jax.Array) -> jax.Array:
    """Return the axes (rows) after a turn about one of them."""
    along, across = np.zeros((2, 3, 3), np.float32)
    along[axis, axis] = 1
    i, j = (axis + 1) % 3, (axis + 2) % 3
    across[i, j], across[j, i] = 1, -1
    return jnp.cos(angle) * (np.eye(3) - along) + jnp.sin(angle) * across + along


def _size(half: jax.Array, scale: jax.Array) -> jax.Array:
    return jnp.clip(half * scale, SMALLEST, LARGEST)
