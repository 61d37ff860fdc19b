"""Plots of a run over its generations, in the style of all plots.

`lines` are those of `metrics.jsonl`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator, PercentFormatter

from mjxgait.certification.stress import Stress
from mjxgait.files import replaced
from mjxgait.training.logs import Line, columns

matplotlib.use("Agg")


Figures = Mapping[str, tuple[tuple[float, float], Callable[[Figure], None]]]
"""Size in inches and drawing function by file name."""
FORMATS = ("png", "svg")
SETTINGS = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "hatch.linewidth": 0.5,
    "savefig.dpi": 120,
    "svg.hashsalt": "mjxgait",
}
DARK, MIDDLE, PALE = "0.1", "0.45", "0.85"
ACCENT = "tab:orange"


@contextmanager
def figure(size: tuple[float, float]) -> Iterator[Figure]:
    """Yield an empty figure of this size in inches, and close it at the end."""
    with plt.rc_context(SETTINGS):
        drawing = plt.figure(figsize=size, layout="constrained")
        try:
            yield drawing
        finally:
            plt.close(drawing)


def save(drawing: Figure, path: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write the figure once per format. path: without a suffix."""
    files = [path.with_name(f"{path.name}.{kind}") for kind in formats]
    for file in files:
        # Without a date, equal plots are equal files.
        with replaced(file) as beside:
            drawing.savefig(beside, metadata={"Date": None} if file.suffix == ".svg" else None)
    return files


def titled(subject: str, what: str) -> str:
    """Return a title: what a plot is of on a line of its own, where that is given."""
    return f"{subject}\n{what}" if subject else what


Lines = Sequence[Line]
MAIN_TERMS = 7
"""Terms drawn one by one; the others are summed."""
GREYS = ("0.25", "0.62", "0.82", "0.45", "0.92", "0.72", "0.35", "0.98")
HATCHES = ("", "///", "", "...", "\\\\\\", "xxx", "---", "")


def plot_fitness(lines: Lines, path: Path, subject: str = "") -> None:
    """Write the fitness curve of a run folder as one PNG. subject: see `titled`."""
    with figure((8, 4.5)) as drawing:
        draw_fitness(drawing.subplots(), lines, subject)
        with replaced(path) as beside:
            drawing.savefig(beside)


def draw_fitness(axes: Axes, lines: Lines, subject: str = "") -> None:
    """Draw best, mean and any logged quartiles; forced phases are shaded."""
    column = columns(lines)
    generation = column["generation"]
    lower, upper = column["lower_quartile"], column["upper_quartile"]
    if np.isfinite(lower).any():
        axes.fill_between(generation, lower, upper, color=PALE, label="middle half")
    axes.plot(generation, column["best"], "-", color=DARK, linewidth=2, label="best")
    axes.plot(generation, column["mean"], "--", color=DARK, linewidth=1.2, label="mean")
    shade_forced(axes, column)
    axes.set(
        ylabel="fitness (higher is better)", title=titled(subject, "fitness of the population")
    )
    _label_generations(axes, generation)
    axes.legend(loc="best")


def draw_terms(
    axes: Axes, lines: Lines, weights: Mapping[str, np.ndarray], subject: str = ""
) -> None:
    """Draw each term's contribution to the best individual's fitness, losses below zero.

    weights: signed, one array [generations] per term.
    """
    column = columns(lines)
    generation = column["generation"]
    logged = {name: weight for name, weight in weights.items() if f"term_{name}" in column}
    given = {
        name: np.nan_to_num(weight * column[f"term_{name}"]) for name, weight in logged.items()
    }
    order = sorted(
        (name for name in given if np.abs(given[name]).max() > 1e-3),
        key=lambda name: -np.abs(given[name]).sum(),
    )
    main, others = order[:MAIN_TERMS], order[MAIN_TERMS:]
    parts = {name: given[name] for name in main}
    if others:
        parts[f"{len(others)} others"] = np.sum([given[name] for name in others], axis=0)
    above, below = np.zeros(len(generation)), np.zeros(len(generation))
    for (name, value), grey, hatch in zip(parts.items(), GREYS, HATCHES, strict=False):
        gain, loss = np.maximum(value, 0), np.minimum(value, 0)
        label = name.replace("_", " ")
        for base, part in ((above, gain), (below, loss)):
            if part.any():
                axes.fill_between(
                    generation,
                    base,
                    base + part,
                    facecolor=grey,
                    hatch=hatch,
                    edgecolor="0.15",
                    linewidth=0.4,
                    label=label,
                )
                label = "_"
        above, below = above + gain, below + loss
    outline = [withStroke(linewidth=5, foreground="white")]
    axes.plot(generation, above + below, color=DARK, linewidth=2, label="sum", path_effects=outline)
    axes.axhline(0, color=DARK, linewidth=0.8)
    what = "what the terms give to the best individual (mean of its starts)"
    axes.set(ylabel="weight times term", title=titled(subject, what))
    _label_generations(axes, generation)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))


def draw_diversity(axes: Axes, lines: Lines, subject: str = "") -> None:
    """Draw the share of different genomes and the mean spread of a gene."""
    column = columns(lines)
    generation = column["generation"]
    population = max(float(np.nanmax(column["unique"])), 1.0)
    axes.plot(
        generation,
        column["unique"] / population,
        "-",
        color=DARK,
        linewidth=2,
        label="different genomes (left)",
    )
    shade_forced(axes, column)
    title = titled(subject, "diversity")
    axes.set(ylabel="share of the population", ylim=(0, 1.05), title=title)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    spread = axes.twinx()
    spread.plot(
        generation,
        column["spread"],
        "--",
        color=MIDDLE,
        linewidth=1.6,
        label="spread of a gene (right)",
    )
    spread.set(ylabel="mean standard deviation")
    spread.set_ylim(bottom=0)
    spread.grid(False)
    spread.spines["right"].set_visible(True)
    _label_generations(axes, generation)
    handles = [part for each in (axes, spread) for part in each.get_legend_handles_labels()[0]]
    axes.legend(handles=handles, loc="lower left")


def draw_size(axes: Axes, lines: Lines, subject: str = "") -> None:
    """Draw the number of nodes in all expressions of an individual: best and mean."""
    column = columns(lines)
    generation = column["generation"]
    axes.plot(generation, column["nodes_best"], "-", color=DARK, linewidth=2, label="best")
    axes.plot(generation, column["nodes_mean"], "--", color=DARK, linewidth=1.2, label="mean")
    shade_forced(axes, column)
    axes.set(ylabel="nodes of all expressions", title=titled(subject, "size of the programs"))
    axes.set_ylim(bottom=0)
    _label_generations(axes, generation)
    axes.legend(loc="best")


def progress_figures(lines: Lines, weights: Mapping[str, np.ndarray], subject: str = "") -> Figures:
    """Return the plots of this file by file name. subject: see `titled`."""
    size: Figures = {
        "size": ((8, 3.7), lambda drawing: draw_size(drawing.subplots(), lines, subject))
    }
    return {
        "fitness": ((8, 4.7), lambda drawing: draw_fitness(drawing.subplots(), lines, subject)),
        "terms": (
            (9.5, 4.7),
            lambda drawing: draw_terms(drawing.subplots(), lines, weights, subject),
        ),
        "diversity": ((8, 3.7), lambda drawing: draw_diversity(drawing.subplots(), lines, subject)),
        **(size if "nodes_mean" in lines[0] else {}),
    }


def shade_forced(axes: Axes, column: Mapping[str, np.ndarray]) -> None:
    """Shade the forced generations."""
    for i, at in enumerate(column["generation"][column["forced"] == 1]):
        label = "_" if i else "forced evolution"
        axes.axvspan(
            at - 0.5,
            at + 0.5,
            facecolor=ACCENT,
            alpha=0.25,
            hatch="//",
            edgecolor="0.5",
            linewidth=0,
            label=label,
        )


def _label_generations(axes: Axes, generation: np.ndarray) -> None:
    axes.set_xlabel("generation")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(generation[0] - 0.5, max(generation[-1], generation[0] + 1) + 0.5)


def draw_stress(drawing: Figure, found: Stress, subject: str = "") -> None:
    """Draw the share of starts that passed each trial; dark if enough. subject: see `titled`."""
    axes = drawing.add_subplot()
    names = [trial.name for trial in found.trials]
    shares = [trial.share for trial in found.trials]
    colours = [DARK if trial.passed else PALE for trial in found.trials]
    bars = axes.barh(names, shares, color=colours, edgecolor=DARK)
    axes.bar_label(bars, [f"{share:.0%}" for share in shares], padding=3)
    axes.axvline(found.config.share, color=DARK, linestyle=":")
    axes.set(xlim=(0, 1.12), xlabel=f"share of {found.config.starts} starts")
    axes.invert_yaxis()
    axes.set_title(titled(subject, found.verdict.removesuffix(".")))
