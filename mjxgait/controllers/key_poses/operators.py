"""Genetic operators for key poses [K, J] and tuning [E], each within its box."""

import dataclasses
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.traced import Choice, chosen
from mjxgait.evolution.variation import (
    Box,
    Variation,
    creation,
    jittered,
    narrowed,
    uniform_crossover,
)

if TYPE_CHECKING:
    from mjxgait.controllers.key_poses.controller import Genome


def pose_variation(box: Box, config: EvolutionConfig) -> "Variation[Genome]":
    """Return the operators that the config, plain or traced, selects.

    All options are computed and one is taken: their cost is negligible beside the simulations.
    """
    poses = narrowed(box, config.pose_range)
    box = Box(
        dataclasses.replace(box.low, key_poses=poses.low.key_poses),
        dataclasses.replace(box.high, key_poses=poses.high.key_poses),
    )
    middle = narrowed(box, config.initial_spread)

    def cross(key: jax.Array, mother: "Genome", father: "Genome") -> "Genome":
        key_poses, key_tuning = jax.random.split(key)
        return dataclasses.replace(
            mother,
            key_poses=crossed_poses(key_poses, mother.key_poses, father.key_poses, config),
            tuning=uniform_crossover(key_tuning, mother.tuning, father.tuning),
        )

    def mutate(key: jax.Array, genome: "Genome") -> "Genome":
        key_poses, key_tuning = jax.random.split(key)
        low, high = box.low, box.high
        poses = mutated_poses(
            key_poses,
            genome.key_poses,
            low.key_poses,
            high.key_poses,
            config.mutation,
            config.sigma,
            config.redrawn,
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

    return Variation(create=creation(middle, config), cross=cross, mutate=mutate, box=box)


def crossed_poses(
    key: jax.Array, mother: jax.Array, father: jax.Array, config: EvolutionConfig
) -> jax.Array:
    """Cross the parents' key poses [K, J], permuted, aligned, or either at random."""
    mixes = jax.random.bernoulli(jax.random.fold_in(key, 1), config.permuted)
    permutes = chosen(config.crossing, "permute") | (chosen(config.crossing, "mixed") & mixes)
    return jnp.where(
        permutes, permuted_poses(key, mother, father), aligned_poses(key, mother, father)
    )


def permuted_poses(key: jax.Array, mother: jax.Array, father: jax.Array) -> jax.Array:
    """Draw K poses [K, J] without repetition from the parents' 2K, in random order (Wilson)."""
    both = jnp.concatenate([mother, father])
    return jax.random.permutation(key, both)[: mother.shape[0]]


def aligned_poses(key: jax.Array, mother: jax.Array, father: jax.Array) -> jax.Array:
    """Draw each of K poses [K, J] from either parent, at the same index."""
    return jnp.where(jax.random.bernoulli(key, 0.5, (mother.shape[0], 1)), mother, father)


def mutated_poses(
    key: jax.Array,
    poses: jax.Array,
    low: jax.Array,
    high: jax.Array,
    kind: str | Choice,
    sigma: jax.Array | float,
    redrawn: jax.Array | float = 0.5,
) -> jax.Array:
    """Return key poses [K, J] with a change in one of them, within the box.

    kind, sigma, redrawn: see `mutation`, `sigma` and `redrawn` of `EvolutionConfig`.
    """
    key_pose, key_joint, key_value, key_kind = jax.random.split(key, 4)
    count, joints = poses.shape
    here = jnp.arange(count) == jax.random.randint(key_pose, (), 0, count)
    order = jax.random.permutation(key_joint, jnp.arange(joints))
    steps = jax.random.bernoulli(key_kind, 1 - redrawn)
    moves = chosen(kind, "gaussian") | (chosen(kind, "mixed") & steps)
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
    """Return the nearest of 256 levels between low and high, as integers."""
    return jnp.round(
        255 * jnp.clip((values - low) / jnp.maximum(high - low, 1e-9), 0.0, 1.0)
    ).astype(jnp.int32)
