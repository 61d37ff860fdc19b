"""Result of an examination, derived only from measures and thresholds.

A stored certificate is evaluated like a new one: the result that it states is only compared.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NotRequired, Required, TypedDict, cast

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, Measure
from mjxgait.config.tables import flat
from mjxgait.errors import listed
from mjxgait.kinds import known_task, tasks


class MeasureEntry(TypedDict, total=False):
    """A measure in `certificate.json`; see `Measure`."""

    name: Required[str]
    value: Required[float | None]
    sense: Required[Literal[">=", "<="]]
    threshold: Required[float | None]
    passed: Required[bool]
    room: float | None
    margin: float | None


class CriterionEntry(TypedDict):
    """A criterion in `certificate.json`; see `Criterion`."""

    number: int
    name: NotRequired[str]
    passed: bool
    margin: NotRequired[float | None]
    measures: list[MeasureEntry]


class Document(TypedDict, total=False):
    """Content of `certificate.json`; see `Certificate`. Earlier versions lack some keys."""

    schema: int
    creature: str
    creature_digest: str
    task: str
    champion: str
    passed: Required[bool]
    margin: Required[float | None]
    attempts: int
    criteria: Required[list[CriterionEntry]]
    report: dict[str, Any]
    config: dict[str, object]
    seconds: float


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Result of all criteria.

    passed: True if there are criteria and all of them pass. margin: of the worst measure.
    failed: the criteria that do not pass. other_rules: thresholds that differ from the shipped
    ones, a phrase each. contradiction: a sentence if the stored result is another one.
    """

    passed: bool
    margin: float
    failed: tuple[Criterion, ...] = ()
    other_rules: tuple[str, ...] = ()
    contradiction: str = ""

    @property
    def certified(self) -> bool:
        """True if all criteria pass by the shipped rules and the file has no contradiction."""
        return self.passed and not self.other_rules and not self.contradiction

    @property
    def numbers(self) -> list[int]:
        """Numbers of the criteria that do not pass."""
        return [criterion.number for criterion in self.failed]

    @property
    def labels(self) -> list[str]:
        """Numbers of the criteria that do not pass, with the skill of a body with several."""
        return [f"{criterion.skill}{criterion.number}" for criterion in self.failed]

    @property
    def reservation(self) -> str:
        """Reason against a certificate although all criteria pass; empty if there is none."""
        if self.contradiction:
            return self.contradiction
        return f"by other rules: {', '.join(self.other_rules)}" if self.other_rules else ""

    def in_words(self) -> str:
        """Return the result in a few words, with at most two failed criteria by name."""
        if self.passed:
            return self.reservation or "certified"
        if not self.failed:
            return "has no criteria"
        return f"fails {listed([c.name for c in self.failed], 2)}"


def verdict_on(criteria: Sequence[Criterion]) -> Verdict:
    """Evaluate these criteria; without any, the result is not passed."""
    failed = tuple(criterion for criterion in criteria if not criterion.passed)
    margin = min((criterion.margin for criterion in criteria), default=-np.inf)
    return Verdict(bool(criteria) and not failed, margin, failed)


def verdict_of(certificate: Mapping[str, Any]) -> Verdict:
    """Evaluate a stored certificate, a `Document`; see `validity.read_certificate`."""
    document = cast(Document, certificate)
    verdict = verdict_on(criteria_of(document))
    return dataclasses.replace(
        verdict,
        other_rules=tuple(other_rules(document)),
        contradiction=_contradiction(document, verdict),
    )


def criteria_of(document: Document) -> tuple[Criterion, ...]:
    """Return the criteria of a stored certificate, without the results that it states."""
    return tuple(
        Criterion(c["number"], c.get("name", ""), tuple(map(_measure, c["measures"])))
        for c in document["criteria"]
    )


def other_rules(document: Document) -> Iterator[str]:
    """Yield each threshold of a stored certificate that is not the shipped one.

    Thresholds of other tasks do not count, nor those that an older certificate lacks.
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


def _contradiction(document: Document, verdict: Verdict) -> str:
    """Return a sentence if a stored result is not that of its measures; else empty."""
    pairs = zip(criteria_of(document), document["criteria"], strict=True)
    wrong = [f"{c.skill}{c.number}" for c, said in pairs if said["passed"] != c.passed]
    if document["passed"] == verdict.passed and not wrong:
        return ""
    stored = "passed" if document["passed"] else "failed"
    measured = "passed" if verdict.passed else "failed"
    if document["passed"] == verdict.passed:
        measured = f"otherwise of criteria {' '.join(wrong)}"
    return f"the file contradicts itself: it says {stored}, its measures say {measured}"


def _measure(entry: MeasureEntry) -> Measure:
    value, threshold = _number(entry.get("value")), _number(entry.get("threshold"))
    sense = entry.get("sense")
    return Measure(
        str(entry.get("name", "")),
        value,
        sense if sense in (">=", "<=") else "<=",
        threshold,
        _room(entry, abs(value - threshold)),
    )


def _room(entry: MeasureEntry, distance: float) -> float:
    """Room of a stored measure; derived from the margin in files of earlier versions."""
    if "room" in entry:
        return max(_number(entry["room"]), 0.0)
    margin = abs(_number(entry.get("margin")))
    return distance / margin if margin > 0 else 0.0


def _number(value: object) -> float:
    """Number from a JSON value; NaN for all else."""
    return (
        float(value) if isinstance(value, int | float) and not isinstance(value, bool) else np.nan
    )
