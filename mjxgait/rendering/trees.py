"""Expressions drawn as trees: one figure, a tree for each joint.

Leaves stand side by side, each parent in the middle of its children.
"""

import dataclasses
from collections.abc import Iterator, Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mjxgait.champion import Champion
from mjxgait.controllers.expressions.text import (
    ADDED,
    Expression,
    nested,
    terminals,
)
from mjxgait.creature import Creature
from mjxgait.rendering.style import (
    ACCENT,
    DARK,
    MIDDLE,
    PALE,
)

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
    known, genome = terminals(creature, tuple(ADDED.values())), champion.genome
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
