"""Readers of `certificate.json` and `stress.json`, and the check that they are of this champion."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import pydantic

from mjxgait.certification.certificate import schema_of
from mjxgait.champion import Champion
from mjxgait.config.tables import (
    STORED,
    Flag,
    Index,
    Number,
    Text,
    check,
)
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
    config: dict[str, Any] = dataclasses.field(default_factory=dict)

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
    champion: Text = ""


def read_certificate(path: Path) -> dict[str, Any] | None:
    """Read what `Certificate.to_json` wrote; None if there is no file.

    Raises:
      UserError: it is not a certificate.
    """
    return _read(path, _Certificate, "certify")


def read_stress(path: Path, champion: Champion) -> dict[str, Any] | None:
    """Read what `Stress.document` says of this champion; None without a file on this champion.

    Raises:
      UserError: it is no such file.
    """
    document = _read(path, _Stress, "stress")
    return document if document and document.get("champion") == champion.fingerprint else None


def _read(path: Path, schema: type, command: str) -> dict[str, Any] | None:
    """Read and check a document. command: `mjxgait` command that writes it."""
    if not path.exists():
        return None
    cure = f"`mjxgait {command} {path.parent}` writes it anew"
    try:
        document = read_json(path)
    except DamagedFile as error:
        told = str(error).removeprefix(f"{path}: ")
        raise DamagedFile(f"{path}: not {_NAMES[command]}: {told}; {cure}") from None
    check(schema, document, f"{path}: not {_NAMES[command]}", cure)
    return dict(document)


def outdated(document: dict[str, Any], champion: Champion, creature: Creature) -> str | None:
    """Return a sentence on why a certificate does not count for this champion; None if it counts.

    A certificate counts for its own champion, task, ground and schema. File times prove nothing:
    copying a run, or writing the same champion again, changes them.
    """
    if "champion" not in document:
        return "The certificate is outdated: it does not say which champion was examined, as those of earlier versions."
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
