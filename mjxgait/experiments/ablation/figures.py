"""Pictures of a study: each variant's estimate, and the curves over the generations."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import trim_mean

from mjxgait.experiments.ablation.findings import Finding
from mjxgait.experiments.ablation.plan import Plan
from mjxgait.files import replaced
from mjxgait.rendering.style import ACCENT, DARK, figure

LINES = ("-", "--", "-.", ":")


def draw_intervals(findings: Sequence[Finding], measure: str, path: Path) -> None:
    """Draw each run as a dot, the interquartile mean and interval; shade the base's interval."""
    with figure((8, 1.2 + 0.45 * len(findings))) as drawing:
        axes = drawing.subplots()
        base = findings[0].estimate
        axes.axvspan(base.low, base.high, color="0.92", label="interval of the base")
        for row, finding in enumerate(findings):
            axes.plot(
                finding.values,
                np.full(len(finding.values), row + 0.18),
                ".",
                color="0.6",
                markersize=4,
            )
            value = finding.estimate
            axes.plot([value.low, value.high], [row, row], "-", color=DARK, linewidth=2)
            axes.plot([value.value], [row], "o", color=ACCENT if row else DARK)
        axes.set_yticks(range(len(findings)), [finding.name for finding in findings])
        axes.invert_yaxis()
        axes.set(xlabel=measure, title="estimate with 95 % interval; dots are runs")
        with replaced(path) as beside:
            drawing.savefig(beside, metadata={"Software": None})


def draw_curves(plan: Plan, logs: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw each variant's best fitness: interquartile mean and middle half of the runs.

    A run without a finite best fitness counts as the worst.
    """
    with figure((8, 4.5)) as drawing:
        axes = drawing.subplots()
        shades = np.linspace(0.0, 0.65, len(plan.variants))
        for number, variant in enumerate(plan.variants):
            runs: dict[int, list[float]] = {}
            for line in logs:
                if line["variant"] == variant:
                    runs.setdefault(line["seed"], []).append(
                        -np.inf if line["best"] is None else line["best"]
                    )
            shortest = min(map(len, runs.values()))
            curves = np.array([curve[:shortest] for curve in runs.values()])
            low, high = np.percentile(curves, [25, 75], axis=0, method="nearest")
            shade = ACCENT if not number else str(shades[number])
            axes.fill_between(range(shortest), low, high, color=shade, alpha=0.12, linewidth=0)
            axes.plot(
                trim_mean(curves, 0.25, axis=0),
                LINES[number % len(LINES)],
                color=shade,
                label=variant,
            )
        axes.set(xlabel="generation", ylabel="best fitness (higher is better)")
        axes.legend(loc="best", fontsize=8)
        with replaced(path) as beside:
            drawing.savefig(beside, metadata={"Software": None})
