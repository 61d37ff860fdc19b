"""Separable CMA-ES: a search that learns a normal distribution of good genomes, gene by gene.

All children of a generation are drawn from it; the better half of them moves its mean, its step and
the variance of each gene. Its cost is linear in the number of genes. Genes are in units of their
ranges, and a draw beyond a bound is reflected.

Source: Ros & Hansen 2008, "A simple modification in CMA-ES achieving linear time and space
complexity"; notation of Hansen's tutorial (arXiv 1604.00772). Learning rates are capped at 1 as in
pycma, because hundreds of children exceed the cap that the paper assumes.

Letters: `n` genes, `M` children.
"""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from mjxgait.evolution.variation import Box
from mjxgait.types import pytree

LEAST = 1e-12
"""Lowest variance and width of a gene, against division by zero."""


@pytree
class Normal:
    """Distribution of the next children, and what led to it.

    mean: [n] in the unit cube. step: [] common standard deviation, in ranges. variance: [n] of each
    gene, in squared steps. step_path, path: [n] decaying sums of the mean's moves, with and without
    division by the genes' deviations. updates: [] number of generations learnt from.
    """

    mean: jax.Array
    step: jax.Array
    variance: jax.Array
    step_path: jax.Array
    path: jax.Array
    updates: jax.Array


@dataclasses.dataclass(frozen=True)
class Rates:
    """Learning rates for `n` [] genes with a range and M children; names as in the tutorial.

    weights: [M] of the children, best first. effective: number of children that equal weights
    would have for the same variance of their mean.
    """

    weights: np.ndarray
    effective: float
    c_step: jax.Array
    damping: jax.Array
    c_path: jax.Array
    c_one: jax.Array
    c_all: jax.Array
    length: jax.Array
    """Expected length of a standard normal vector [n]."""


def rates(genes: jax.Array, children: int) -> Rates:
    """Return the published rates. genes: []; children: M, at least 2."""
    best = children // 2
    raw = np.maximum(math.log(best + 1) - np.log(np.arange(1, children + 1)), 0.0)
    weights = raw / raw.sum()
    m, n = 1 / float(np.sum(weights**2)), genes
    c_step = (m + 2) / (n + m + 3)
    c_one = 2 / ((n + 1.3) ** 2 + m)
    full = 2 / m / (n + math.sqrt(2)) ** 2 + (1 - 1 / m) * jnp.minimum(
        1.0, (2 * m - 1) / ((n + 2) ** 2 + m)
    )
    return Rates(
        weights=weights.astype(np.float32),
        effective=m,
        c_step=c_step,
        damping=1 + 2 * jnp.maximum(0.0, jnp.sqrt((m - 1) / (n + 1)) - 1) + c_step,
        c_path=4 / (n + 4),
        c_one=c_one,
        c_all=jnp.minimum(1 - c_one, full * (n + 2) / 3),
        length=jnp.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2)),
    )


@dataclasses.dataclass(frozen=True, eq=False)
class SeparableCma:
    """Strategy over a box. first_step: first standard deviation of every gene, in ranges."""

    box: Box
    first_step: jax.Array | float

    def begun(self, genomes: object) -> Normal:
        """Return the distribution around the first of some genomes [N, ...], best first."""
        mean = self._points(jax.tree.map(lambda leaf: leaf[:1], genomes))[0]
        nothing = jnp.zeros_like(mean)
        step = jnp.asarray(self.first_step, jnp.float32)
        return Normal(mean, step, jnp.ones_like(mean), nothing, nothing, jnp.int32(0))

    def draw(self, key: jax.Array, normal: Normal, count: int) -> Any:
        """Draw genomes [count, ...] inside the box."""
        noise = jax.random.normal(key, (count, *normal.mean.shape))
        points = normal.mean + normal.step * _deviations(normal) * noise
        low, width, unravel = self._edges()
        return jax.vmap(unravel)(low + width * reflected(points))

    def learnt(self, normal: Normal, genomes: object, fitness: jax.Array, tie: jax.Array) -> Normal:
        """Return the distribution after an evaluation of genomes [M, ...].

        fitness: [M], higher is better. tie: [M], orders those of equal fitness.
        """
        _, width, _ = self._edges()
        free = width > 0
        rate = rates(jnp.maximum(jnp.sum(free), 1).astype(jnp.float32), len(fitness))
        moves = (self._points(genomes) - normal.mean) / normal.step
        moves = jnp.where(free, moves, 0.0)[jnp.lexsort((-tie, -fitness))]
        move = rate.weights @ moves
        updates = normal.updates + 1

        kept = 1 - rate.c_step
        step_path = kept * normal.step_path + jnp.sqrt(
            rate.c_step * (2 - rate.c_step) * rate.effective
        ) * (move / _deviations(normal))
        length = jnp.linalg.norm(step_path)
        step = normal.step * jnp.exp(rate.c_step / rate.damping * (length / rate.length - 1))

        # While the step grows fast, the other path would only lengthen the variance in its
        # direction.
        settled = (
            length / jnp.sqrt(1 - kept ** (2 * (updates + 1)))
            < (1.4 + 2 / (jnp.sum(free) + 1)) * rate.length
        )
        gain = rate.c_path * (2 - rate.c_path)
        path = (1 - rate.c_path) * normal.path + settled * jnp.sqrt(gain * rate.effective) * move
        variance = (
            (1 - rate.c_one * (1 - gain * ~settled) - rate.c_all) * normal.variance
            + rate.c_one * path**2
            + rate.c_all * (rate.weights @ moves**2)
        )
        mean = normal.mean + normal.step * move
        return Normal(mean, jnp.minimum(step, 1.0), variance, step_path, path, updates)

    def _edges(self) -> tuple[jax.Array, jax.Array, Any]:
        """Return lowest genes [n], widths of their ranges [n], and genes -> genome."""
        low, unravel = ravel_pytree(self.box.low)
        return low, ravel_pytree(self.box.high)[0] - low, unravel

    def _points(self, genomes: object) -> jax.Array:
        """Return genomes [N, ...] as points [N, n] of the unit cube."""
        low, width, _ = self._edges()
        rows = jax.vmap(lambda genome: ravel_pytree(genome)[0])(genomes)
        return (rows - low) / jnp.maximum(width, LEAST)


def reflected(points: jax.Array) -> jax.Array:
    """Fold points into the unit cube at its faces, as often as needed."""
    return 1 - jnp.abs(1 - jnp.mod(points, 2.0))


def _deviations(normal: Normal) -> jax.Array:
    """Return the standard deviations [n] of the genes, in steps."""
    return jnp.sqrt(jnp.maximum(normal.variance, LEAST))
