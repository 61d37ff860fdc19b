"""Plot of a walk's stress tests: a bar per trial."""

from matplotlib.figure import Figure

from mjxgait.certification.stress import Stress
from mjxgait.rendering.style import DARK, PALE


def draw_stress(drawing: Figure, found: Stress) -> None:
    """Draw the share of starts that passed each trial; dark if sufficient."""
    axes = drawing.add_subplot()
    names = [trial.name for trial in found.trials]
    shares = [trial.share for trial in found.trials]
    colours = [DARK if trial.passed else PALE for trial in found.trials]
    bars = axes.barh(names, shares, color=colours, edgecolor=DARK)
    axes.bar_label(bars, [f"{share:.0%}" for share in shares], padding=3)
    axes.axvline(found.config.share, color=DARK, linestyle=":")
    axes.set(xlim=(0, 1.12), xlabel=f"share of {found.config.starts} starts")
    axes.invert_yaxis()
    axes.set_title("It walks anywhere" if found.passed else "It does not walk anywhere yet")
