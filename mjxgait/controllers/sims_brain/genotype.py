"""Genotype of a body and its nerves: a graph, and neurons at its nodes.

Letters: `N` nodes, `C` outgoing connections of each, `P` parts that may grow, `n` links
(`physics.batched_trees`); `Q` neurons of a node, `M` central ones, with 3 inputs each, and 3
effectors per node.
"""

import dataclasses
import math
from collections.abc import Hashable, Mapping
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.reference_body import INPUTS, JOINTS, NEURONS, SENSORS
from mjxgait.types import pytree

Name = TypeVar("Name", bound=Hashable)
LEAST = 2.0**-24
"""Half of the smallest positive number that is drawn."""


def uniforms(key: jax.Array, shapes: Mapping[Name, tuple[int, ...]]) -> dict[Name, jax.Array]:
    """Draw uniform numbers in [0, 1), by name, in these shapes."""
    ends = np.cumsum([math.prod(shape) for shape in shapes.values()])
    parts = jnp.split(jax.random.uniform(key, (int(ends[-1]),)), ends[:-1])
    return {n: part.reshape(shapes[n]) for n, part in zip(shapes, parts, strict=True)}


def between(uniform: jax.Array, bounds: tuple[float, float]) -> jax.Array:
    """Map [0, 1) to a range."""
    return bounds[0] + (bounds[1] - bounds[0]) * uniform


def numbered(uniform: jax.Array, count: int) -> jax.Array:
    """Map [0, 1) to the integers 0 to `count` - 1, all equally likely."""
    return jnp.floor(uniform * count).astype(jnp.int32)


def normal(uniform: jax.Array) -> jax.Array:
    """Map uniform numbers in [0, 1) to a normal distribution."""
    return math.sqrt(2) * jax.lax.erf_inv(2 * jnp.maximum(uniform, LEAST) - 1)


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
    `reference_body.JOINTS`; swing [N, 3] rad, range of each hinge to either side; recursion [N],
    how often a node may recur on one branch.
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
    drawn = uniforms(
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


STEER = (-1.0, 1.0)
"""Range of `Nerves.steer`. A hinge's drive is limited to this range."""
STEER_SCALE, STEERED = (0.05, 0.7), 0.5
"""Range of the standard deviation of a random genome's `Nerves.steer`, log-uniform, and the share
of hinges that have any. Weights uniform in `STEER` drown the motion of nearly all creatures."""
CONSTANT, WAVE = 0.3, 0.3
"""Shares of inputs drawn as constants, and of neurons drawn as waves. With uniform draws a wave of
constant frequency drives only one effector in 400."""


@dataclasses.dataclass(frozen=True)
class NerveRoom:
    """Numbers of neurons per node, and of central neurons.

    steer, skills, children: see `BrainConfig`.
    """

    local: int = BrainConfig.local
    central: int = BrainConfig.central
    steer: bool = BrainConfig.steer
    skills: int = BrainConfig.skills
    children: int = BrainConfig.children

    @property
    def codes(self) -> int:
        """Number of source codes; see `Nerves`."""
        return 1 + SENSORS + (2 + self.children) * self.local + self.central


@pytree
class Nerves:
    """Neurons and effectors of each node.

    kind: [N, Q] indices into `NEURONS`. source, weight: [N, Q, 3] of their inputs.
    effect_source, effect_weight: [N, 3] drive of each hinge to the parent. other_source,
    other_weight: [N, 3, S - 1] the same for the other skills; None without.

    A source is a number: 0 for the constant 1; then the part's own sensors, its own neurons, its
    parent's, those of its first `NerveRoom.children` children in order, and the central ones.
    steer: [N, 3, 2, 3] weights by which the light's direction, along the axes of the part's block,
    adds to each hinge's drive and changes its size; None without `NerveRoom.steer`.
    """

    kind: jax.Array
    source: jax.Array
    weight: jax.Array
    effect_source: jax.Array
    effect_weight: jax.Array
    steer: jax.Array | None = None
    other_source: jax.Array | None = None
    other_weight: jax.Array | None = None

    @property
    def effectors(self) -> tuple[jax.Array, jax.Array]:
        """Sources and weights of all skills, [N, 3, S] each."""
        source, weight = self.effect_source[..., None], self.effect_weight[..., None]
        if self.other_source is None or self.other_weight is None:
            return source, weight
        sources, weights = [source, self.other_source], [weight, self.other_weight]
        return jnp.concatenate(sources, axis=-1), jnp.concatenate(weights, axis=-1)


@pytree
class Centre:
    """Central neurons, [M], as in `Nerves`. They have the root part's sources."""

    kind: jax.Array
    source: jax.Array
    weight: jax.Array


def random_nerves(key: jax.Array, nodes: int, room: NerveRoom) -> Nerves:
    """Draw random neurons: any function, any source; weights are normal."""
    effects = {"effect_source": (nodes, 3), "effect_weight": (nodes, 3)}
    steer = {"scale": (), "steered": (nodes, 3), "steer": (nodes, 3, 2, 3)} if room.steer else {}
    others = dict.fromkeys(("other_source", "other_weight"), (nodes, 3, room.skills - 1))
    shapes = _shapes((nodes, room.local)) | effects | steer
    drawn = uniforms(key, shapes | (others if room.skills > 1 else {}))
    source = numbered(drawn["effect_source"], room.codes)
    return Nerves(
        **_neurons(drawn, room),
        effect_source=source,
        effect_weight=normal(drawn["effect_weight"]),
        steer=_steering(drawn) if room.steer else None,
        other_source=numbered(drawn["other_source"], room.codes) if room.skills > 1 else None,
        other_weight=normal(drawn["other_weight"]) if room.skills > 1 else None,
    )


def _steering(drawn: Mapping[str, jax.Array]) -> jax.Array:
    """Draw `Nerves.steer`: normal for some hinges, 0 for the others."""
    least, most = STEER_SCALE
    scale = least * (most / least) ** drawn["scale"]
    weights = jnp.clip(scale * normal(drawn["steer"]), *STEER)
    return jnp.where((drawn["steered"] < STEERED)[..., None, None], weights, 0.0)


def random_centre(key: jax.Array, room: NerveRoom) -> Centre:
    """Draw random central neurons, as `random_nerves` does."""
    return Centre(**_neurons(uniforms(key, _shapes((room.central,))), room))


def _favoured(uniform: jax.Array, share: float, one: int, count: int) -> jax.Array:
    """Map [0, 1) to integers: `one` in this share of the cases, else any below `count`."""
    return jnp.where(uniform < share, one, numbered((uniform - share) / (1 - share), count))


def _shapes(neurons: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
    return {"kind": neurons, "source": (*neurons, INPUTS), "weight": (*neurons, INPUTS)}


def _neurons(drawn: Mapping[str, jax.Array], room: NerveRoom) -> dict[str, jax.Array]:
    return {
        "kind": _favoured(drawn["kind"], WAVE, NEURONS.index("oscillate-wave"), len(NEURONS)),
        "source": _favoured(drawn["source"], CONSTANT, 0, room.codes),
        "weight": normal(drawn["weight"]),
    }
