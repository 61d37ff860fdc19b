"""`mjxgait plot`: all plots of a run."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import tyro

from mjxgait.cli.options import parsed


@dataclasses.dataclass(frozen=True)
class PlotOptions:
    """Draw all plots of a run.

    Fitness, terms and diversity over generations; footfalls, joints, trunk and a filmstrip of its
    champion.

    Attributes:
      run: Run folder.
      out: Folder for the plots; by default RUN/plots.
      formats: File formats.
    """

    run: tyro.conf.Positional[Path]
    out: Path | None = None
    formats: tuple[Literal["png", "svg"], ...] = ("png", "svg")


def plot_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(PlotOptions, "plot", arguments)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    from mjxgait.rendering.plots import plot_run

    for file in plot_run(options.run, options.out, options.formats):
        print(file)
    return 0
