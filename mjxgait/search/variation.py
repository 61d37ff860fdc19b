"""How genomes are made from nothing and from other genomes: arrays in, arrays out.

Functions for one genome, mapped over the offspring where they are called. A genome is key poses [K,
J] and tuning [E] within a box.
"""

import dataclasses
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.settings.config import EvolutionConfig
from mjxgait.settings.traced import chosen
from mjxgait.types import pytree


@pytree
class Box:
    """Lowest and highest value of each gene; leaves shaped as in one genome."""

    low: Any
    high: Any


@dataclasses.dataclass(frozen=True)
class Variation:
    """The operators that evolution calls; it knows a genome only as a pytree.

    create: key, count -> genomes [count, ...]. cross: key, genome, genome -> genome. mutate: key,
    genome -> genome.
    """

    create: Callable[[jax.Array, int], Any]
    cross: Callable[[jax.Array, Any, Any], Any]
    mutate: Callable[[jax.Array, Any], Any]


def pose_variation(box: Box, config: EvolutionConfig) -> Variation:
    """The operators of a genome of key poses and tuning, as chosen in the config, which may be
    plain or traced.

    All options of a choice are computed and one is taken: they cost next to nothing beside the
    simulations.
    """
    poses = narrowed(box, config.pose_range)
    box = Box(
        *(
            dataclasses.replace(edge, key_poses=part.key_poses)
            for edge, part in ((box.low, poses.low), (box.high, poses.high))
        )
    )
    middle = narrowed(box, config.initial_spread)

    def create(key: jax.Array, count: int) -> Any:
        uniformly = chosen(config.initial, "uniform")
        return jax.tree.map(
            partial(jnp.where, uniformly),
            uniform(key, middle, count),
            latin_hypercube(key, middle, count),
        )

    def cross(key: jax.Array, mother: Any, father: Any) -> Any:
        key_poses, key_tuning = jax.random.split(key)
        permuted, aligned = (
            f(key_poses, mother.key_poses, father.key_poses)
            for f in (permuted_poses, aligned_poses)
        )
        from_mother = jax.random.bernoulli(key_tuning, 0.5, mother.tuning.shape)
        return dataclasses.replace(
            mother,
            key_poses=jnp.where(chosen(config.crossing, "permute"), permuted, aligned),
            tuning=jnp.where(from_mother, mother.tuning, father.tuning),
        )

    def mutate(key: jax.Array, genome: Any) -> Any:
        key_poses, key_tuning = jax.random.split(key)
        low, high = box.low, box.high
        poses = mutated_poses(
            key_poses,
            genome.key_poses,
            low.key_poses,
            high.key_poses,
            config.mutation,
            config.sigma,
        )
        tuning = jittered(
            key_tuning,
            genome.tuning,
            low.tuning,
            high.tuning,
            config.tuning_rate,
            config.tuning_sigma,
        )
        return dataclasses.replace(genome, key_poses=poses, tuning=tuning)

    return Variation(create=create, cross=cross, mutate=mutate)


def narrowed(box: Box, share: jax.Array | float) -> Box:
    """The middle of a box, `share` of its width in every gene."""

    def edge(near: Any, far: Any) -> Any:
        return jax.tree.map(lambda a, b: a + 0.5 * (1 - share) * (b - a), near, far)

    return Box(edge(box.low, box.high), edge(box.high, box.low))


def uniform(key: jax.Array, box: Box, count: int) -> Any:
    """Genomes [count, ...] drawn uniformly from the box."""
    return _draw(key, box, count, lambda key, shape: jax.random.uniform(key, shape))


def latin_hypercube(key: jax.Array, box: Box, count: int) -> Any:
    """Genomes [count, ...] with one value of every gene in each of `count` slices of its range
    (McKay, Beckman & Conover 1979).
    """

    def draw(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
        key_slice, key_within = jax.random.split(key)
        slices = jax.random.permutation(
            key_slice,
            jnp.broadcast_to(jnp.arange(count)[:, None], (count, math.prod(shape[1:]))),
            independent=True,
        )
        return ((slices + jax.random.uniform(key_within, slices.shape)) / count).reshape(shape)

    return _draw(key, box, count, draw)


def permuted_poses(key: jax.Array, mother: jax.Array, father: jax.Array) -> jax.Array:
    """K poses [K, J] drawn without repetition from the parents' 2K, in any order (Wilson)."""
    both = jnp.concatenate([mother, father])
    return jax.random.permutation(key, both)[: mother.shape[0]]


def aligned_poses(key: jax.Array, mother: jax.Array, father: jax.Array) -> jax.Array:
    """K poses [K, J], each from the one or the other parent, in its place."""
    return jnp.where(jax.random.bernoulli(key, 0.5, (mother.shape[0], 1)), mother, father)


def mutated_poses(
    key: jax.Array,
    poses: jax.Array,
    low: jax.Array,
    high: jax.Array,
    kind: Any,
    sigma: jax.Array | float,
) -> jax.Array:
    """Key poses [K, J] with a change in one of them; see `EvolutionConfig.mutation` for the kinds.

    Never leaves the box.
    """
    key_pose, key_joint, key_value, key_kind = jax.random.split(key, 4)
    count, joints = poses.shape
    here = jnp.arange(count) == jax.random.randint(key_pose, (), 0, count)
    order = jax.random.permutation(key_joint, jnp.arange(joints))
    moves = chosen(kind, "gaussian") | (chosen(kind, "mixed") & jax.random.bernoulli(key_kind))
    coded, code = chosen(kind, "bit") | chosen(kind, "byte"), eight_bits(poses, low, high)
    flipped = code ^ jnp.where(
        chosen(kind, "bit"),
        1 << jax.random.randint(key_kind, (), 0, 8),
        jax.random.randint(key_kind, (), 0, 256),
    )
    moved = poses + sigma * (high - low) * jax.random.normal(key_value, poses.shape)
    drawn = low + (high - low) * jax.random.uniform(key_value, poses.shape)
    value = jnp.where(moves, moved, jnp.where(coded, low + flipped / 255 * (high - low), drawn))
    every = moves | chosen(kind, "pose")
    joints_changed = jnp.where(every, joints, jnp.where(coded | chosen(kind, "single"), 1, 2))
    return jnp.clip(jnp.where(here[:, None] & (order < joints_changed), value, poses), low, high)


def eight_bits(values: jax.Array, low: jax.Array, high: jax.Array) -> jax.Array:
    """The nearest of 256 levels between low and high, as integers."""
    return jnp.round(
        255 * jnp.clip((values - low) / jnp.maximum(high - low, 1e-9), 0.0, 1.0)
    ).astype(jnp.int32)


def jittered(
    key: jax.Array,
    values: jax.Array,
    low: jax.Array,
    high: jax.Array,
    rate: jax.Array | float,
    sigma: jax.Array | float,
) -> jax.Array:
    """Values [E], each moved with probability `rate` by a Gaussian of `sigma` ranges; never
    leaves the box.
    """
    key_which, key_by = jax.random.split(key)
    moved = values + sigma * (high - low) * jax.random.normal(key_by, values.shape)
    return jnp.clip(
        jnp.where(jax.random.bernoulli(key_which, rate, values.shape), moved, values), low, high
    )


def first_occurrence(genomes: Any) -> jax.Array:
    """Whether each genome [N] (leaves [N, ...]) is the first of its kind: a later equal one is a
    duplicate.

    Sorts by a random projection, so the cost grows as N log N; equal genomes have equal
    projections, and neighbours are compared in full.
    """
    rows = jnp.concatenate(
        [leaf.reshape(leaf.shape[0], -1) for leaf in jax.tree.leaves(genomes)], axis=1
    )
    # Elementwise product and sum, row by row alike: a matrix product may round equal rows
    # differently at different places.
    projection = jnp.sum(rows * jax.random.normal(jax.random.key(0), (rows.shape[1],)), axis=1)
    order = jnp.argsort(projection, stable=True)
    in_order = rows[order]
    repeats = jnp.concatenate([jnp.array([False]), jnp.all(in_order[1:] == in_order[:-1], axis=1)])
    return jnp.zeros(len(order), bool).at[order].set(~repeats)


def _draw(
    key: jax.Array, box: Box, count: int, draw: Callable[[jax.Array, tuple[int, ...]], jax.Array]
) -> Any:
    lows, shape_of = jax.tree.flatten(box.low)
    highs = jax.tree.leaves(box.high)
    keys = jax.random.split(key, len(lows))
    leaves = [
        low + (high - low) * draw(k, (count, *low.shape))
        for k, low, high in zip(keys, lows, highs, strict=True)
    ]
    return jax.tree.unflatten(shape_of, leaves)
