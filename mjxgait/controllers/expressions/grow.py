"""Initial programs: ramped half-and-half (Koza 1992), grown node by node in prefix order."""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.expressions.text import ARITY, CONSTANT, EMPTY
from mjxgait.controllers.expressions.trees import canonical
from mjxgait.types import pytree


@dataclasses.dataclass(frozen=True)
class Words:
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
    key: jax.Array, words: Words, depth: tuple[int, int], constants: Any
) -> tuple[jax.Array, jax.Array]:
    """Draw a tree [C], full or grown with equal chance, up to a depth drawn from a range."""
    key_kind, key_depth, key_grow = jax.random.split(key, 3)
    least, most = depth
    deep = jax.random.randint(key_depth, (), least, most + 1)
    full = jax.random.bernoulli(key_kind)
    return grown(key_grow, words, deep, jnp.where(full, deep, least), constants)


def grown(
    key: jax.Array, words: Words, deep: jax.Array, least: jax.Array, constants: Any
) -> tuple[jax.Array, jax.Array]:
    """Draw a tree [C] with depth at most `deep` [] and terminals at depth `least` [] or more.

    Once the capacity is used up, every missing argument becomes a terminal.
    """
    capacity = words.capacity
    begin = Growing(jnp.zeros(capacity, jnp.int32), jnp.int32(1), jnp.int32(0))
    step = partial(_next_node, words, deep, least, constants)
    _, (code, value) = jax.lax.scan(step, begin, jax.random.split(key, capacity))
    return canonical(code, value)


def _next_node(
    words: Words,
    deep: jax.Array,
    least: jax.Array,
    constants: Any,
    state: Growing,
    key: jax.Array,
) -> tuple[Growing, tuple[jax.Array, jax.Array]]:
    key_end, key_function, key_sense, key_value = jax.random.split(key, 4)
    alive, here = state.open > 0, state.pending[jnp.maximum(state.open - 1, 0)]
    function = jax.random.choice(key_function, np.array(words.functions, np.int32))
    wants = jnp.asarray(ARITY)[function]
    room = state.used + state.open + wants <= words.capacity
    ends = (here >= deep) | ~room
    ends |= (here >= least) & jax.random.bernoulli(key_end, words.terminal_share)
    # A constant is as likely as any one observation.
    end = jax.random.choice(key_sense, np.array([CONSTANT, *words.senses], np.int32))
    code = jnp.where(ends, end, function)
    value = jax.random.uniform(key_value, (), minval=constants[0], maxval=constants[1])
    given = jnp.where(ends, 0, wants)
    places = np.arange(words.capacity)
    fresh = (places >= state.open - 1) & (places < state.open - 1 + given)
    after = Growing(
        jnp.where(fresh, here + 1, state.pending), state.open - 1 + given, state.used + 1
    )
    after = jax.tree.map(partial(jnp.where, alive), after, state)
    return after, (jnp.where(alive, code, EMPTY), jnp.where(alive, value, 0.0))
