"""Family of an individual with a grown body: its ancestors, mother by mother.

Read from the parents in `metrics.jsonl` and the bodies in RUN/family (`training.family`).
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from mjxgait.controllers.sims_brain.reference_body import Part, grow
from mjxgait.errors import UserError
from mjxgait.evolution.state import Origin
from mjxgait.training.family import FAMILY, GRAPH_PREFIX, Newborns, read_newborns
from mjxgait.training.logs import FATHERS, MOTHERS, Line, parent

Body = Mapping[str, np.ndarray]
"""Arrays that a body grows from, by dotted name."""
COPIED = ("half", "swing", "place", "turn", "scale")
"""Arrays of numbers of a node, by which it is recognised in a child: no two nodes were drawn alike."""
VISIBLE = 0.02
"""Least change of a size or a place that counts as a change of the body, over its largest size."""


@dataclasses.dataclass(frozen=True, eq=False)
class Relative:
    """An individual. generation, place: of its birth. fitness: there. body: what it grew from."""

    generation: int
    place: int
    origin: Origin
    fitness: float
    body: Body


@dataclasses.dataclass(frozen=True, eq=False)
class Birth:
    """An individual with its parents. mother: None for the first of a line.

    operator: what made it, in a word. father: None without one that left a part in it.
    """

    child: Relative
    mother: Relative | None
    father: Relative | None
    operator: str


class Family:
    """Individuals of a run by generation and place. lines: of its log."""

    def __init__(self, run: Path, lines: Sequence[Line]) -> None:
        self.run = run
        self._lines = {line["generation"]: line for line in lines if MOTHERS in line}
        self._newborns: dict[int, Newborns | None] = {}

    def individual(self, generation: int, place: int) -> Relative | None:
        """Return the individual at a place of a population; None where its birth is not recorded."""
        while place >= 0 and (found := self._of(generation)) is not None:
            (at,) = np.nonzero(found.places == place)
            if len(at):
                return _relative(generation, found, int(at[0]))
            generation, place = generation - 1, self._parent(MOTHERS, generation, place)
        return None

    def line(self, generation: int, place: int) -> list[Birth]:
        """Return an individual's maternal line, oldest first, it itself last.

        Raises:
          UserError: its birth is not recorded.
        """
        child = self.individual(generation, place)
        if child is None:
            raise UserError(
                f"{self.run}: no family tree: it has no record of births ({FAMILY}/, with "
                "evolution.lineage = true), as runs of other bodies, of earlier versions, on "
                "islands or side by side (--runs); train a body of blocks anew, as one run"
            )
        births = []
        while child is not None:
            birth = self._birth(child)
            births.append(birth)
            child = birth.mother
        return births[::-1]

    def _birth(self, child: Relative) -> Birth:
        mother, father = (
            self._one_before(child, key) if child.origin in BRED else None
            for key in (MOTHERS, FATHERS)
        )
        if mother is None:
            first = child.origin == Origin.INITIAL and child.generation == 0
            return Birth(child, None, None, "first generation" if first else WORDS[child.origin])
        made = WORDS[Origin.MUTATION] if father is None else mixed(child, mother, father)
        return Birth(child, mother, father if made in (CROSSED, GRAFTED) else None, made)

    def _one_before(self, child: Relative, key: str) -> Relative | None:
        place = self._parent(key, child.generation, child.place)
        return self.individual(child.generation - 1, place)

    def _parent(self, key: str, generation: int, place: int) -> int:
        """Return the place of a parent, or an individual's own, one generation before."""
        return parent(self._lines.get(generation, {}).get(key, ()), place)

    def _of(self, generation: int) -> Newborns | None:
        if generation not in self._newborns:
            self._newborns[generation] = read_newborns(self.run, generation)
        return self._newborns[generation]


CROSSED, GRAFTED = "crossover", "grafting"
BRED = (Origin.CROSSOVER, Origin.MUTATION)
WORDS = {
    Origin.INITIAL: "drawn anew",
    Origin.NEWCOMER: "newcomer",
    Origin.MUTATION: "mutation",
    Origin.CROSSOVER: CROSSED,
    Origin.DRAWN: "drawn",
}


def _relative(generation: int, born: Newborns, at: int) -> Relative:
    return Relative(
        generation,
        int(born.places[at]),
        Origin(int(born.origin[at])),
        float(born.fitness[at]),
        {name: np.asarray(array[at], float) for name, array in born.bodies.items()},
    )


def mixed(child: Relative, mother: Relative, father: Relative) -> str:
    """Return how a father left nodes in a child: crossover, grafting, or not at all (mutation).

    The record has no operator. A node of the father in another place than its own was grafted, and
    one in a place that the mother's body uses was crossed. One in its own place that the mother's
    body does not use was crossed only if a connection of the father leads to it, from a node that
    both parents have: a graft attaches it to a node of the mother.
    """
    found: dict[int, bool] = {}  # nodes of the father: whether each is in its own place
    shared = []
    for node in connected(child.body):
        of_mother = _alike(child.body, node, mother.body, node)
        likest = [_alike(child.body, node, father.body, other) for other in _nodes(father.body)]
        best = int(np.argmax(likest))
        if likest[best] > max(of_mother, 0.5):
            found[node] = likest[node] == likest[best]
        elif likest[node] == of_mother:
            shared.append(node)
    if not found:
        return WORDS[Origin.MUTATION]
    crossed = all(found.values()) and (
        any(node in found for node in connected(mother.body))
        or _leads(child.body, father.body, shared, list(found))
    )
    return CROSSED if crossed else GRAFTED


def _leads(child: Body, parent: Body, sources: list[int], targets: list[int]) -> bool:
    """Return whether a connection of the child from sources to targets is one of the parent."""
    used, target = (f"{GRAPH_PREFIX}{name}" for name in ("used", "target"))
    same = (child[used] > 0) & (parent[used] > 0) & (child[target] == parent[target])
    return bool((same & np.isin(child[target], targets))[sources].any())


def connected(body: Body) -> list[int]:
    """Return the nodes that are reached from the first, in order."""
    target, used = body[f"{GRAPH_PREFIX}target"].astype(int), body[f"{GRAPH_PREFIX}used"] > 0
    found, waiting = {0}, [0]
    while waiting:
        node = waiting.pop()
        new = {int(other) for other in target[node][used[node]]} - found
        found |= new
        waiting += new
    return sorted(found)


def _nodes(body: Body) -> range:
    return range(len(body[f"{GRAPH_PREFIX}half"]))


def _alike(one: Body, node: int, other: Body, place: int) -> float:
    """Share of a node's numbers that are exactly those of another."""
    names = [f"{GRAPH_PREFIX}{name}" for name in COPIED]
    pairs = [(one[name][node], other[name][place]) for name in names]
    same = [np.ravel(a == b) for a, b in pairs]
    return float(np.concatenate(same).mean())


def difference(before: Sequence[Part], after: Sequence[Part]) -> str:
    """Return in a few words how a body differs from another; empty if that is not to be seen."""
    if len(before) != len(after):
        return f"{len(before)} → {_blocks(len(after))}"
    return ", ".join(_differences(before, after))


def _differences(before: Sequence[Part], after: Sequence[Part]) -> Iterator[str]:
    pairs = list(zip(before, after, strict=True))
    if any(a.parent != b.parent for a, b in pairs):
        yield "other tree"
    if any(a.joint != b.joint for a, b in pairs):
        yield "other joints"
    size = max(float(part.half.max()) for part in before)
    if any(np.abs(a.half - b.half).max() > VISIBLE * size for a, b in pairs):
        yield "sizes"
    elif any(np.abs(a.box.corners - b.box.corners).max() > 2 * VISIBLE * size for a, b in pairs):
        yield "places"


def _blocks(count: int) -> str:
    return f"{count} {'block' if count == 1 else 'blocks'}"


@dataclasses.dataclass(frozen=True, eq=False)
class Step:
    """A change of the body in a line. change: in a few words; of the first, its number of blocks."""

    birth: Birth
    change: str


def body_changes(births: Sequence[Birth], most_parts: int, most_links: int) -> list[Step]:
    """Return the births of a line at which the body changed since the last change, and the first.

    most_parts, most_links: of a body, see `grow`.
    """
    shown = grow(births[0].child.body, most_parts, most_links)
    steps = [Step(births[0], _blocks(len(shown)))]
    for birth in births[1:]:
        parts = grow(birth.child.body, most_parts, most_links)
        if change := difference(shown, parts):
            steps.append(Step(birth, change))
            shown = parts
    return steps
