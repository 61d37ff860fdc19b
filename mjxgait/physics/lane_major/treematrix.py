"""Symmetric matrices with the sparsity of a kinematic tree, lanes innermost.

Entry (k, i) is nonzero only if one degree of freedom moves the other: i is an ancestor of k, or k
itself. The mass matrix has this form. So has Newton's Hessian of a body that touches only the
floor, because a contact moves one chain of ancestors. Row k is stored as an array [n, L] over the
chain root ... k. Eliminating from the leaves inwards creates no new entries (Featherstone, "Rigid
Body Dynamics Algorithms", section 6.5), here in the form H = L^T L with square roots: each row is
then one fused operation that ends in a division.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.types import Number

Rows = tuple[jax.Array, ...]


@dataclasses.dataclass(frozen=True)
class Sparsity:
    """Nonzeros of a tree.

    chains: per degree of freedom k its ancestors from the root, and k itself.
    below: per k all m below it, as (m, position of k in m's chain).
    """

    chains: tuple[tuple[int, ...], ...]
    below: tuple[tuple[tuple[int, int], ...], ...]


def sparsity(parents: Sequence[int]) -> Sparsity:
    """Build the pattern of a tree.

    parents: per degree of freedom its parent, -1 for none; parents come first.
    """
    chains: list[tuple[int, ...]] = []
    for k, parent in enumerate(parents):
        chains.append((*(chains[parent] if parent >= 0 else ()), k))
    below: list[list[tuple[int, int]]] = [[] for _ in parents]
    for m, chain in enumerate(chains):
        for position, k in enumerate(chain[:-1]):
            below[k].append((m, position))
    return Sparsity(tuple(chains), tuple(tuple(b) for b in below))


@dataclasses.dataclass(frozen=True)
class Factor:
    """Factor L with L^T L = H.

    rows: of L. pivots: its diagonal, kept apart so that XLA computes each square root once.
    """

    rows: Rows
    pivots: tuple[jax.Array, ...]


def factor(pattern: Sparsity, rows: Rows) -> Factor:
    """Factorise a symmetric positive definite H."""
    lower: dict[int, jax.Array] = {}
    pivots: dict[int, jax.Array] = {}
    for k in reversed(range(len(rows))):
        row = rows[k]
        for m, position in pattern.below[k]:
            row = row - lower[m][position] * lower[m][: position + 1]
        pivots[k] = jnp.sqrt(row[-1])
        lower[k] = row / pivots[k]
    return Factor(
        tuple(lower[k] for k in range(len(rows))), tuple(pivots[k] for k in range(len(rows)))
    )


def solve(pattern: Sparsity, lower: Factor, rhs: Sequence[jax.Array]) -> list[jax.Array]:
    """Solve L^T L x = rhs for x; both are lists of [L]."""
    half: dict[int, jax.Array] = {}
    for k in reversed(range(len(rhs))):
        value = rhs[k]
        for m, position in pattern.below[k]:
            value = value - lower.rows[m][position] * half[m]
        half[k] = value / lower.pivots[k]
    solution: list[jax.Array] = []
    for k, chain in enumerate(pattern.chains):
        value = half[k]
        for position, i in enumerate(chain[:-1]):
            value = value - lower.rows[k][position] * solution[i]
        solution.append(value / lower.pivots[k])
    return solution


def on_pivot(row: jax.Array, value: Number) -> jax.Array:
    """Add a value [1 or L] to the last entry of a row [n, L]."""
    last = np.zeros((row.shape[0], 1), row.dtype)
    last[-1] = 1.0
    return row + last * value


def multiply(pattern: Sparsity, rows: Rows, vector: Sequence[jax.Array]) -> list[jax.Array]:
    """H x as a list of [L]."""
    product = []
    for k, chain in enumerate(pattern.chains):
        terms = [rows[k][position] * vector[i] for position, i in enumerate(chain)]
        terms += [rows[m][position] * vector[m] for m, position in pattern.below[k]]
        product.append(sum(terms[1:], terms[0]))
    return product
