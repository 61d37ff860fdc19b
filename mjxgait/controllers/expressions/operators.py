"""Genetic operators of programs: trees in prefix order, initial programs, crossover, mutation.

A tree is `code` [C] and `value` [C] (`text`); beyond its end both are zero.
"""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.expressions.config import ProgramConfig
from mjxgait.controllers.expressions.text import ARITY, CONSTANT, EMPTY, FIRST_ADDED, FUNCTION_CODES
from mjxgait.evolution.variation import Variation
from mjxgait.types import choose, pytree


@pytree
class Trees:
    """Trees, one per joint. code: [J, C] integers. value: [J, C] of constants, else zero."""

    code: jax.Array
    value: jax.Array


def arity(code: jax.Array) -> jax.Array:
    """Return the number of arguments [...] of each node."""
    taken = jnp.asarray(ARITY)[jnp.minimum(code, FIRST_ADDED - 1)]
    return jnp.where(code < FIRST_ADDED, taken, 0)


def size(code: jax.Array) -> jax.Array:
    """Return the number of nodes [] of a tree [C]."""
    return jnp.sum(code != EMPTY)


def subtree_sizes(code: jax.Array) -> jax.Array:
    """Return the number of nodes [C] of the subtree at each place; 0 beyond the end."""
    places = np.arange(code.shape[0])
    used = code != EMPTY
    # A subtree ends when all its arguments are complete.
    wanted = jnp.cumsum(jnp.where(used, arity(code) - 1, 0))
    before = wanted - jnp.where(used, arity(code) - 1, 0)
    complete = (wanted[None, :] - before[:, None] == -1) & (places[None, :] >= places[:, None])
    return jnp.where(used, jnp.argmax(complete, axis=1) - places + 1, 0)


def depths(code: jax.Array) -> jax.Array:
    """Return the depth [C] of each node: its number of enclosing functions."""
    places, sizes = np.arange(code.shape[0]), subtree_sizes(code)
    start, node = places[:, None], places[None, :]
    within = (start < node) & (node < start + sizes[:, None])
    return jnp.sum(within & (code != EMPTY)[None, :], axis=0)


def canonical(code: jax.Array, value: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return code and value with zeros for values that have no meaning."""
    return code, jnp.where(code == CONSTANT, value, 0.0)


@dataclasses.dataclass(frozen=True)
class PrimitiveSet:
    """Primitives of a program. functions, senses: codes. capacity: C, most nodes."""

    functions: tuple[int, ...]
    senses: tuple[int, ...]
    capacity: int

    @property
    def terminal_share(self) -> float:
        """Chance of a terminal in a grown tree: the share of terminals, with constants as one."""
        ends = len(self.senses) + 1
        return ends / (ends + len(self.functions))


@pytree
class Growing:
    """State of growth.

    pending: [C] depths of missing arguments, the next one last. open: [] their number.
    used: [] nodes so far.
    """

    pending: jax.Array
    open: jax.Array
    used: jax.Array


def half_and_half(
    key: jax.Array, primitives: PrimitiveSet, depth: tuple[int, int], constants: tuple[float, float]
) -> tuple[jax.Array, jax.Array]:
    """Draw a tree [C], full or grown with equal chance, up to a depth drawn from a range."""
    key_kind, key_depth, key_grow = jax.random.split(key, 3)
    least, most = depth
    deep = jax.random.randint(key_depth, (), least, most + 1)
    full = jax.random.bernoulli(key_kind)
    return grown(key_grow, primitives, deep, jnp.where(full, deep, least), constants)


def grown(
    key: jax.Array,
    primitives: PrimitiveSet,
    deep: jax.Array,
    least: jax.Array,
    constants: tuple[float, float],
) -> tuple[jax.Array, jax.Array]:
    """Draw a tree [C] with depth at most `deep` [] and terminals at depth `least` [] or more.

    Once the capacity is used up, every missing argument becomes a terminal.
    """
    capacity = primitives.capacity
    begin = Growing(jnp.zeros(capacity, jnp.int32), jnp.int32(1), jnp.int32(0))
    step = partial(_next_node, primitives, deep, least, constants)
    _, (code, value) = jax.lax.scan(step, begin, jax.random.split(key, capacity))
    return canonical(code, value)


def _next_node(
    primitives: PrimitiveSet,
    deep: jax.Array,
    least: jax.Array,
    constants: tuple[float, float],
    state: Growing,
    key: jax.Array,
) -> tuple[Growing, tuple[jax.Array, jax.Array]]:
    key_end, key_function, key_sense, key_value = jax.random.split(key, 4)
    alive, here = state.open > 0, state.pending[jnp.maximum(state.open - 1, 0)]
    function = jax.random.choice(key_function, np.array(primitives.functions, np.int32))
    wants = jnp.asarray(ARITY)[function]
    room = state.used + state.open + wants <= primitives.capacity
    ends = (here >= deep) | ~room
    ends |= (here >= least) & jax.random.bernoulli(key_end, primitives.terminal_share)
    # A constant is as likely as any one observation.
    end = jax.random.choice(key_sense, np.array([CONSTANT, *primitives.senses], np.int32))
    code = jnp.where(ends, end, function)
    value = jax.random.uniform(key_value, (), minval=constants[0], maxval=constants[1])
    given = jnp.where(ends, 0, wants)
    places = np.arange(primitives.capacity)
    fresh = (places >= state.open - 1) & (places < state.open - 1 + given)
    after = Growing(
        jnp.where(fresh, here + 1, state.pending), state.open - 1 + given, state.used + 1
    )
    after = choose(alive, after, state)
    return after, (jnp.where(alive, code, EMPTY), jnp.where(alive, value, 0.0))


Tree = tuple[jax.Array, jax.Array]
"""Arrays code and value [C]."""
GRAFT = 3
"""Greatest depth of a new subtree in mutation."""
NEUTRAL = {FUNCTION_CODES["+"]: 0.0, FUNCTION_CODES["*"]: 1.0}
"""Functions, each with the second argument that leaves the first unchanged."""
FINEST = 0.01
"""Smallest scale of constant changes, as a share of the largest."""


def program_variation(
    primitives: PrimitiveSet, joints: int, settings: ProgramConfig, first: Trees | None = None
) -> Variation:
    """Return the operators. settings: `ProgramConfig`, plain or traced. first: see `Variation`."""

    def create(key: jax.Array, count: int) -> Trees:
        keys = jax.random.split(key, count * joints)
        make = partial(
            half_and_half,
            primitives=primitives,
            depth=settings.initial_depth,
            constants=settings.constants,
        )
        code, value = jax.vmap(lambda key: make(key))(keys)
        shape = (count, joints, primitives.capacity)
        return Trees(code.reshape(shape), value.reshape(shape))

    def cross(key: jax.Array, mother: Trees, father: Trees) -> Trees:
        key_joint, key_cross = jax.random.split(key)
        joint = jax.random.randint(key_joint, (), 0, joints)
        return _with(
            mother, joint, crossed(key_cross, _of(mother, joint), _of(father, joint), settings)
        )

    def mutate(key: jax.Array, genome: Trees) -> Trees:
        key_joint, key_mutate = jax.random.split(key)
        joint = jax.random.randint(key_joint, (), 0, joints)
        return _with(genome, joint, mutated(key_mutate, _of(genome, joint), primitives, settings))

    def price(genomes: Trees) -> jax.Array:
        return jnp.asarray(settings.parsimony * jnp.sum(genomes.code != EMPTY, axis=(1, 2)))

    return Variation(create, cross, mutate, price, long=True, first=first)


def crossed(key: jax.Array, mother: Tree, father: Tree, settings: ProgramConfig) -> Tree:
    """Return the mother with one subtree replaced by one of the father's (Koza 1992).

    The mother stays unchanged if the child would be too large or too deep.
    """
    key_here, key_there = jax.random.split(key)
    here = chosen_node(key_here, mother[0], settings.functions_cross)
    there = chosen_node(key_there, father[0], settings.functions_cross)
    return spliced(mother, here, father, there, settings.depth)


def mutated(key: jax.Array, tree: Tree, primitives: PrimitiveSet, settings: ProgramConfig) -> Tree:
    """Return the tree with one change; its kind is drawn by the weights of the settings."""
    key_kind, key_place, key_change = jax.random.split(key, 3)
    place = jax.random.randint(key_place, (), 0, jnp.maximum(size(tree[0]), 1))
    deep = jnp.int32(GRAFT)
    graft = grown(key_change, primitives, deep, jnp.int32(0), settings.constants)
    options = (
        spliced(tree, place, graft, jnp.int32(0), settings.depth),
        _another(key_change, tree, place, primitives),
        spliced((jnp.zeros_like(tree[0]), tree[1]), jnp.int32(0), tree, place, settings.depth),
        _moved(key_change, tree, settings),
        _nudged(key_change, tree, place, primitives, settings),
    )
    kinds = ("subtree", "point", "hoist", "constant", "nudge")
    shares = jnp.stack([jnp.asarray(getattr(settings, kind), jnp.float32) for kind in kinds])
    kind = jax.random.categorical(key_kind, jnp.log(shares))
    code, value = (jnp.stack(parts)[kind] for parts in zip(*options, strict=True))
    return code, value


def chosen_node(key: jax.Array, code: jax.Array, at_functions: jax.Array | float) -> jax.Array:
    """Draw a node's index []: with chance `at_functions` a function, if any, else a terminal."""
    key_kind, key_node = jax.random.split(key)
    inner = (code != EMPTY) & (arity(code) > 0)
    ends = (code != EMPTY) & (arity(code) == 0)
    wants_inner = jax.random.bernoulli(key_kind, at_functions) & jnp.any(inner)
    among = jnp.where(wants_inner, inner, ends)
    return jax.random.categorical(key_node, jnp.where(among, 0.0, -jnp.inf))


def spliced(
    host: Tree, here: jax.Array, donor: Tree, there: jax.Array, deepest: jax.Array | int
) -> Tree:
    """Replace the host's subtree at `here` [] by the donor's at `there` [].

    The host stays unchanged if the result would be too large or too deep. An empty host becomes the
    subtree.
    """
    places = np.arange(host[0].shape[0])
    lost, gained = subtree_sizes(host[0])[here], subtree_sizes(donor[0])[there]
    from_donor = (places >= here) & (places < here + gained)
    source = jnp.where(places < here, places, places - gained + lost)
    after = size(host[0]) - lost + gained

    def joined(ours: jax.Array, theirs: jax.Array) -> jax.Array:
        last = len(places) - 1
        kept = ours[jnp.clip(source, 0, last)]
        given = theirs[jnp.clip(places - here + there, 0, last)]
        return jnp.where(places < after, jnp.where(from_donor, given, kept), 0)

    code, value = canonical(joined(host[0], donor[0]), joined(host[1], donor[1]))
    fits = (after <= len(places)) & (jnp.max(depths(code)) <= deepest)
    return jnp.where(fits, code, host[0]), jnp.where(fits, value, host[1])


def _another(key: jax.Array, tree: Tree, place: jax.Array, primitives: PrimitiveSet) -> Tree:
    """Return the tree with a node redrawn: a function of as many arguments, or an observation."""
    functions = np.array(primitives.functions, np.int32)
    wanted = arity(tree[0])[place]
    key_function, key_sense = jax.random.split(key)
    alike = jnp.asarray(ARITY)[functions] == wanted
    function = functions_at(key_function, functions, alike)
    sense = jax.random.choice(key_sense, np.array(primitives.senses, np.int32))
    code = tree[0].at[place].set(jnp.where(wanted > 0, function, sense))
    return canonical(code, tree[1])


def functions_at(key: jax.Array, functions: np.ndarray, allowed: jax.Array) -> jax.Array:
    """Draw one [] of the allowed codes."""
    return jnp.asarray(functions)[jax.random.categorical(key, jnp.where(allowed, 0.0, -jnp.inf))]


def _moved(key: jax.Array, tree: Tree, settings: ProgramConfig) -> Tree:
    """Return the tree with one constant moved; unchanged if it has none."""
    key_which, key_by = jax.random.split(key)
    constants = tree[0] == CONSTANT
    place = jax.random.categorical(key_which, jnp.where(constants, 0.0, -jnp.inf))
    moves = constants & (np.arange(len(constants)) == place)
    return tree[0], jnp.where(moves, tree[1] + _step(key_by, settings), tree[1])


def _nudged(
    key: jax.Array, tree: Tree, place: jax.Array, primitives: PrimitiveSet, settings: ProgramConfig
) -> Tree:
    """Return the tree with a small constant added to the subtree at a place [], or a factor near 1.

    The tree stays unchanged if the settings allow neither sums nor products.
    """
    ways = [(code, at) for code, at in NEUTRAL.items() if code in primitives.functions]
    if not ways:
        return tree
    key_way, key_by = jax.random.split(key)
    function, neutral = jax.random.choice(key_way, jnp.array(ways, jnp.float32))
    room = jnp.zeros_like(tree[0])
    code = room.at[:3].set(jnp.stack([function.astype(room.dtype), CONSTANT, CONSTANT]))
    value = jnp.zeros_like(tree[1]).at[2].set(neutral + _step(key_by, settings))
    changed = spliced((code, value), jnp.int32(1), tree, place, settings.depth)
    return spliced(tree, place, changed, jnp.int32(0), settings.depth)


def _step(key: jax.Array, settings: ProgramConfig) -> jax.Array:
    """Draw a Gaussian change [], as often fine as coarse: the sensitivity is unknown."""
    key_fine, key_by = jax.random.split(key)
    low, high = settings.constants
    fine = FINEST ** jax.random.uniform(key_fine)
    return settings.constant_sigma * (high - low) * fine * jax.random.normal(key_by)


def _of(trees: Trees, joint: jax.Array) -> Tree:
    return trees.code[joint], trees.value[joint]


def _with(trees: Trees, joint: jax.Array, tree: Tree) -> Trees:
    code, value = tree
    return dataclasses.replace(
        trees, code=trees.code.at[joint].set(code), value=trees.value.at[joint].set(value)
    )
