"""Graph from which a body grows.

Letters: `N` nodes, `C` outgoing connections of each, `P` parts that may grow, `n` links
(`physics.batched_trees`).
"""

import dataclasses
import math

import jax
import jax.numpy as jnp

from mjxgait.controllers.sims_brain.chance import between, numbered, numbers
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.reference_body.material import JOINTS
from mjxgait.types import pytree


@dataclasses.dataclass(frozen=True)
class Capacity:
    """Most nodes, outgoing connections of each, parts and links of a body.

    A part needs one link per hinge of its joint, and at least one.
    """

    nodes: int = BrainConfig.nodes
    connections: int = BrainConfig.connections
    parts: int = BrainConfig.parts
    links: int = BrainConfig.links


@dataclasses.dataclass(frozen=True)
class Ranges:
    """Ranges of a genotype's values. half: m; swing: rad; recursion: times a node may recur."""

    half: tuple[float, float] = (0.03, 0.3)
    swing: tuple[float, float] = (0.2, 1.6)
    scale: tuple[float, float] = (0.6, 1.2)
    turn: float = 0.8
    recursion: int = 3


@pytree
class Graph:
    """Genotype of a body. Growth begins at node 0.

    Nodes: half [N, 3] m, half sizes of a block; joint [N], to the parent, an index into
    `reference_body.material.JOINTS`; swing [N, 3] rad, range of each hinge to either side;
    recursion [N], how often a node may recur on one branch.
    Connections, [N, C]: target, a node; used; place [N, C, 3], a direction from the parent block's
    middle, in its half sizes, that leaves the block at the child's joint; turn [N, C, 3] rad about
    the joint's outward axis and the two others; scale; mirror, 0 unchanged, 1 mirrored, 2 both;
    terminal, whether it grows only where its own node may no longer recur.
    """

    half: jax.Array
    joint: jax.Array
    swing: jax.Array
    recursion: jax.Array
    target: jax.Array
    used: jax.Array
    place: jax.Array
    turn: jax.Array
    scale: jax.Array
    mirror: jax.Array
    terminal: jax.Array


def random_graph(key: jax.Array, capacity: Capacity, ranges: Ranges) -> Graph:
    """Draw a random genotype.

    The first connections of the first nodes form a chain of two to four nodes. Each other
    connection of these nodes is used with a chance of 0.35.
    """
    nodes, connections = capacity.nodes, capacity.connections
    each = (nodes, connections)
    drawn = numbers(
        key,
        {
            "half": (nodes, 3),
            "joint": (nodes,),
            "swing": (nodes, 3),
            "recursion": (nodes,),
            "target": each,
            "place": (*each, 3),
            "turn": (*each, 3),
            "scale": each,
            "mirror": each,
            "terminal": each,
            "extra": each,
            "length": (),
        },
    )
    length = 1 + numbered(drawn["length"], min(3, nodes - 1))
    order = jnp.arange(nodes)[:, None]
    chain = (jnp.arange(connections) == 0) & (order < length)
    extra = (drawn["extra"] < 0.35) & (order <= length)
    sizes = (math.log(ranges.half[0]), math.log(ranges.half[1]))
    return Graph(
        half=jnp.exp(between(drawn["half"], sizes)),
        joint=numbered(drawn["joint"], len(JOINTS)),
        swing=between(drawn["swing"], ranges.swing),
        recursion=numbered(drawn["recursion"], ranges.recursion + 1),
        target=jnp.where(chain, order + 1, numbered(drawn["target"], nodes) % (length + 1)),
        used=chain | extra,
        place=between(drawn["place"], (-1.0, 1.0)),
        turn=between(drawn["turn"], (-ranges.turn, ranges.turn)),
        scale=between(drawn["scale"], ranges.scale),
        mirror=numbered(drawn["mirror"], 3),
        terminal=drawn["terminal"] < 0.1,
    )
