"""Symmetric matrices with the sparsity of a kinematic tree, lanes innermost.

Entry (k, i) is nonzero only if one degree of freedom moves the other: i is an ancestor of k, or k
itself. The mass matrix has this form. So has Newton's Hessian of a body that touches only the
floor, because a contact moves one chain of ancestors. Row k is stored as an array [n, L] over the
chain root ... k. Eliminating from the leaves inwards creates no new entries (Featherstone, "Rigid
Body Dynamics Algorithms", section 6.5), here in the form H = L^T L with square roots: each row is
then one fused operation that ends in a division.
"""

import dataclasses
from collections import Counter
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.types import Number

FREE, BALL, SLIDE, HINGE = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("FREE", "BALL", "SLIDE", "HINGE")
)
ANY = -1
"""Any type of watched shape: none of its numbers is assumed to be zero."""
FREEDOMS = {FREE: 6, BALL: 3, SLIDE: 1, HINGE: 1}


@dataclasses.dataclass(frozen=True)
class JointSlot:
    """Joint. kind: FREE, BALL, SLIDE or HINGE. qpos, dof: addresses."""

    kind: int
    qpos: int
    dof: int


@dataclasses.dataclass(frozen=True)
class BodySlot:
    """Body. parent: index among the bodies, -1 for the world. joints: from the first to move it."""

    parent: int
    joints: tuple[JointSlot, ...]


@dataclasses.dataclass(frozen=True)
class ContactSlot:
    """Sphere of a body that may touch the floor; capsule: whether it is an end of one."""

    body: int
    capsule: bool


@dataclasses.dataclass(frozen=True)
class LimitSlot:
    """Hinge or slide with a limited range; addresses."""

    dof: int
    qpos: int


@dataclasses.dataclass(frozen=True)
class WatchedSlot:
    """Sensed geom. body: -1 for the world's. shape: MuJoCo's type, or `ANY`."""

    body: int
    shape: int


@dataclasses.dataclass(frozen=True)
class Ends:
    """Places of a contact's numbers: the two geoms; side: 1, -1 of a capsule, 0 of a sphere."""

    floor: int
    geom: int
    side: int


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


@dataclasses.dataclass(frozen=True)
class Carriers:
    """Part of the tree that moves contacts.

    root: the body of a free root, -1 if there is none; the fields below leave it out.
    bodies: (body, parent, places of its own degrees of freedom in `dofs`), parents first.
    dofs: degrees of freedom; for each, body_of: its body, lengths: of its chain down to it,
      path_of: the place in `leaves` of a chain that contains it.
    leaves: the last degrees of freedom of chains that together hold all of `dofs`.
    contacts: (body, number of its contacts), in the order of the contacts.
    """

    root: int
    bodies: tuple[tuple[int, int, tuple[int, ...]], ...]
    dofs: tuple[int, ...]
    body_of: tuple[int, ...]
    lengths: tuple[int, ...]
    path_of: tuple[int, ...]
    leaves: tuple[int, ...]
    contacts: tuple[tuple[int, int], ...]


def find_carriers(
    bodies: Sequence[BodySlot], pattern: Sparsity, contacts: Sequence[ContactSlot]
) -> Carriers:
    """Find the part of a tree that moves these contacts."""
    counts = Counter(contact.body for contact in contacts)
    moved: set[int] = set()
    for body in counts:
        while body >= 0:
            moved.add(body)
            body = bodies[body].parent
    trees = [b for b in moved if bodies[b].parent < 0]
    root = 0 if trees == [0] and [j.kind for j in bodies[0].joints] == [FREE] else -1
    rest = sorted(moved - {root})
    own = {b: [j.dof + n for j in bodies[b].joints for n in range(FREEDOMS[j.kind])] for b in rest}
    dofs = [k for b in rest for k in own[b]]
    above = 6 if root == 0 else 0
    leaf_of: dict[int, int] = {}
    for leaf in reversed(dofs):
        if leaf not in leaf_of:
            leaf_of |= {k: leaf for k in pattern.chains[leaf][above:] if k not in leaf_of}
    leaves = sorted(set(leaf_of.values()))
    return Carriers(
        root=root,
        bodies=tuple((b, bodies[b].parent, tuple(map(dofs.index, own[b]))) for b in rest),
        dofs=tuple(dofs),
        body_of=tuple(b for b in rest for _ in own[b]),
        lengths=tuple(len(pattern.chains[k]) - above for k in dofs),
        path_of=tuple(leaves.index(leaf_of[k]) for k in dofs),
        leaves=tuple(leaves),
        contacts=tuple(sorted(counts.items())),
    )
