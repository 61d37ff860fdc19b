"""Drawing of a modular body's brain: a band per part, from sensors on the left to hinges."""

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from mjxgait.controllers.sims_brain.reference import CENTRE, BrainReference
from mjxgait.rendering.curves import ACCENT, DARK, MIDDLE, PALE

READS: Mapping[str, int] = {
    **dict.fromkeys(("sum", "product", "sum-threshold", "if", "interpolate"), 3),
    **dict.fromkeys(("divide", "greater-than", "min", "max", "expt", "memory"), 2),
    **dict.fromkeys(("oscillate-wave", "oscillate-saw"), 2),
}
"""Number of its three inputs that a neuron uses; 1 for functions not listed."""
NOTHING, ONE = 0, 1
"""Input columns of constants, which are no cells; see `BrainReference`."""


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


def network_of(reference: BrainReference, lit: bool) -> Network:
    """Search breadth first from all hinges against the wires; cells not reached have no effect.

    lit: whether there is a light; else the light sensors are left out.
    """
    depth = {-1 - h: 0 for h in range(len(reference.hinges))}
    waiting, wires = list(depth), []
    for target in waiting:
        for source, weight in _inputs(reference, target, lit):
            if source in (NOTHING, ONE):
                continue
            wires.append(Wire(source, target, weight))
            if source not in depth:
                depth[source] = depth[target] + 1
                waiting.append(source)
    cells = {number: _cell(reference, number, depth[number], lit) for number in waiting}
    return Network(cells, tuple(wires))


def kind_of(reference: BrainReference, column: int) -> str:
    """Return the function of the neuron in a column."""
    place = column - min(reference.place.values())
    return next(kind for kind, these in reference.alike.items() if place in these)


def _inputs(reference: BrainReference, number: int, lit: bool) -> Iterator[tuple[int, float]]:
    """Column and weight of every input that a cell uses."""
    first = min(reference.place.values())
    if number < 0:
        hinge = -1 - number
        wires = [(int(reference.driver[hinge]), float(reference.gain[hinge]))]
        wires += _steering(reference, hinge)
    elif number >= first:
        reads = READS.get(kind_of(reference, number), 1)
        columns, weights = reference.column[number - first], reference.weight[number - first]
        wires = list(zip(columns[:reads].tolist(), weights[:reads].tolist(), strict=True))
    else:
        wires = []
    seen = range(first - 3 * len(reference.parts), first)
    for column, weight in wires:
        yield NOTHING if column in seen and not lit else column, weight


def _steering(reference: BrainReference, hinge: int) -> list[tuple[int, float]]:
    """Return column and weight of the light that adds to a hinge's drive; none without `steer`."""
    if reference.steer is None:
        return []
    columns, weights = reference.lit[hinge].tolist(), reference.steer[hinge, 0].tolist()
    return list(zip(columns, weights, strict=True))


def _cell(reference: BrainReference, number: int, depth: int, lit: bool) -> Cell:
    joints, parts = len(reference.hinges), len(reference.parts)
    given = [_written(column, weight) for column, weight in _inputs(reference, number, lit)]
    if number < 0:
        part, hinge = reference.hinges[-1 - number]
        driven = "" if given[0] == "·" else f" = {given[0]}"
        if lit and reference.steer is not None:
            x, y, z = reference.steer[-1 - number, 1]
            driven = f" = {given[0]} (1{x:+.1f}x{y:+.1f}y{z:+.1f}z)"
        return Cell(part, "hinge", f"{reference.parts[part].joint} {hinge}{driven}", depth)
    if number < 2 + joints:
        part, hinge = reference.hinges[number - 2]
        return Cell(part, "sensor", f"angle {hinge}", depth)
    if number < 2 + joints + parts:
        return Cell(number - 2 - joints, "sensor", "contact", depth)
    if given:
        owner = next(owner for (owner, _), column in reference.place.items() if column == number)
        return Cell(owner, "neuron", f"{kind_of(reference, number)}({', '.join(given)})", depth)
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


COLUMN, ROW = 2.5, 0.42
"""Distance between cells in inches."""
MARGIN = 1.1
"""Space for the bands' names in inches."""
HEADING = 0.6
NEAR = 0.62
"""Position of the weight along its wire, as a fraction: weights of wires from one cell must not
overlap."""
LOOKS = {
    "hinge": {"facecolor": DARK, "edgecolor": DARK, "boxstyle": "round,pad=0.3"},
    "neuron": {"facecolor": PALE, "edgecolor": DARK, "boxstyle": "round,pad=0.3"},
    "sensor": {"facecolor": "white", "edgecolor": DARK, "boxstyle": "round4,pad=0.3"},
}
Place = tuple[float, float]


def shape(network: Network) -> tuple[float, float]:
    """Return the figure's size in inches."""
    rows = sum(_rows(network).values())
    return MARGIN + COLUMN * (_deepest(network) + 1), HEADING + ROW * (rows + 1)


def draw_brain(drawing: Figure, network: Network) -> None:
    """Draw cells in columns by their distance to a hinge in wires, and wires with their weights."""
    axes = drawing.subplots()
    below = 0
    for band, (owner, count) in enumerate(_rows(network).items()):
        above = below - count
        axes.axhspan(above, below, color="0.96" if band % 2 else "white", zorder=0)
        axes.text(-0.95 - _deepest(network), (above + below) / 2, owner_name(owner), va="center")
        below = above
    boxes = {n: _boxed(axes, network.cells[n], at) for n, at in _places(network).items()}
    for wire in network.wires:
        _draw_wire(axes, wire.weight, boxes[wire.source], boxes[wire.target])
    axes.set(xlim=(-1.0 - _deepest(network), 0.5), ylim=(below, 0.0))
    axes.set_axis_off()
    axes.set_title("the brain: what reaches a hinge; dashed wires turn the sign")


def _deepest(network: Network) -> int:
    return max(cell.depth for cell in network.cells.values())


def _rows(network: Network) -> Mapping[int, int]:
    """Number of rows per owner, the centre first."""
    counts = Counter((cell.owner, cell.depth) for cell in network.cells.values())
    owners = sorted({owner for owner, _ in counts})
    return {o: max(count for (owner, _), count in counts.items() if owner == o) for o in owners}


def _places(network: Network) -> Mapping[int, Place]:
    """Place of each cell: columns from the hinges, rows from the top."""
    places: dict[int, Place] = {}
    top = 0.0
    for owner, rows in _rows(network).items():
        columns: dict[int, list[int]] = {}
        for number, cell in network.cells.items():
            if cell.owner == owner:
                columns.setdefault(cell.depth, []).append(number)
        for depth, numbers in columns.items():
            for k, number in enumerate(numbers):
                places[number] = -float(depth), top - (k + 0.5) * rows / len(numbers)
        top -= rows
    return places


def _boxed(axes: Axes, cell: Cell, at: Place) -> Text:
    return axes.text(
        *at,
        cell.label,
        color="white" if cell.kind == "hinge" else DARK,
        fontsize=8,
        ha="center",
        va="center",
        bbox={"linewidth": 0.7, **LOOKS[cell.kind]},
        zorder=3,
    )


def _draw_wire(axes: Axes, weight: float, source: Text, target: Text) -> None:
    """Draw a straight arrow to the right; a bow backwards or to the cell itself."""
    (x, y), (to_x, to_y) = start, end = source.get_position(), target.get_position()
    arrow: dict[str, object] = {
        "arrowstyle": "->",
        "color": MIDDLE,
        "linestyle": "--" if weight < 0 else "-",
        "linewidth": 0.6 + min(abs(weight), 3.0) / 2,
        "connectionstyle": f"arc3,rad={0.0 if to_x > x else 0.4}",
    }
    if source is target:
        start, end = (x - 0.12, y), (x + 0.12, y)
        arrow |= {"connectionstyle": "arc3,rad=-2.0", "shrinkA": 8, "shrinkB": 8}
    else:
        arrow |= {"patchA": source.get_bbox_patch(), "patchB": target.get_bbox_patch()}
    axes.annotate("", end, start, arrowprops=arrow)
    said = f"{weight:.2f}"
    if source is target:
        axes.text(x, y + 0.42, said, color=ACCENT, fontsize=7, ha="center", va="center", zorder=4)
    else:
        place = ((1 - NEAR) * x + NEAR * to_x, (1 - NEAR) * y + NEAR * to_y)
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}
        axes.text(*place, said, color=ACCENT, fontsize=7, ha="center", va="center", bbox=box)
