"""Grown bodies as arrays for the physics, and their facts for controllers and tasks.

Letters: `P` parts, `n` links.
"""

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.sims_brain.genotype import Capacity, Graph
from mjxgait.controllers.sims_brain.growth import HINGES, Parts, grown
from mjxgait.controllers.sims_brain.reference_body import AXES, DAMPING, DENSITY, ROTOR, STRENGTH
from mjxgait.creature.anatomy import Corrections, Feet, Frame, Gains, Joints, Mirror
from mjxgait.creature.body import GivenBody
from mjxgait.physics.batched_trees.dynamics import weighed
from mjxgait.physics.batched_trees.tree import Tree
from mjxgait.types import pytree

TURNS_ABOUT = np.array([(*axes, *[2] * (3 - len(axes))) for axes in AXES])
"""Hinge axes of each joint type, as indices of the part's axes; 2 if there is no hinge."""


@pytree
class GrownBody:
    """Phenotype. part: [n] part of a link. hinge: [n] index of its hinge in the part.

    strength: [n] N·m. sign: [n], -1 if the angle is that of a mirror image.
    """

    parts: Parts
    tree: Tree
    part: jax.Array
    hinge: jax.Array
    strength: jax.Array
    sign: jax.Array


def body_of(graph: Graph, capacity: Capacity) -> GrownBody:
    """Return the body that grows from a graph."""
    parts = grown(graph, capacity)
    kind, counts = graph.joint[parts.node], jnp.asarray(HINGES)
    hinges = jnp.where(jnp.arange(capacity.parts) == 0, 0, counts[kind])
    first = parts.last - jnp.maximum(hinges, 1) + 1
    link = jnp.arange(capacity.links)[:, None]
    own = parts.exists & (first <= link) & (link <= parts.last)
    there, part = own.any(1), own.argmax(1)
    hinge = jnp.where(there, jnp.arange(capacity.links) - first[part], 0)
    moves = there & (hinges[part] > 0)
    swing = graph.swing[parts.node[part], hinge]
    strength = _strength(parts, part) * moves
    damping = DAMPING * strength
    tree = Tree(
        **_joints(parts, kind, part, hinge, there),
        **_blocks(parts, kind, part, there & (parts.last[part] == link[:, 0])),
        moves=moves.astype(jnp.float32),
        armature=ROTOR * damping,
        damping=damping,
        low=-swing,
        high=swing,
        body_weight=jnp.zeros(capacity.links),
        dof_weight=jnp.zeros(capacity.links),
    )
    axis = jnp.asarray(TURNS_ABOUT)[kind[part], hinge]
    # Blocks are mirrored along y, and a turn about y is its own mirror image.
    sign = 1.0 - 2.0 * parts.copies[part] * (axis != 1)
    return GrownBody(parts, weighed(tree), part, hinge, strength, sign)


def _frames(kind: jax.Array, hinge: jax.Array) -> jax.Array:
    """Return the axes (rows) [..., 3, 3] of a link in its part's frame; it turns about z."""
    axis = jnp.asarray(TURNS_ABOUT)[kind, hinge]
    order = jnp.stack([(axis + 1) % 3, (axis + 2) % 3, axis], axis=-1)
    return jnp.eye(3)[order]


def _joints(
    parts: Parts, kind: jax.Array, part: jax.Array, hinge: jax.Array, there: jax.Array
) -> dict[str, jax.Array]:
    """Return the `Tree` fields of the links' connections."""
    links = len(part)
    numbers = jnp.arange(links)
    parent = jnp.where(hinge > 0, numbers - 1, parts.last[parts.parent[part]])
    above = jnp.where(numbers == 0, 0, parent)
    frame = jnp.where((numbers > 0)[:, None, None], _frames(kind[part], hinge), jnp.eye(3))
    on_part = jnp.where((hinge > 0)[:, None, None], jnp.eye(3), parts.turn[part])
    turn = jnp.einsum("lij,ljk,lmk->lim", frame, on_part, frame[above])
    place = jnp.einsum("lij,lj->li", frame[above], parts.place[part])
    is_child = there & (numbers > 0)
    one_hot = (numbers == parent[:, None]) & is_child[:, None]
    chain = jnp.eye(links)

    def lengthened(link: jax.Array, chain: jax.Array) -> jax.Array:
        return chain + (numbers == link)[:, None] * chain[parent[link]] * is_child[link]

    return {
        "parent": one_hot.astype(jnp.float32),
        "above": jax.lax.fori_loop(1, links, lengthened, chain),
        "turn": turn,
        "place": place * (hinge == 0)[:, None],
    }


def _blocks(
    parts: Parts, kind: jax.Array, part: jax.Array, solid: jax.Array
) -> dict[str, jax.Array]:
    """Return the `Tree` fields of the links' masses and sizes."""
    half = parts.half[part]
    root = (jnp.arange(len(part)) == 0)[:, None]
    last = jnp.maximum(jnp.asarray(HINGES)[kind], 1) - 1
    frame = _frames(kind, last)[part]
    frame = jnp.where(root[:, :, None], jnp.eye(3), frame)
    mass = DENSITY * 8 * jnp.prod(half, axis=1) * solid
    square = half * half
    return {
        "solid": solid.astype(jnp.float32),
        "mass": mass,
        "half": half,
        "axes": jnp.swapaxes(frame, 1, 2),
        "com": jnp.where(root, 0.0, frame[:, :, 0] * half[:, :1]),
        "inertia": mass[:, None] / 3 * (square.sum(1, keepdims=True) - square),
    }


def _strength(parts: Parts, part: jax.Array) -> jax.Array:
    """Return the strength [n] in N·m, proportional to the child's cross-section at the joint."""
    half = parts.half[part]
    return STRENGTH * 4 * half[:, 1] * half[:, 2]


WORLD_AXES = np.eye(3, dtype=np.float32)


def anatomy(links: int) -> GivenBody:
    """Return the facts shared by all bodies with this many links.

    Every link but the root has a hinge, and every link's block is a foot.
    """
    hinges, none = links - 1, np.zeros(links - 1, np.float32)
    endless = np.full(hinges, np.inf, np.float32)
    frame = Frame(
        forward=WORLD_AXES[0],
        left=WORLD_AXES[1],
        up=WORLD_AXES[2],
        stand_pos=np.zeros(3, np.float32),
        stand_rot=WORLD_AXES,
        start_axes=(WORLD_AXES[0], WORLD_AXES[1]),
        hip_height=1.0,
        body_length=1.0,
        mass=1.0,
    )
    names = tuple(f"link{link}" for link in range(1, links))
    return GivenBody(
        frame=frame,
        joints=Joints(
            none,
            -endless,
            endless,
            -endless,
            endless,
            names=names,
            qpos=tuple(range(7, 7 + hinges)),
            dofs=tuple(range(6, 6 + hinges)),
        ),
        gains=Gains(none, none, endless),
        mirror=Mirror(none + 1, tuple(range(hinges)), False),
        corrections=Corrections(none, none, none, none),
        feet=Feet(("root", *names), tuple(range(links)), tuple(range(links)), ()),
        nv=6 + hinges,
    )
