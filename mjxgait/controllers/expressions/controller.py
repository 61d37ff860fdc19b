"""Controller with one expression per joint as genome (Gritz & Hahn 1995, 1997).

A tree becomes a list of its functions in reverse prefix order, so that arguments are computed
before they are needed. Each row of a table is a number: first the observations, then the tree's
nodes (constants filled in), then the results of the functions. Terminals cost nothing. The loop
runs as long as the longest list of the batch.

Letters: `C` nodes, `Q` functions at most, `J` trees, `S` observations.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.base import Command, Senses
from mjxgait.controllers.expressions.config import ProgramConfig
from mjxgait.controllers.expressions.operators import (
    PrimitiveSet,
    Trees,
    arity,
    program_variation,
    subtree_sizes,
)
from mjxgait.controllers.expressions.serialize import programs_to_begin_with
from mjxgait.controllers.expressions.text import (
    ARITY,
    EMPTY,
    FIRST_ADDED,
    FUNCTION_CODES,
    LEAST_DIVISOR,
    VALUE_LIMIT,
    Terminal,
    chosen_terminals,
    terminals,
)
from mjxgait.creature.body import Body
from mjxgait.evolution.variation import Variation
from mjxgait.types import pytree


@pytree
class Listing:
    """Programs ready to run.

    function: [Q, J] codes. first, second, third: [Q, J] rows of the table. constants: [C, J].
    root: [J] row of the result. count: [J] functions.
    """

    function: jax.Array
    first: jax.Array
    second: jax.Array
    third: jax.Array
    constants: jax.Array
    root: jax.Array
    count: jax.Array


def most_functions(primitives: PrimitiveSet) -> int:
    """Return Q: without unary functions a tree has more terminals than functions."""
    unary = any(ARITY[code] == 1 for code in primitives.functions)
    return primitives.capacity if unary else max((primitives.capacity - 1) // 2, 1)


def listed(trees: Trees, primitives: PrimitiveSet) -> Listing:
    """Return the function lists of trees [J, C]."""
    one = jax.vmap(lambda code: _list_tree(code, primitives), out_axes=-1)(trees.code)
    return dataclasses.replace(one, constants=trees.value.T)


def _list_tree(code: jax.Array, primitives: PrimitiveSet) -> Listing:
    capacity, most, senses = primitives.capacity, most_functions(primitives), len(primitives.senses)
    places, sizes = np.arange(capacity), subtree_sizes(code)
    is_function = (code != EMPTY) & (arity(code) > 0)
    count = jnp.sum(is_function)
    turn = count - jnp.cumsum(is_function)
    known = jnp.asarray(primitives.senses, jnp.int32)
    of_sense = jnp.argmax(code[:, None] == known, axis=1)
    row = jnp.where(code >= FIRST_ADDED, of_sense, senses + places)
    row = jnp.where(is_function, senses + capacity + turn, row)

    def after(start: jax.Array) -> jax.Array:
        return jnp.minimum(start + sizes[start], capacity - 1)

    first = jnp.minimum(places + 1, capacity - 1)
    second = after(first)
    arguments = (row[first], row[second], row[after(second)])
    slot = jnp.where(is_function, turn, most)

    def in_turn(values: jax.Array) -> jax.Array:
        return jnp.zeros(most, jnp.int32).at[slot].set(values.astype(jnp.int32), mode="drop")

    first_row, second_row, third_row = map(in_turn, arguments)
    return Listing(
        function=in_turn(code),
        first=first_row,
        second=second_row,
        third=third_row,
        constants=jnp.zeros(capacity),
        root=row[0],
        count=count,
    )


Evaluate = Callable[[Listing, jax.Array], jax.Array]


@functools.cache
def evaluator(functions: tuple[int, ...]) -> Evaluate:
    """Return the function from programs and observations [S] to values [J] in rad.

    The programs have these functions and no others.
    """

    @custom_vmap
    def evaluate(listing: Listing, senses: jax.Array) -> jax.Array:
        lone = jax.tree.map(lambda x: x[..., None], (listing, senses))
        return _evaluate_lanes(functions, *lone)[:, 0]

    @evaluate.def_vmap
    def over_lanes(
        size: int, batched: tuple[Listing, bool], listing: Listing, senses: jax.Array
    ) -> tuple[jax.Array, bool]:
        def innermost(leaf: jax.Array, has_lanes: bool) -> jax.Array:
            if has_lanes:
                return jnp.moveaxis(leaf, 0, -1)
            return jnp.broadcast_to(leaf[..., None], (*leaf.shape, size))

        lanes = jax.tree.map(innermost, (listing, senses), tuple(batched))
        return jnp.moveaxis(_evaluate_lanes(functions, *lanes), -1, 0), True

    made: Evaluate = evaluate
    return made


def _evaluate_lanes(functions: tuple[int, ...], listing: Listing, senses: jax.Array) -> jax.Array:
    """Return values [J, L], lanes innermost, so that neighbouring lanes are adjacent in memory."""
    most, joints, lanes = listing.function.shape
    width = joints * lanes
    flat = jax.tree.map(lambda x: x.reshape(*x.shape[:-2], width), listing)
    seen = jnp.tile(senses, (1, joints))
    table = jnp.concatenate([seen, flat.constants, jnp.zeros((most, width), seen.dtype)])
    begin, lane = len(table) - most, jnp.arange(width)

    def step(k: jax.Array, table: jax.Array) -> jax.Array:
        arguments = (table[rows[k], lane] for rows in (flat.first, flat.second, flat.third))
        return table.at[begin + k].set(_apply(functions, flat.function[k], *arguments))

    table = jax.lax.fori_loop(0, jnp.max(flat.count), step, table)
    return table[flat.root, lane].reshape(joints, lanes)


def _apply(
    known: tuple[int, ...], function: jax.Array, a: jax.Array, b: jax.Array, c: jax.Array
) -> jax.Array:
    found = jnp.zeros_like(a)
    for name, given in _GIVES.items():
        if (code := FUNCTION_CODES[name]) in known:
            found = jnp.where(function == code, given(a, b, c), found)
    return jnp.clip(found, -VALUE_LIMIT, VALUE_LIMIT)


def _divided(a: jax.Array, b: jax.Array) -> jax.Array:
    divides = jnp.abs(b) >= LEAST_DIVISOR
    return jnp.where(divides, a / jnp.where(divides, b, 1.0), 1.0)


_GIVES: dict[str, Callable[[jax.Array, jax.Array, jax.Array], jax.Array]] = {
    "+": lambda a, b, c: a + b,
    "-": lambda a, b, c: a - b,
    "*": lambda a, b, c: a * b,
    "/": lambda a, b, c: _divided(a, b),
    "ifltz": lambda a, b, c: jnp.where(a < 0, b, c),
    "min": lambda a, b, c: jnp.minimum(a, b),
    "max": lambda a, b, c: jnp.maximum(a, b),
    "abs": lambda a, b, c: jnp.abs(a),
    "sin": lambda a, b, c: jnp.sin(a),
    "cos": lambda a, b, c: jnp.cos(a),
}


class Programs:
    """Implementation of `Controller`: an expression's value is its joint's target angle in rad.

    settings: those that shape the program. added: names of the observations that the task adds.
    """

    Settings: ClassVar[type] = ProgramConfig
    command: ClassVar[Command] = "pose"

    @classmethod
    def with_settings(
        cls, creature: Body, step: float, settings: ProgramConfig, added: Sequence[str]
    ) -> "Programs":
        """Return the controller of a body. added: names of the observations that the task adds."""
        return cls(creature, step, settings, added)

    def __init__(
        self, creature: Body, step: float, settings: ProgramConfig, added: Sequence[str] = ()
    ) -> None:
        self.creature, self.step, self.every = creature, step, settings.every
        self.added = tuple(added)
        self.known: tuple[Terminal, ...] = chosen_terminals(
            terminals(creature, added), settings.senses
        )
        self.primitives = PrimitiveSet(
            tuple(FUNCTION_CODES[name] for name in settings.functions),
            tuple(terminal.code for terminal in self.known),
            settings.nodes,
        )
        self.reads = tuple(dict.fromkeys(terminal.sense for terminal in self.known))

    def variation(self, settings: ProgramConfig, evolution: EvolutionConfig) -> Variation:
        """The first generation begins with the programs of the settings."""
        given = programs_to_begin_with(self.creature, settings, self.added)
        first = None if given is None else Trees(*map(jnp.asarray, given))
        return program_variation(self.primitives, len(self.creature.joints.names), settings, first)

    def genes(self, genomes: Trees, settings: ProgramConfig) -> np.ndarray:
        """Codes and constants as they are, in no common unit."""
        code, value = (np.asarray(leaf) for leaf in (genomes.code, genomes.value))
        return np.concatenate([leaf.reshape(len(leaf), -1) for leaf in (code, value)], axis=1)

    def genome_statistics(self, genomes: Trees) -> Mapping[str, np.ndarray]:
        """The nodes of all expressions."""
        return {"nodes": (np.asarray(genomes.code) != EMPTY).sum(axis=(1, 2))}

    def prepare(self, genome: Trees, settings: ProgramConfig) -> Listing:
        """See `Controller`."""
        return listed(genome, self.primitives)

    def load(self, plan: Listing) -> jax.Array:
        """The number of functions in the longest expression."""
        return jnp.max(plan.count)

    def init(self) -> tuple[()]:
        """A program has no memory."""
        return ()

    def act(self, plan: Listing, memory: tuple[()], senses: Senses) -> tuple[jax.Array, tuple[()]]:
        """Target angles, clipped to each joint's pose range."""
        seen = [
            senses[t.sense] if t.index is None else senses[t.sense][t.index] for t in self.known
        ]
        angle = evaluator(self.primitives.functions)(plan, jnp.stack(seen))
        low, high = self.creature.joints.pose_low, self.creature.joints.pose_high
        return jnp.clip(angle, low.astype(np.float32), high.astype(np.float32)), memory
