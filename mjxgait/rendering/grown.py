"""Plots of grown bodies: the graph beside the body that grows from it, and its ancestors."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mjxgait.champion import Champion
from mjxgait.controllers.sims_brain.reference_body.parts import Part, grow
from mjxgait.inspect.snapshot import Snapshot, read_snapshot
from mjxgait.rendering.cast import in_generations
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.style import ACCENT, DARK, MIDDLE
from mjxgait.rendering.video import Runner
from mjxgait.rendering.walk import Walk
from mjxgait.training.lineage import mothers_line

STANDING = 0.1
"""Simulated seconds; only the first moment is shown."""
SIZE = (480, 360)
"""Pixels of a body's picture."""
MOST = 8
"""Largest number of bodies in a row."""
COPIES = ("", "\nmirrored", "\na pair")
ALONG = (0.6, 0.45, 0.3)
"""Positions of labels along arrows, as fractions: labels of one node's arrows must not overlap."""


def draw_graph(drawing: Figure, walk: Walk) -> None:
    """Draw the nodes and connections that grow, and the body."""
    graph, body = drawing.subplots(1, 2)
    settings: Any = walk.champion.settings
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
    line = mothers_line(latest.lines, latest.generation, _place(latest, champion))
    descend = len(line) > 1
    places = line if descend else dict.fromkeys(latest.generations, 0)
    known = [generation for generation in latest.generations if generation in places]
    chosen = np.linspace(0, len(known) - 1, min(len(known), MOST)).round().astype(int)
    shown = {known[i]: places[known[i]] for i in np.unique(chosen)}
    return Row(in_generations(run, shown, STANDING), descend)


def draw_bodies(drawing: Figure, row: Row) -> None:
    """Draw the bodies in a row, each at its own scale."""
    fields = drawing.subplots(1, len(row.bodies), squeeze=False)[0]
    for axes, body in zip(fields, row.bodies, strict=True):
        axes.imshow(Stage([body.walk], *SIZE).picture(0), interpolation="lanczos")
        axes.set_axis_off()
        axes.set_title(body.label, fontsize=9)
    said = "The champion and its ancestors, mother by mother"
    if not row.descend:
        said = "The best of each generation that was kept; one need not descend from the one before"
    drawing.suptitle(said, fontsize=10)


def _place(population: Snapshot, champion: Champion) -> int:
    """Champion's place in the population; 0, the best, if it is absent."""
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
