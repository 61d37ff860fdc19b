"""`mjxgait plot`: all plots of a run."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import tyro

from mjxgait.cli.options import parsed
from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True)
class PlotOptions:
    """Draw all plots of a run.

    Fitness, terms and diversity over generations; footfalls, joints, trunk and a filmstrip of its
    champion.

    Attributes:
      run: Run folder.
      out: Folder for the plots; by default RUN/plots.
      formats: File formats.
      family_tree: PNG file for the champion's family instead of the plots: each body that its
        ancestors had, by generation. For bodies of blocks.
    """

    run: tyro.conf.Positional[Path]
    out: Path | None = None
    formats: tuple[Literal["png", "svg"], ...] = ("png", "svg")
    family_tree: Path | None = None


def plot_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(PlotOptions, "plot", arguments)
    if not options.formats:
        raise UserError("--formats: give png, svg or both")
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    if options.family_tree is not None:
        from mjxgait.rendering.family import draw_family_tree

        draw_family_tree(options.run, options.family_tree)
        print(options.family_tree)
        return 0
    from mjxgait.rendering.plots import plot_run

    for file in plot_run(options.run, options.out, options.formats):
        print(file)
    return 0
