"""Readers of `certificate.json` and `stress.json`, and the check that they are of this champion."""

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict, cast

import numpy as np
import pydantic

from mjxgait.certification.certificate import schema_of
from mjxgait.certification.criteria import Criterion, Measure
from mjxgait.certification.stress import TRIALS, StressConfig
from mjxgait.certification.verdict import Document, criteria_of, verdict_of
from mjxgait.champion import Champion
from mjxgait.config.tables import STORED, Flag, Index, Number, Text, check
from mjxgait.creature import Creature
from mjxgait.creature.ground.spec import FLAT
from mjxgait.files import DamagedFile, read_json

_NAMES = {"certify": "a certificate", "stress": "what `mjxgait stress` writes"}
"""Names of the files in messages, by the command that writes each."""


@dataclasses.dataclass(frozen=True)
class _Measure:
    __pydantic_config__ = STORED
    name: Text
    value: Number | None
    sense: Text
    threshold: Number | None
    passed: Flag
    room: Number | None = None
    margin: Number | None = None


@dataclasses.dataclass(frozen=True)
class _Criterion:
    __pydantic_config__ = STORED
    number: Index
    passed: Flag
    measures: list[_Measure]
    name: Text = ""


@dataclasses.dataclass(frozen=True)
class _Report:
    """Part of a report that is read; each task has further keys."""

    __pydantic_config__ = STORED
    speed: Number | None = None
    gait: Text | None = None
    summary: Text = ""
    ground: Text = FLAT
    duty_factor: dict[str, Number | None] = dataclasses.field(default_factory=dict)
    likeness: dict[str, Number | None] = dataclasses.field(default_factory=dict)
    advice: list[Text] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True)
class _Certificate:
    __pydantic_config__ = STORED
    passed: Flag
    margin: Number | None
    criteria: list[_Criterion]
    report: _Report = dataclasses.field(default_factory=_Report)
    schema: Index = 0
    champion: Text = ""
    task: Text = ""
    config: dict[str, object] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.passed and self.margin is None:
            raise ValueError("what is passed has a margin")


@dataclasses.dataclass(frozen=True)
class _Trial:
    __pydantic_config__ = STORED
    name: Text
    share: Annotated[float, pydantic.Field(strict=True, ge=0, le=1)]
    passed: Flag


@dataclasses.dataclass(frozen=True)
class _Stress:
    __pydantic_config__ = STORED
    passed: Flag
    trials: list[_Trial]
    config: dict[str, float]
    champion: Text = ""


class TrialEntry(TypedDict):
    """A trial in `stress.json`; see `Trial`."""

    name: str
    share: float
    passed: bool


class StressDocument(TypedDict):
    """Content of `stress.json`, and what `read_stress` derives from it."""

    champion: str
    config: dict[str, float]
    trials: list[TrialEntry]
    passed: bool
    reservation: str


def read_certificate(path: Path) -> Document | None:
    """Read what `Certificate.to_json` wrote; None if there is no file.

    Raises:
      UserError: it is not a certificate.
    """
    return cast(Document | None, _read(path, _Certificate, "certify"))


def read_stress(path: Path, champion: Champion) -> StressDocument | None:
    """Read what `Stress.document` says of this champion; None without a file on this champion.

    `passed`, of each trial and of all, is derived from the shares by the shipped settings.
    `reservation`: why the trials do not count as the stress tests; empty if they do.

    Raises:
      UserError: it is no such file.
    """
    document = _read(path, _Stress, "stress")
    if not document or document.get("champion") != champion.fingerprint:
        return None
    shipped, given = dataclasses.asdict(StressConfig()), document["config"]
    other = [f"{key} = {given.get(key)}" for key in shipped if given.get(key) != shipped[key]]
    trials = [t | {"passed": t["share"] >= shipped["share"]} for t in document["trials"]]
    reservation = ""
    if other:
        reservation = f"its stress tests are by other settings: {', '.join(other)}"
    elif len(trials) < TRIALS and all(trial["passed"] for trial in trials):
        reservation = f"only {len(trials)} of {TRIALS} stress tests were run"
    passed = not reservation and all(trial["passed"] for trial in trials)
    found = document | {"trials": trials, "reservation": reservation, "passed": passed}
    return cast(StressDocument, found)


def stress_in_words(document: StressDocument) -> str:
    """Return a sentence on whether the champion walks anywhere, and what it fails."""
    if document["passed"]:
        return "It walks anywhere."
    if document["reservation"]:
        return f"It is not known to walk anywhere: {document['reservation']}."
    failed = [f"{t['name']} {t['share']:.0%}" for t in document["trials"] if not t["passed"]]
    return f"It does not walk anywhere: {', '.join(failed)}."


def _read(path: Path, schema: type, command: str) -> dict[str, Any] | None:
    """Read and check a document. command: `mjxgait` command that writes it."""
    if not path.exists():
        return None
    cure = f"`mjxgait {command} {path.parent}` writes it anew"
    try:
        document = read_json(path)
    except DamagedFile as error:
        message = str(error).removeprefix(f"{path}: ")
        raise DamagedFile(f"{path}: not {_NAMES[command]}: {message}; {cure}") from None
    check(schema, document, f"{path}: not {_NAMES[command]}", cure)
    return dict(document)


def outdated(document: Document, champion: Champion, creature: Creature) -> str | None:
    """Return a sentence on why a certificate does not count for this champion; None if it counts.

    A certificate counts for its own champion, task, ground and schema. File times prove nothing:
    copying a run, or writing the same champion again, changes them.
    """
    if "champion" not in document:
        return (
            "The certificate is outdated: "
            "it does not say which champion was examined, as those of earlier versions."
        )
    if document["champion"] != champion.fingerprint:
        return (
            "The certificate is outdated: "
            "it was given to another champion than the one that is here now."
        )
    if (task := document.get("task")) != champion.task:
        return (
            f"The certificate is outdated: it was given for the task {task}, "
            f"the champion's is {champion.task}."
        )
    ground, here = document.get("report", {}).get("ground", FLAT), str(creature.terrain)
    if ground != here:
        return f"The certificate is outdated: it was given on {ground} ground, the run's is {here}."
    if document.get("schema") != schema_of(champion.task):
        return "The certificate is outdated: it was given under other rules than today's."
    return None


TOLERANCE = 1e-6
"""Allowed difference of a measure, relative to its size, or absolute below 1.

On one machine with the same versions of MuJoCo and NumPy nothing differs.
"""


IDENTITY: tuple[Literal["champion", "creature_digest", "task"], ...] = (
    "champion",
    "creature_digest",
    "task",
)
"""Keys of a certificate that say what was examined."""


def differences(stored: Document, again: Document) -> list[str]:
    """Return the differences between a stored certificate and a new one, a phrase each.

    Seconds, attempts and numbers without a criterion do not count.
    """
    named: dict[str, tuple[object, object]] = {
        key: (stored.get(key), again[key]) for key in IDENTITY
    }
    named["ground"] = (stored.get("report", {}).get("ground"), again["report"]["ground"])
    found = [f"{key}: {one}, again {two}" for key, (one, two) in named.items() if one != two]
    found += _measures(criteria_of(stored), criteria_of(again))
    if said := verdict_of(stored).contradiction:
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
