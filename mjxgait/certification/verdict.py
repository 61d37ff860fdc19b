"""The verdict of an examination, derived from measures and thresholds and from nothing else.

A stored certificate is judged as a new one is: what it says of its own verdict is only compared.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, Measure
from mjxgait.config.tables import flat
from mjxgait.kinds import known_task, tasks


@dataclasses.dataclass(frozen=True)
class Verdict:
    """What the criteria say.

    passed: whether there are criteria and all of them pass. margin: that of the worst measure.
    failed: the criteria that do not pass. other_rules: thresholds that differ from the shipped
    ones, a phrase each. contradiction: a sentence where the stored verdict is another one.
    """

    passed: bool
    margin: float
    failed: tuple[Criterion, ...] = ()
    other_rules: tuple[str, ...] = ()
    contradiction: str = ""

    @property
    def certified(self) -> bool:
        """Whether all criteria pass, by the shipped rules, and the file says nothing else."""
        return self.passed and not self.other_rules and not self.contradiction

    @property
    def numbers(self) -> list[int]:
        """Of the criteria that do not pass."""
        return [criterion.number for criterion in self.failed]

    @property
    def reservation(self) -> str:
        """Why it is no certificate though all criteria pass; empty where nothing is in the way."""
        if self.contradiction:
            return self.contradiction
        return f"by other rules: {', '.join(self.other_rules)}" if self.other_rules else ""

    def in_words(self) -> str:
        """A few words; of the criteria that fail two by name."""
        if self.passed:
            return self.reservation or "certified"
        if not self.failed:
            return "has no criteria"
        names, more = [c.name for c in self.failed[:2]], len(self.failed) - 2
        return f"fails {', '.join(names)}{f' and {more} more' if more > 0 else ''}"


def judge(criteria: Sequence[Criterion]) -> Verdict:
    """The verdict of these criteria; without any, nothing has passed."""
    failed = tuple(criterion for criterion in criteria if not criterion.passed)
    margin = min((criterion.margin for criterion in criteria), default=-np.inf)
    return Verdict(bool(criteria) and not failed, margin, failed)


def judged(document: Mapping[str, Any]) -> Verdict:
    """The verdict of a stored certificate; see `standing.read_certificate`."""
    verdict = judge(criteria_of(document))
    return dataclasses.replace(
        verdict,
        other_rules=tuple(other_rules(document)),
        contradiction=_contradiction(document, verdict),
    )


def criteria_of(document: Mapping[str, Any]) -> tuple[Criterion, ...]:
    """The criteria of a stored certificate, whatever it says of their verdicts."""
    return tuple(
        Criterion(c["number"], c.get("name", ""), tuple(map(_measure, c["measures"])))
        for c in document["criteria"]
    )


def other_rules(document: Mapping[str, Any]) -> Iterator[str]:
    """Each threshold of a stored certificate that is not the shipped one.

    Thresholds of other tasks do not count, nor those that an earlier version did not have.
    """
    if not isinstance(document.get("config"), Mapping):
        yield "thresholds that it does not state"
        return
    kind, own = known_task(document.get("task", "")), flat(document["config"])
    others = {table for one in tasks().values() for table in one.tables}
    others -= set(kind.tables if kind else ())
    for key, shipped in flat(dataclasses.asdict(CertificateConfig())).items():
        if key.split(".")[0] not in others and key in own and own[key] != shipped:
            yield f"{key} = {own[key]} instead of {shipped}"


def _contradiction(document: Mapping[str, Any], verdict: Verdict) -> str:
    """A sentence where a stored verdict is not that of its measures; else empty."""
    said = {c["number"]: c["passed"] for c in document["criteria"]}
    wrong = [c.number for c in criteria_of(document) if said[c.number] != c.passed]
    if document["passed"] == verdict.passed and not wrong:
        return ""
    stored = "passed" if document["passed"] else "failed"
    measured = "passed" if verdict.passed else "failed"
    if document["passed"] == verdict.passed:
        measured = f"otherwise of criteria {' '.join(map(str, wrong))}"
    return f"the file contradicts itself: it says {stored}, its measures say {measured}"


def _measure(entry: Mapping[str, Any]) -> Measure:
    value, threshold = _number(entry.get("value")), _number(entry.get("threshold"))
    sense = entry.get("sense")
    return Measure(
        str(entry.get("name", "")),
        value,
        sense if sense in (">=", "<=") else "<=",
        threshold,
        _room(entry, abs(value - threshold)),
    )


def _room(entry: Mapping[str, Any], distance: float) -> float:
    """Of a stored measure; of an earlier version's, which has none, by its margin."""
    if "room" in entry:
        return max(_number(entry["room"]), 0.0)
    margin = abs(_number(entry.get("margin")))
    return distance / margin if margin > 0 else 0.0


def _number(value: Any) -> float:
    """A number as JSON has it; NaN for all else."""
    return (
        float(value) if isinstance(value, int | float) and not isinstance(value, bool) else np.nan
    )
