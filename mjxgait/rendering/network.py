"""Parts of a modular body's brain that reach a hinge: neurons, their sensors, and the wires."""

import dataclasses
from collections.abc import Iterator, Mapping

from mjxgait.controllers.sims_brain.reference import CENTRE, BrainTwin

READS: Mapping[str, int] = {
    **dict.fromkeys(("sum", "product", "sum-threshold", "if", "interpolate"), 3),
    **dict.fromkeys(("divide", "greater-than", "min", "max", "expt", "memory"), 2),
    **dict.fromkeys(("oscillate-wave", "oscillate-saw"), 2),
}
"""Number of its three inputs that a neuron uses; 1 for functions not listed."""
NOTHING, ONE = 0, 1
"""Input columns of constants, which are no cells; see `BrainTwin`."""


@dataclasses.dataclass(frozen=True)
class Cell:
    """A hinge, a neuron or a sensor. owner: number of its part, or `CENTRE`. depth: fewest wires to
    a hinge.
    """

    owner: int
    kind: str
    label: str
    depth: int


@dataclasses.dataclass(frozen=True)
class Wire:
    """Connection between two cells, given by their numbers."""

    source: int
    target: int
    weight: float


@dataclasses.dataclass(frozen=True)
class Network:
    """Graph of a brain. cells: by number: the reference controller's column, or -1 - h for hinge
    h.
    """

    cells: Mapping[int, Cell]
    wires: tuple[Wire, ...]


def network_of(twin: BrainTwin, lit: bool) -> Network:
    """Search breadth first from all hinges against the wires; cells not reached have no effect.

    lit: whether there is a light; else the light sensors are left out.
    """
    depth = {-1 - h: 0 for h in range(len(twin.hinges))}
    waiting, wires = list(depth), []
    for target in waiting:
        for source, weight in _inputs(twin, target, lit):
            if source in (NOTHING, ONE):
                continue
            wires.append(Wire(source, target, weight))
            if source not in depth:
                depth[source] = depth[target] + 1
                waiting.append(source)
    cells = {number: _cell(twin, number, depth[number], lit) for number in waiting}
    return Network(cells, tuple(wires))


def kind_of(twin: BrainTwin, column: int) -> str:
    """Return the function of the neuron in a column."""
    place = column - min(twin.place.values())
    return next(kind for kind, these in twin.alike.items() if place in these)


def _inputs(twin: BrainTwin, number: int, lit: bool) -> Iterator[tuple[int, float]]:
    """Column and weight of every input that a cell uses."""
    first = min(twin.place.values())
    if number < 0:
        wires = [(int(twin.driver[-1 - number]), float(twin.gain[-1 - number]))]
    elif number >= first:
        reads = READS.get(kind_of(twin, number), 1)
        columns, weights = twin.column[number - first], twin.weight[number - first]
        wires = list(zip(columns[:reads].tolist(), weights[:reads].tolist(), strict=True))
    else:
        wires = []
    seen = range(first - 3 * len(twin.parts), first)
    for column, weight in wires:
        yield NOTHING if column in seen and not lit else column, weight


def _cell(twin: BrainTwin, number: int, depth: int, lit: bool) -> Cell:
    joints, parts = len(twin.hinges), len(twin.parts)
    given = [_written(column, weight) for column, weight in _inputs(twin, number, lit)]
    if number < 0:
        part, hinge = twin.hinges[-1 - number]
        driven = "" if given == ["·"] else f" = {given[0]}"
        return Cell(part, "hinge", f"{twin.parts[part].joint} {hinge}{driven}", depth)
    if number < 2 + joints:
        part, hinge = twin.hinges[number - 2]
        return Cell(part, "sensor", f"angle {hinge}", depth)
    if number < 2 + joints + parts:
        return Cell(number - 2 - joints, "sensor", "contact", depth)
    if given:
        owner = next(owner for (owner, _), column in twin.place.items() if column == number)
        return Cell(owner, "neuron", f"{kind_of(twin, number)}({', '.join(given)})", depth)
    part, axis = divmod(number - 2 - joints - parts, 3)
    return Cell(part, "sensor", f"light {'xyz'[axis]}", depth)


def _written(column: int, weight: float) -> str:
    """An input in its neuron's label: a number, or a dot for a wire."""
    if column == NOTHING:
        return "0"
    return f"{weight:.2f}" if column == ONE else "·"


def owner_name(owner: int) -> str:
    """Return a band's name."""
    return "centre" if owner == CENTRE else f"part {owner}"
