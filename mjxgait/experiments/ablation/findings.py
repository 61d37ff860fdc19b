"""Findings of a study: each variant's estimate and its comparison with the base."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from mjxgait.experiments.ablation.measures import Result
from mjxgait.experiments.ablation.plan import Plan
from mjxgait.experiments.ablation.statistics import (
    TRIM,
    Comparison,
    Estimate,
    compare,
    estimate,
)

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
