"""Mutation, crossover and grafting of graphs with nerves (Sims 1994, section 5).

Letters: `N` nodes, `C` connections of each. Arrays of nodes have `N` as first axis, so nodes move
as wholes.
"""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.controllers.sims_brain.config import BrainConfig, CentreOf, Graft
from mjxgait.controllers.sims_brain.genotype import (
    STEER,
    Capacity,
    Centre,
    Graph,
    NerveRoom,
    Nerves,
    Ranges,
    normal,
    numbered,
    random_centre,
    random_graph,
    random_nerves,
    uniforms,
)
from mjxgait.types import choose, pytree


@pytree
class Genotype:
    """Genotype of a creature: the body's graph, the nodes' nerves, and the central neurons.

    opponent: genotype of the creature that it meets; None where it meets none.
    """

    graph: Graph
    nerves: Nerves
    centre: Centre
    opponent: "Genotype | None" = None


@dataclasses.dataclass(frozen=True)
class Rates:
    """Mutation rates of a genotype.

    value: numbers, kinds and flags of connected nodes that change on average; divided by their
    count, the chance of each. sigma: of a number's change, as a share of its range. connection:
    chance of one more or one less. node: chance of a new node. resize: chance of one factor on all
    sizes. strength: range of a factor that
    each mutation draws, log-uniformly, for these chances; those of connections and nodes never
    exceed the given ones (Doerr et al. 2017, "Fast genetic algorithms": why few large changes among
    many small ones).
    """

    value: float = BrainConfig.values
    sigma: float = BrainConfig.sigma
    connection: float = BrainConfig.connect
    node: float = BrainConfig.grow
    resize: float = BrainConfig.resize
    strength: tuple[float, float] = BrainConfig.strength


@dataclasses.dataclass(frozen=True)
class Mating:
    """What a child of two takes from its father. graft, centre: see `BrainConfig`."""

    graft: Graft = BrainConfig.graft
    centre: CentreOf = BrainConfig.centre


@dataclasses.dataclass(frozen=True)
class GraphOperators:
    """Operators and limits that all genotypes of a population share."""

    capacity: Capacity
    room: NerveRoom
    ranges: Ranges
    rates: Rates = Rates()
    mating: Mating = Mating()

    def create(self, key: jax.Array) -> Genotype:
        """Draw a random genotype."""
        body, nerves, centre = jax.random.split(key, 3)
        return Genotype(
            random_graph(body, self.capacity, self.ranges),
            random_nerves(nerves, self.capacity.nodes, self.room),
            random_centre(centre, self.room),
        )

    def mutate(self, key: jax.Array, genotype: Genotype) -> Genotype:
        """Change values and the size, add or remove a connection, draw an unconnected node anew."""
        value, fresh, connect, node = jax.random.split(key, 4)
        other, strength = self.create(fresh), self._strength(jax.random.fold_in(key, 4))
        often = jnp.minimum(strength, 1.0)
        changed = _with_new_node(node, genotype, other, often * self.rates.node)
        graph = _reconnected(connect, changed.graph, other.graph, often * self.rates.connection)
        changed = dataclasses.replace(changed, graph=graph)
        moved = self._moved(value, changed, other, strength)
        size = self._resized(jax.random.fold_in(key, 5), moved.graph)
        return dataclasses.replace(moved, graph=size)

    def cross(self, key: jax.Array, mother: Genotype, father: Genotype) -> Genotype:
        """Return a child with the mother's nodes, and the father's between two crossover points."""
        nodes = self.capacity.nodes
        points = numbered(jax.random.uniform(key, (2,)), nodes + 1)
        low, high = points.min(), points.max()
        order = jnp.arange(nodes)
        child = _chosen((order < low) | (order >= high), mother, father)
        return dataclasses.replace(child, centre=self._centre(key, mother, father))

    def graft(self, key: jax.Array, mother: Genotype, father: Genotype) -> Genotype:
        """Return the mother with the father's graph attached to one of her connections.

        The father's nodes take the mother's unconnected nodes, as far as there is room. Without
        any room the child is the mother.
        """
        father = self._scion(key, father)
        nodes, connections = mother.graph.target.shape
        free = ~reachable(mother.graph)
        place = jnp.argsort(~free, stable=True)  # targets of the father's nodes: free ones first
        has_room = jnp.arange(nodes) < free.sum()
        source = jnp.zeros(nodes, int).at[place].set(jnp.arange(nodes))
        graph, nerves = jax.tree.map(lambda leaf: leaf[source], (father.graph, father.nerves))
        kept = graph.used & has_room[graph.target]
        graph = dataclasses.replace(graph, target=place[graph.target], used=kept)
        hung = _chosen(~free, mother, Genotype(graph, nerves, mother.centre))
        chance = jax.random.uniform(key, (nodes, connections))
        at = _one_of(chance, jnp.broadcast_to(~free[:, None], chance.shape))
        graph = hung.graph
        joined = dataclasses.replace(
            graph,
            target=graph.target.at[at].set(place[0]),
            used=graph.used.at[at].set(True),
        )
        centre = self._centre(key, mother, father)
        grafted = dataclasses.replace(hung, graph=joined, centre=centre)
        return choose(free.any(), grafted, mother)

    def _scion(self, key: jax.Array, father: Genotype) -> Genotype:
        """Return the father with the node that a graft attaches as its first."""
        if self.mating.graft == "root":
            return father
        drawn = jax.random.uniform(jax.random.fold_in(key, 1), father.graph.joint.shape)
        return _led_by(jnp.argmax(jnp.where(reachable(father.graph), drawn, -1.0)), father)

    def _centre(self, key: jax.Array, mother: Genotype, father: Genotype) -> Centre:
        """Return the central neurons of a child of two: those of one of them, as a whole."""
        if self.mating.centre == "mother":
            return mother.centre
        of_mother = jax.random.uniform(jax.random.fold_in(key, 2)) < 0.5
        return choose(of_mother, mother.centre, father.centre)

    def _strength(self, key: jax.Array) -> jax.Array:
        """Draw the factor [] of one mutation."""
        least, most = self.rates.strength
        share: jax.Array = least * (most / least) ** jax.random.uniform(key)
        return share

    def _moved(
        self, key: jax.Array, genotype: Genotype, other: Genotype, strength: jax.Array
    ) -> Genotype:
        """Shift a few numbers by a normal step, and draw a few kinds and flags anew."""
        alive = reachable(genotype.graph)
        varied = _without_used(genotype)
        leaves, shape = jax.tree.flatten(varied)
        fresh = jax.tree.leaves(_without_used(other))
        of_nodes = jax.tree.leaves((varied.graph, varied.nerves))
        size = jnp.sum(alive) * sum(leaf[0].size for leaf in of_nodes)
        chance = strength * self.rates.value / size
        places = range(len(leaves))
        drawn = uniforms(
            key, {(use, i): leaves[i].shape for i in places for use in ("which", "how")}
        )
        bounds = self._bounds(shape)
        moved = [
            jnp.where(
                drawn["which", i] < chance,
                _shifted(leaves[i], fresh[i], drawn["how", i], self.rates.sigma, bounds[i]),
                leaves[i],
            )
            for i in places
        ]
        found = jax.tree.unflatten(shape, moved)
        return dataclasses.replace(
            found, graph=dataclasses.replace(found.graph, used=genotype.graph.used)
        )

    def _resized(self, key: jax.Array, graph: Graph) -> Graph:
        """Multiply all sizes by one factor, with a chance: proportions stay as they are."""
        drawn = uniforms(key, {"happens": (), "factor": ()})
        factor = jnp.exp(self.rates.sigma * normal(drawn["factor"]))
        scaled = jnp.clip(graph.half * factor, *self.ranges.half)
        half = jnp.where(drawn["happens"] < self.rates.resize, scaled, graph.half)
        return dataclasses.replace(graph, half=half)

    def _bounds(self, shape: jax.tree_util.PyTreeDef) -> list[tuple[float, float]]:
        """Return the lowest and highest value of each leaf; they do not matter for kinds."""
        ranges, names = self.ranges, {"half": self.ranges.half, "swing": self.ranges.swing}
        names |= {"scale": ranges.scale, "turn": (-ranges.turn, ranges.turn), "place": (-1.0, 1.0)}
        placed = jax.tree.unflatten(shape, range(shape.num_leaves))
        found = [(-4.0, 4.0)] * shape.num_leaves
        for name, bounds in names.items():
            found[getattr(placed.graph, name)] = bounds
        if placed.nerves.steer is not None:
            found[placed.nerves.steer] = STEER
        return found


def reachable(graph: Graph, first: jax.Array | int = 0) -> jax.Array:
    """Return whether each node [N] is reachable from the first, or from another."""
    nodes = graph.target.shape[0]
    leads = jnp.any(
        (graph.target[:, :, None] == jnp.arange(nodes)) & graph.used[:, :, None], axis=1
    )

    def wider(_: int, known: jax.Array) -> jax.Array:
        return known | jnp.any(leads & known[:, None], axis=0)

    return jax.lax.fori_loop(0, nodes, wider, jnp.arange(nodes) == first)


def _led_by(first: jax.Array, genotype: Genotype) -> Genotype:
    """Return the genotype with this node as its first, and those that it does not reach as last.

    A graft takes nodes in this order, as far as there is room.
    """
    graph = genotype.graph
    numbers = jnp.arange(graph.joint.shape[0])
    order = jnp.argsort(2 - reachable(graph, first) - (numbers == first), stable=True)
    place = jnp.zeros_like(order).at[order].set(numbers)
    graph, nerves = jax.tree.map(lambda leaf: leaf[order], (graph, genotype.nerves))
    graph = dataclasses.replace(graph, target=place[graph.target])
    return Genotype(graph, nerves, genotype.centre)


def _one_of(chance: jax.Array, allowed: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Choose an allowed place [N, C], all equally likely; any place if none is allowed."""
    choice = jnp.argmax(jnp.where(allowed, chance, -1.0))
    return choice // chance.shape[1], choice % chance.shape[1]


def _with_new_node(
    key: jax.Array, genotype: Genotype, other: Genotype, chance: jax.Array
) -> Genotype:
    """Draw an unconnected node anew, and connect it."""
    alive = reachable(genotype.graph)
    nodes, connections = genotype.graph.target.shape
    drawn = uniforms(key, {"happens": (), "node": (nodes,), "slot": (nodes, connections)})
    free = jnp.argmax(jnp.where(alive, -1.0, drawn["node"]))
    new = _chosen(jnp.arange(nodes) != free, genotype, other)
    # The new node has no connections of its own yet.
    target = new.graph.target.at[free].set(0)
    used = new.graph.used.at[free].set(False)
    spare = alive[:, None] & ~used
    at = _one_of(drawn["slot"], spare)
    graph = dataclasses.replace(
        new.graph, target=target.at[at].set(free), used=used.at[at].set(True)
    )
    new = dataclasses.replace(new, graph=graph)
    ok = (drawn["happens"] < chance) & ~alive.all() & spare.any()
    return choose(ok, new, genotype)


def _reconnected(key: jax.Array, graph: Graph, other: Graph, chance: jax.Array) -> Graph:
    """Add a random connection between connected nodes, or remove one."""
    alive = reachable(graph)
    nodes, connections = graph.target.shape
    shapes = {"happens": (), "adds": (), "slot": (nodes, connections), "target": (nodes,)}
    drawn = uniforms(key, shapes)
    adds = drawn["adds"] < 0.5
    open_slots = alive[:, None] & jnp.where(adds, ~graph.used, graph.used)
    chosen = _one_of(drawn["slot"], open_slots)
    here = jnp.zeros((nodes, connections), bool).at[chosen].set(drawn["happens"] < chance)
    here = here & open_slots
    node = jnp.argmax(jnp.where(alive, drawn["target"], -1.0))
    fresh, known = (
        {name: getattr(one, name) for name in ("place", "turn", "scale", "mirror", "terminal")}
        for one in (other, graph)
    )
    return dataclasses.replace(
        graph,
        used=jnp.where(here, adds, graph.used),
        target=jnp.where(here & adds, node, graph.target),
        **choose(here & adds, fresh, known),
    )


def _shifted(
    leaf: jax.Array, new: jax.Array, how: jax.Array, sigma: float, bounds: tuple[float, float]
) -> jax.Array:
    """Shift numbers by a normal step within their bounds; return `new` for other types."""
    if not jnp.issubdtype(leaf.dtype, jnp.floating):
        return new
    low, high = bounds
    return jnp.clip(leaf + sigma * (high - low) * normal(how), low, high)


def _without_used(genotype: Genotype) -> Genotype:
    """Remove `used`, which is mutated elsewhere; None is no leaf."""
    graph = dataclasses.replace(genotype.graph, used=None)  # type: ignore[arg-type]
    return dataclasses.replace(genotype, graph=graph)


def _chosen(first: jax.Array, one: Genotype, other: Genotype) -> Genotype:
    """Take nodes [N] from `one` where `first`, else from `other`; central neurons from `one`."""
    graph, nerves = choose(first, (one.graph, one.nerves), (other.graph, other.nerves))
    return Genotype(graph, nerves, one.centre)
