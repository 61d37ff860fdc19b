"""Part of a tree that moves contacts."""

import dataclasses
from collections import Counter
from collections.abc import Sequence

from mjxgait.physics.lane_major.slots import (
    FREE,
    FREEDOMS,
    BodySlot,
    ContactSlot,
)
from mjxgait.physics.lane_major.treematrix import Sparsity


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
