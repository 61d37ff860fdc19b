"""Comparisons of samples of runs with error bars. Values: [S], one per seed; higher is better.

Follows Agarwal et al. 2021, "Deep reinforcement learning at the edge of the statistical precipice":
interquartile means, intervals instead of points, probability of improvement. Random draws use a
fixed seed: equal values give equal numbers.
"""

import dataclasses
import warnings
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from scipy import stats
from scipy.stats import DegenerateDataWarning

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
