"""All plots of a run, as PNG and SVG; called by the end of training and by `mjxgait plot`."""

from collections.abc import Callable, Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from mjxgait.config.schema import Config
from mjxgait.controllers.sims_brain.reference import BrainReference
from mjxgait.controllers.sims_brain.reference_body import IN_LIGHT
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.plugins.registry import task_of
from mjxgait.reference.controllers import reference_of
from mjxgait.rendering import brain, filmstrip, genomes
from mjxgait.rendering.brain import network_of
from mjxgait.rendering.curves import FORMATS, Figures, Lines, figure, progress_figures, save
from mjxgait.rendering.filmstrip import draw_filmstrip
from mjxgait.rendering.gaitplots import gait_figures, subject_of
from mjxgait.rendering.video import LOOP_SECONDS, champion_of
from mjxgait.rendering.walk import Walk
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import CHAMPION, METRICS, PLOTS, command, open_run
from mjxgait.training.lock import why_empty
from mjxgait.training.logs import read_metrics


def plot_run(run: Path, out: Path | None = None, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write every plot that the run has data for into RUN/plots (or `out`); return the files.

    Raises:
      UserError: not a run folder, nothing to plot yet, or the folder cannot be written.
    """
    creature, config = open_run(run)
    lines = read_metrics(run / METRICS)
    if not lines:
        raise UserError(f"{run}: nothing to plot; {why_empty(run)}")
    out = out or run / PLOTS
    with disk_errors(out, "the run itself is safe", "draw again"):
        out.mkdir(parents=True, exist_ok=True)
    walk = champion_of(run, LOOP_SECONDS).walk if (run / CHAMPION).exists() else None
    subject = subject_of(walk) if walk else f"{creature.title}, seed {config.seed}"
    figures = dict(progress_figures(lines, _weights(creature, config, lines), subject))
    if walk is not None:
        figures |= _of_champion(run, walk)
    files = []
    with disk_errors(
        out, "the run itself is safe", f"draw it with {command('plot', run, run=run)}"
    ):
        for name, (size, compose) in figures.items():
            with figure(size) as drawing:
                compose(drawing)
                files += save(drawing, out / name, formats)
    return files


def _of_champion(run: Path, walk: Walk) -> Figures:
    """Plots of the champion and its walk."""
    strip: Figures = {"filmstrip": ((12, 4.8), lambda drawing: draw_filmstrip(drawing, walk))}
    others = {**_of_goals(walk), **_of_programs(walk), **_of_grown(run, walk)}
    return {**gait_figures(walk), **strip, **others}


def _headed(walk: Walk, compose: Callable[[Figure], None]) -> Callable[[Figure], None]:
    """Return a drawing function that writes the walk's subject above all."""

    def draw(drawing: Figure) -> None:
        drawing.suptitle(subject_of(walk), fontsize=11, x=0.01, ha="left")
        compose(drawing)

    return draw


def _of_goals(walk: Walk) -> Figures:
    """Onion-skin picture of the way to a goal or under a bar; empty without one."""
    if walk.marked is None:
        return {}
    picture = filmstrip.strobe(walk)
    shape = filmstrip.strobe_shape(picture)
    return {"strobe": (shape, lambda drawing: filmstrip.draw_strobe(drawing, walk, picture))}


def _of_programs(walk: Walk) -> Figures:
    """Trees of the champion's expressions; empty if it has none."""
    if walk.champion.controller != "program":
        return {}
    found = genomes.expressions_of(walk.creature, walk.champion)
    draw = _headed(walk, lambda drawing: genomes.draw_trees(drawing, found))
    return {"expressions": (genomes.shape(found), draw)}


def _of_grown(run: Path, walk: Walk) -> Figures:
    """Graph and body, brain, and ancestors; empty unless the body grew from a graph."""
    if "graph.half" not in walk.champion.genome:
        return {}
    row = genomes.bodies_of(run, walk.champion)
    reference = reference_of(walk.creature, walk.champion, walk.time_step)
    assert isinstance(reference, BrainReference)
    thoughts = network_of(reference, walk.champion.task in IN_LIGHT)
    return {
        "graph": ((10, 4.8), _headed(walk, lambda drawing: genomes.draw_graph(drawing, walk))),
        "brain": (
            brain.shape(thoughts),
            _headed(walk, lambda drawing: brain.draw_brain(drawing, thoughts)),
        ),
        "bodies": (
            (2.2 * max(len(row.bodies), 2), 2.6),
            lambda drawing: genomes.draw_bodies(drawing, row, subject_of(walk)),
        ),
    }


def _weights(creature: Creature, config: Config, lines: Lines) -> dict[str, np.ndarray]:
    """Signed weight [generations] of each term of the run's task."""
    task = task_of(creature, config)
    rows = [task.weights(config.fitness, jnp.int32(line["generation"])) for line in lines]
    return {name: np.array([float(row[name]) for row in rows]) for name in task.terms}
