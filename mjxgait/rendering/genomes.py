"""Drawings of genomes: expression trees, and graphs beside the bodies that grow from them.

In a tree, leaves stand side by side, each parent in the middle of its children.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mjxgait.champion import Champion
from mjxgait.controllers.expressions.text import Expression, every_terminal, nested
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.reference_body import Part, grow
from mjxgait.creature import Creature
from mjxgait.inspect.snapshot import Snapshot, read_snapshot
from mjxgait.rendering.curves import ACCENT, DARK, MIDDLE, PALE, titled
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.video import Runner, in_generations
from mjxgait.rendering.walk import Walk
from mjxgait.training.logs import mothers_line

LEAF, LEVEL = 0.52, 0.5
"""Width of a leaf and height of a level in inches."""
NARROWEST, WIDEST = 6.0, 40.0
"""Limits of a figure's width in inches."""


@dataclasses.dataclass(frozen=True)
class Node:
    """A tree node. place: leaves from the left. depth: below the root. above: parent's place."""

    label: str
    kind: str
    place: float
    depth: int
    above: float | None


def laid_out(expression: Expression) -> tuple[list[Node], int]:
    """Return an expression's nodes and its number of leaves."""
    nodes: list[Node] = []
    leaves = _lay(expression, 0, 0, nodes)[1]
    return nodes, leaves


def _lay(expression: Expression, first: int, depth: int, nodes: list[Node]) -> tuple[float, int]:
    """Add the nodes of a subtree with leaves from `first` on; return its place and leaf count."""
    if not isinstance(expression, tuple):
        kind = "number" if isinstance(expression, float) else "sense"
        label = f"{expression:.3g}" if isinstance(expression, float) else expression
        nodes.append(Node(label, kind, first, depth, None))
        return first, 1
    places, leaves, mine = [], 0, []
    for part in expression[1:]:
        below: list[Node] = []
        place, count = _lay(part, first + leaves, depth + 1, below)
        places.append(place)
        mine.append(below)
        leaves += count
    place = (places[0] + places[-1]) / 2
    for below in mine:
        # A subtree's root was added last.
        below[-1] = dataclasses.replace(below[-1], above=place)
        nodes += below
    nodes.append(Node(str(expression[0]), "function", place, depth, None))
    return place, leaves


def expressions_of(creature: Creature, champion: Champion) -> Mapping[str, Expression]:
    """Return a champion's expressions by joint."""
    known, genome = every_terminal(creature), champion.genome
    rows = zip(creature.joints.names, genome["code"], genome["value"], strict=True)
    return {joint: nested(code, value, known) for joint, code, value in rows}


def shape(trees: Mapping[str, Expression]) -> tuple[float, float]:
    """Return the figure's size in inches."""
    layouts = [laid_out(tree) for tree in trees.values()]
    width = max(leaves for _, leaves in layouts) * LEAF
    heights = [_levels(nodes) * LEVEL for nodes, _ in layouts]
    return min(max(width, NARROWEST), WIDEST), sum(heights)


def draw_trees(drawing: Figure, trees: Mapping[str, Expression]) -> None:
    """Draw the trees in a column: functions in circles, observations in colour, numbers plain."""
    layouts = {joint: laid_out(tree) for joint, tree in trees.items()}
    heights = [_levels(nodes) for nodes, _ in layouts.values()]
    rows = drawing.subplots(len(layouts), 1, squeeze=False, height_ratios=heights)[:, 0]
    most = max(max(leaves for _, leaves in layouts.values()), NARROWEST / LEAF)
    for axes, (joint, (nodes, leaves)) in zip(rows, layouts.items(), strict=True):
        _draw(axes, nodes, most, leaves)
        axes.set_title(f"{joint}: {len(nodes)} {'node' if len(nodes) == 1 else 'nodes'}")


def _levels(nodes: list[Node]) -> float:
    """Height of a tree and its title in levels."""
    return max(node.depth for node in nodes) + 2.2


def _draw(axes: Axes, nodes: list[Node], most: float, leaves: int) -> None:
    shift = (most - leaves) / 2
    for x, y, above in _places(nodes, shift):
        axes.plot([x, above], [y, y + 1], color=MIDDLE, linewidth=0.9, zorder=1)
    looks = {
        "function": {"facecolor": PALE, "edgecolor": DARK, "boxstyle": "circle,pad=0.25"},
        "sense": {"facecolor": ACCENT, "edgecolor": DARK, "boxstyle": "round,pad=0.25"},
        "number": {"facecolor": "white", "edgecolor": "none", "boxstyle": "round,pad=0.1"},
    }
    for node in nodes:
        look = {"linewidth": 0.7, **looks[node.kind]}
        axes.text(
            node.place + shift,
            -node.depth,
            node.label,
            ha="center",
            va="center",
            fontsize=8,
            bbox=look,
        )
    axes.set(xlim=(-0.7, most - 0.3), ylim=(0.6 - _levels(nodes) + 1, 0.6))
    axes.set_axis_off()


def _places(nodes: list[Node], shift: float) -> Iterator[tuple[float, float, float]]:
    for node in nodes:
        if node.above is not None:
            yield node.place + shift, -node.depth, node.above + shift


STANDING = 0.1
"""Simulated seconds; only the first moment is shown."""
SIZE = (480, 360)
"""Pixels of a body's picture."""
MAX_BODIES = 8
"""Largest number of bodies in a row."""
COPIES = ("", "\nmirrored", "\na pair")
ALONG = (0.6, 0.45, 0.3)
"""Positions of labels along arrows, as fractions: labels of one node's arrows must not overlap."""


def draw_graph(drawing: Figure, walk: Walk) -> None:
    """Draw the nodes and connections that grow, and the body."""
    graph, body = drawing.subplots(1, 2)
    settings: BrainConfig = walk.champion.settings
    genome = walk.champion.genome
    _draw_graph(graph, genome, grow(genome, settings.parts, settings.links))
    body.imshow(Stage([walk], *SIZE).picture(0), interpolation="lanczos")
    body.set_axis_off()
    body.set_title("the body that grows")


@dataclasses.dataclass(frozen=True)
class Row:
    """Bodies of several generations. descend: whether each descends from the previous one."""

    bodies: Sequence[Runner]
    descend: bool


def bodies_of(run: Path, champion: Champion) -> Row:
    """Return the champion and its maternal ancestors in some of the stored generations; the best
    individuals if the log has no mothers.
    """
    latest = read_snapshot(run)
    line = mothers_line(latest.lines, latest.generation, place_in(latest, champion))
    descend = len(line) > 1
    places = line if descend else dict.fromkeys(latest.generations, 0)
    known = [generation for generation in latest.generations if generation in places]
    chosen = np.linspace(0, len(known) - 1, min(len(known), MAX_BODIES)).round().astype(int)
    shown = {known[i]: places[known[i]] for i in np.unique(chosen)}
    return Row(in_generations(run, shown, STANDING), descend)


def draw_bodies(drawing: Figure, row: Row, subject: str = "") -> None:
    """Draw the bodies in a row, each at its own scale. subject: see `titled`."""
    fields = drawing.subplots(1, len(row.bodies), squeeze=False)[0]
    for axes, body in zip(fields, row.bodies, strict=True):
        axes.imshow(Stage([body.walk], *SIZE).picture(0), interpolation="lanczos")
        axes.set_axis_off()
        axes.set_title(body.label, fontsize=9)
    said = "The champion and its ancestors, mother by mother"
    if not row.descend:
        said = "The best of each generation that was kept; one need not descend from the one before"
    drawing.suptitle(titled(subject, said), fontsize=10)


def place_in(population: Snapshot, champion: Champion) -> int:
    """Return the champion's place in the population; 0, the best, if it is absent."""
    genes = [
        (found == champion.genome[name]).reshape(len(found), -1).all(1)
        for name, found in population.genomes.items()
    ]
    return int(np.argmax(np.all(genes, axis=0)))


def _draw_graph(axes: Axes, genome: Mapping[str, np.ndarray], parts: Sequence[Part]) -> None:
    nodes = sorted({part.node for part in parts})
    angles = np.pi / 2 - 2 * np.pi * np.arange(len(nodes)) / len(nodes)
    at = dict(zip(nodes, np.column_stack([np.cos(angles), np.sin(angles)]), strict=True))
    used, target = genome["graph.used"] > 0, genome["graph.target"].astype(int)
    for node, number in np.argwhere(used):
        if node in at and target[node, number] in at:
            copies = COPIES[int(genome["graph.mirror"][node, number])]
            text = f"×{genome['graph.scale'][node, number]:.2f}{copies}"
            _connect(axes, at[node], at[target[node, number]], text, number)
    for node, place in at.items():
        x, y = place.tolist()
        far = 2.4 if (used[node] & (target[node] == node)).any() else 1.0
        axes.plot(x, y, "o", color=DARK, markersize=22, zorder=3)
        axes.text(x, y, str(node), color="white", ha="center", va="center", zorder=4)
        side = "center" if abs(x) < 0.1 else "left" if x > 0 else "right"
        said = _of_node(genome, node, [part for part in parts if part.node == node])
        axes.annotate(
            said,
            (x, y),
            (far * 20 * x, far * 30 * y),
            textcoords="offset points",
            ha=side,
            va="center",
            fontsize=8,
        )
    axes.set(xlim=(-2.2, 2.2), ylim=(-1.6, 1.7), aspect="equal")
    axes.set_axis_off()
    axes.set_title("the graph: nodes that grow, joint to the parent")


def _of_node(genome: Mapping[str, np.ndarray], node: int, grown: Sequence[Part]) -> str:
    joint = "root" if grown[0].parent < 0 else grown[0].joint
    size = " × ".join(f"{200 * half:.0f}" for half in genome["graph.half"][node])
    return f"{joint}, {size} cm\n{len(grown)} {'part' if len(grown) == 1 else 'parts'}"


def _connect(axes: Axes, start: np.ndarray, end: np.ndarray, text: str, number: int) -> None:
    """Draw an arrow; those of one node bend differently, and one to its own node loops outwards."""
    if np.allclose(start, end):
        aside = 0.14 * np.array([-start[1], start[0]])
        start, end, bend, shrink, along = start - aside, end + aside, 2.4 + number, 0, 0.5
    else:
        bend, shrink, along = 0.15 + 0.2 * number, 13, ALONG[number % len(ALONG)]
    arrow = {
        "arrowstyle": "->",
        "color": MIDDLE,
        "shrinkA": shrink,
        "shrinkB": shrink,
        "connectionstyle": f"arc3,rad={bend}",
    }
    axes.annotate("", tuple(end.tolist()), tuple(start.tolist()), arrowprops=arrow)
    # Matplotlib bends an arrow as a parabola towards this point.
    way = end - start
    towards = (start + end) / 2 + bend * np.array([way[1], -way[0]])
    rest = 1 - along
    x, y = (rest**2 * start + 2 * rest * along * towards + along**2 * end).tolist()
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1}
    axes.text(x, y, text, color=ACCENT, fontsize=8, ha="center", va="center", bbox=box)
