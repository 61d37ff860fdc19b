"""Poster of a champion's family: each body that its line had, along the generations.

The line follows the mothers. A father stands above the child that has a part of it.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mjxgait.champion import Champion
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.files import replaced, require_ending, writing
from mjxgait.inspect.family import Birth, Family, Relative, Step, body_changes
from mjxgait.inspect.snapshot import read_snapshot
from mjxgait.rendering.curves import ACCENT, DARK, MIDDLE, PALE, figure, titled
from mjxgait.rendering.genomes import SIZE, STANDING, place_in
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import open_champion, open_run, require_output
from mjxgait.training.logs import Line

COLUMNS, WIDTH, GAP = 6, 2.2, 0.16
"""Pictures in a row; width of each, and of the gap that it includes, in inches."""
TALL, TEXT, ABOVE, AXIS, HEAD = 1.53, 0.7, 1.25, 1.6, 0.55
"""Heights in inches of a picture, the text below, a father above, the axis and the title."""
MAX_BODIES = 48
"""Largest number of pictures; of a longer line the latest are shown, and the first."""


def draw_family_tree(run: Path, out: Path) -> None:
    """Write the poster of a run's champion as a PNG.

    Raises:
      UserError: no run, no champion, another kind of body, no record of births, or the file has
        another ending or cannot be written.
    """
    require_ending(out, (".png",))
    require_output(out)
    creature, config = open_run(run)
    champion = open_champion(run)[1]
    if not isinstance(champion.settings, BrainConfig):
        raise UserError(f"{run}: no family tree: its body does not grow; only bodies of blocks do")
    latest = read_snapshot(run)
    births = Family(run, latest.lines).line(latest.generation, place_in(latest, champion))
    steps = body_changes(births, champion.settings.parts, champion.settings.links)
    tree = Tree(creature, champion, births, _fitting(steps), len(steps))
    subject = f"{creature.title}, {champion.task}, seed {config.seed}"
    with figure(tree.size) as drawing:
        drawing.set_layout_engine("none")
        tree.draw(drawing, latest.lines, subject)
        with writing(out), replaced(out) as beside:
            drawing.savefig(beside)


def _fitting(steps: Sequence[Step]) -> list[Step]:
    """Return the first and the latest changes, as many as are shown."""
    return [*steps] if len(steps) <= MAX_BODIES else [steps[0], *steps[1 - MAX_BODIES :]]


@dataclasses.dataclass(frozen=True, eq=False)
class Tree:
    """Bodies of a champion's line. steps: those shown, out of `count` in all."""

    creature: Creature
    champion: Champion
    births: Sequence[Birth]
    steps: Sequence[Step]
    count: int

    @property
    def rows(self) -> list[Sequence[Step]]:
        """Pictures by row."""
        return [self.steps[i : i + COLUMNS] for i in range(0, len(self.steps), COLUMNS)]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in inches."""
        columns = max(min(len(self.steps), COLUMNS), 3)
        return WIDTH * columns, HEAD + sum(map(_height, self.rows)) + AXIS

    def draw(self, drawing: Figure, lines: Sequence[Line], subject: str) -> None:
        """Draw title, pictures and axis. lines: of the run's log."""
        width, height = self.size
        shown = f"{self.count} bodies" if self.count > 1 else "one body"
        if self.count > len(self.steps):
            shown += f", the first and the latest {len(self.steps) - 1} shown"
        said = f"Family of the champion, mother by mother: {shown}"
        at = 1 - 0.1 / height
        drawing.text(0.1 / width, at, titled(subject, said), fontsize=11, va="top")
        top, number = height - HEAD, 0
        for row in self.rows:
            for column, step in enumerate(row):
                number += 1
                place = (column * WIDTH, top - _height(row))
                self._draw_step(drawing, step, number, place, bool(column))
            top -= _height(row)
        box = (0.75 / width, 0.45 / height, 1 - 0.9 / width, (AXIS - 0.75) / height)
        _draw_axis(drawing.add_axes(box), self.births, self.steps, lines)

    def _draw_step(
        self, drawing: Figure, step: Step, number: int, place: tuple[float, float], follows: bool
    ) -> None:
        """Draw a body with what made it, and its father. place: [2] lower left corner in inches.

        follows: whether its mother's body is on its left.
        """
        (x, y), (width, height), birth = place, self.size, step.birth
        wide = WIDTH - GAP
        box = ((x + GAP / 2) / width, (y + TEXT) / height, wide / width, TALL / height)
        axes = self._picture(drawing, birth.child, box)
        axes.text(0.04, 0.96, str(number), transform=axes.transAxes, va="top", color=ACCENT)
        said = (
            f"generation {birth.child.generation}: {birth.operator}\n{step.change}\n"
            f"fitness {birth.child.fitness:.3g}"
        )
        middle = (x + WIDTH / 2) / width
        drawing.text(middle, (y + TEXT) / height, said, fontsize=8, ha="center", va="top")
        if follows:
            _arrow(axes, (-0.09, 0.5), (0.05, 0.5))
        if birth.father is not None:
            self._draw_father(drawing, birth.father, (x, y + TEXT + TALL))
            _arrow(axes, (0.5, 1.1), (0.5, 0.95))

    def _draw_father(self, drawing: Figure, father: Relative, place: tuple[float, float]) -> None:
        """Draw a father above its child. place: [2] lower left corner in inches."""
        (x, y), (width, height), share = place, self.size, 0.55
        tall = share * TALL
        box = (
            (x + (1 - share) / 2 * WIDTH) / width,
            (y + 0.12) / height,
            share * WIDTH / width,
            tall / height,
        )
        self._picture(drawing, father, box)
        said = f"father, generation {father.generation}, {father.fitness:.3g}"
        middle = (x + WIDTH / 2) / width
        drawing.text(
            middle, (y + 0.15 + tall) / height, said, fontsize=7, color=MIDDLE, ha="center"
        )

    def _picture(
        self, drawing: Figure, one: Relative, box: tuple[float, float, float, float]
    ) -> Axes:
        axes = drawing.add_axes(box)
        axes.imshow(picture_of(self.creature, self.champion, one), interpolation="lanczos")
        axes.set_axis_off()
        return axes


def picture_of(creature: Creature, champion: Champion, one: Relative) -> np.ndarray:
    """Return a picture [height, width, 3] of a relative's body at rest.

    Its brain is not recorded; the champion's takes its place, which a body at rest does not show.
    """
    # An opponent's body is none of the family.
    own = {n: array for n, array in champion.genome.items() if not n.startswith("opponent.")}
    task = champion.task if len(own) == len(champion.genome) else "roam"
    made = dataclasses.replace(champion, genome=own | dict(one.body), task=task)
    walk = record_walk(made.embodied(creature), made, STANDING)
    return np.asarray(Stage([walk], *SIZE).picture(0))


def _height(row: Sequence[Step]) -> float:
    """Height of a row in inches; a row with a father is taller."""
    return TALL + TEXT + ABOVE * any(step.birth.father is not None for step in row)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Draw an arrow between places in units of the axes."""
    look = {"arrowstyle": "-|>", "color": MIDDLE, "linewidth": 1.0}
    axes.annotate("", end, start, xycoords="axes fraction", arrowprops=look, annotation_clip=False)


def _draw_axis(
    axes: Axes, births: Sequence[Birth], steps: Sequence[Step], lines: Sequence[Line]
) -> None:
    """Draw the generations: the best fitness of each, that of the line, and the numbered bodies."""
    best = [(line["generation"], line["best"]) for line in lines if line["best"] is not None]
    axes.plot(*np.transpose(best), color=PALE, linewidth=3, label="best of all")
    last = max(generation for generation, _ in best)
    time = [birth.child.generation for birth in births]
    axes.step(
        [*time, last],
        [*(birth.child.fitness for birth in births), births[-1].child.fitness],
        where="post",
        color=DARK,
        linewidth=1,
        label="the line",
    )
    for number, step in enumerate(steps, 1):
        at = step.birth.child.generation, step.birth.child.fitness
        axes.plot(*at, "o", color=ACCENT, markersize=4)
        axes.annotate(str(number), at, (0, 5), textcoords="offset points", fontsize=7, ha="center")
    axes.set(xlabel="generation", ylabel="fitness", xlim=(-0.5, last + 0.5))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.margins(y=0.2)
    axes.legend(loc="lower right", fontsize=7)
