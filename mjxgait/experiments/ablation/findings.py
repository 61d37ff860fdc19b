"""Findings of a study: comparisons with error bars, and their pictures.

Follows Agarwal et al. 2021, "Deep reinforcement learning at the edge of the statistical precipice":
interquartile means, intervals instead of points, probability of improvement. Random draws use a
fixed seed: equal values give equal numbers.
"""

import dataclasses
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from scipy import stats
from scipy.stats import DegenerateDataWarning, trim_mean

from mjxgait.experiments.ablation.measures import Result
from mjxgait.experiments.ablation.plan import Plan
from mjxgait.files import replaced
from mjxgait.rendering.curves import ACCENT, DARK, figure
from mjxgait.training.logs import Line

RESAMPLES = 9999
TRIM = 0.25
"""Share cut off at either end, for the interquartile mean.

0 gives the mean, which a share of successes needs.
"""
CONFIDENCE = 0.95


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Comparison of a variant with the base.

    difference: of trimmed means. improvement: probability that a run of the variant beats one of
    the base.
    p: of a permutation test of the difference. corrected: p after Holm's correction for all
    comparisons of the study.
    """

    difference: Estimate
    improvement: Estimate
    p: float
    corrected: float


def trimmed_mean(values: np.ndarray, trim: float = TRIM, axis: int = -1) -> np.ndarray:
    """Return the mean without the ends; by default of the middle half."""
    return np.asarray(stats.trim_mean(values, trim, axis=axis))


def estimate(values: np.ndarray, trim: float = TRIM) -> Estimate:
    """Return the trimmed mean with its BCa interval.

    BCa: bias-corrected and accelerated bootstrap (Efron 1987).
    """
    return _bootstrap((values,), partial(trimmed_mean, trim=trim), paired=False)


def compare(
    base: np.ndarray, variants: Sequence[np.ndarray], paired: bool, trim: float = TRIM
) -> list[Comparison]:
    """Compare each variant with the base.

    paired: whether the i-th values of both come from the same seed.
    """
    gap = partial(_gap, trim=trim)
    rows = [
        (
            _bootstrap((base, values), gap, paired),
            improvement(base, values, paired),
            permutation_p(base, values, paired, trim),
        )
        for values in variants
    ]
    corrected = holm([p for *_, p in rows])
    return [Comparison(*row, after) for row, after in zip(rows, corrected, strict=True)]


def improvement(base: np.ndarray, values: np.ndarray, paired: bool = False) -> Estimate:
    """Return the probability that a run of the variant beats one of the base.

    Ties count half (Mann & Whitney's U over all pairs).
    """

    def better(a: np.ndarray, b: np.ndarray, axis: int = -1) -> np.ndarray:
        a, b = np.moveaxis(a, axis, -1), np.moveaxis(b, axis, -1)
        sign = np.sign(b[..., None, :] - a[..., :, None])
        return np.asarray(0.5 + 0.5 * sign.mean(axis=(-1, -2)))

    return _bootstrap((base, values), better, paired)


def permutation_p(base: np.ndarray, values: np.ndarray, paired: bool, trim: float = TRIM) -> float:
    """Return the probability of so large a difference, of either sign, without an effect.

    Labels are swapped within seeds; if unpaired, freely.
    """
    kind = "samples" if paired else "independent"
    rng = np.random.default_rng(0)
    gap = partial(_gap, trim=trim)
    result = stats.permutation_test(
        (base, values), gap, permutation_type=kind, vectorized=True, n_resamples=RESAMPLES, rng=rng
    )
    return float(result.pvalue)


def holm(ps: Sequence[float]) -> list[float]:
    """Return p values corrected for their number (Holm 1979)."""
    order = np.argsort(ps, kind="stable")
    scaled = [min(1.0, (len(ps) - rank) * ps[i]) for rank, i in enumerate(order)]
    corrected = np.empty(len(ps))
    corrected[order] = np.maximum.accumulate(scaled) if len(ps) else []
    return [float(p) for p in corrected]


def share(successes: int, count: int) -> Estimate:
    """Return a share with its Wilson score interval (Wilson 1927)."""
    interval = stats.binomtest(successes, count).proportion_ci(CONFIDENCE, method="wilson")
    return Estimate(successes / count, float(interval.low), float(interval.high))


def _gap(base: np.ndarray, values: np.ndarray, trim: float, axis: int = -1) -> np.ndarray:
    return trimmed_mean(values, trim, axis) - trimmed_mean(base, trim, axis)


def _bootstrap(
    samples: tuple[np.ndarray, ...], statistic: Callable[..., np.ndarray], paired: bool
) -> Estimate:
    """Return a statistic with its BCa interval, or percentiles if undefined (many equal values)."""
    value = float(statistic(*samples, axis=-1))
    for method in ("BCa", "percentile"):
        with (
            np.errstate(all="ignore"),
            warnings.catch_warnings(action="ignore", category=DegenerateDataWarning),
        ):
            found = stats.bootstrap(
                samples,
                statistic,
                vectorized=True,
                paired=paired,
                n_resamples=RESAMPLES,
                confidence_level=CONFIDENCE,
                method=method,
                rng=np.random.default_rng(0),
                batch=500,
            ).confidence_interval
        if np.isfinite([found.low, found.high]).all():
            break
    return Estimate(value, float(found.low), float(found.high))


LOWER_IS_BETTER = ("generations",)


@dataclasses.dataclass(frozen=True)
class Finding:
    """A variant with its estimate and, for all but the base, its comparison with the base."""

    name: str
    values: np.ndarray
    estimate: Estimate
    comparison: Comparison | None


def find(plan: Plan, results: Sequence[Result]) -> list[Finding]:
    """Return a finding per variant by the study's measure, the base first."""
    measure = plan.study.measure
    sign = -1.0 if measure in LOWER_IS_BETTER else 1.0
    values = {
        name: np.array([r.value(measure) for r in results if r.variant == name])
        for name in plan.variants
    }
    base, *others = plan.variants
    trim = trim_of(measure)
    comparisons = compare(
        sign * values[base], [sign * values[name] for name in others], plan.study.paired, trim
    )
    return [
        Finding(name, values[name], estimate(values[name], trim), comparison)
        for name, comparison in zip(plan.variants, [None, *comparisons], strict=True)
    ]


def trim_of(measure: str) -> float:
    """Return the share to trim: 0 (the mean) for yes/no values, which have no middle half."""
    return 0.0 if measure == "certified" else TRIM


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


def draw_curves(plan: Plan, logs: Sequence[Line], path: Path) -> None:
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
