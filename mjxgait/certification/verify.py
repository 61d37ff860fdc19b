"""Comparison of a stored certificate with a new examination of the same champion."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mjxgait.certification.criteria import Criterion, Measure
from mjxgait.certification.verdict import criteria_of, judged

TOLERANCE = 1e-6
"""Allowed difference of a measure, relative to its size, or absolute below 1.

On one machine with the same versions of MuJoCo and NumPy nothing differs.
"""


def differences(stored: Mapping[str, Any], again: Mapping[str, Any]) -> list[str]:
    """Return the differences between a stored certificate and a new one, a phrase each.

    Seconds, attempts and numbers without a criterion do not count.
    """
    named = {key: (stored.get(key), again[key]) for key in ("champion", "creature_digest", "task")}
    named["ground"] = (stored.get("report", {}).get("ground"), again["report"]["ground"])
    found = [f"{key}: {one}, again {two}" for key, (one, two) in named.items() if one != two]
    found += _measures(criteria_of(stored), criteria_of(again))
    if said := judged(stored).contradiction:
        found.append(said)
    return found


def _measures(stored: Sequence[Criterion], again: Sequence[Criterion]) -> Iterator[str]:
    one, two = _by_name(stored), _by_name(again)
    for name in [*one, *(name for name in two if name not in one)]:
        if name not in two:
            yield f"{name}: is no measure of this examination"
        elif name not in one:
            yield f"{name}: is missing"
        elif not _same(one[name], two[name]):
            yield f"{name}: {_shown(one[name])}, again {_shown(two[name])}"


def _by_name(criteria: Sequence[Criterion]) -> dict[str, Measure]:
    return {f"{c.number} {c.name}, {m.name}": m for c in criteria for m in c.measures}


def _same(one: Measure, two: Measure) -> bool:
    if one.sense != two.sense:
        return False
    pairs = (one.value, two.value), (one.threshold, two.threshold)
    return all(np.isclose(a, b, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True) for a, b in pairs)


def _shown(measure: Measure) -> str:
    return f"{measure.value:.9g} {measure.sense} {measure.threshold:g}"
