"""`exams.jsonl`: the champions of a run that were examined for the certificate."""

import dataclasses
from pathlib import Path
from typing import Any

from mjxgait.config.tables import (
    STORED,
    Flag,
    Index,
    Text,
)
from mjxgait.training.folder import read_records, write_lines


@dataclasses.dataclass(frozen=True)
class _Exam:
    """Schema of a line."""

    __pydantic_config__ = STORED
    generation: Index
    champion: Text
    passed: Flag


@dataclasses.dataclass(frozen=True)
class Exams:
    """Append-only file with a line for each champion that a run has examined.

    Examining a champion again gives the same result, so it counts once: a run that is resumed from
    an earlier checkpoint and repeats its examinations makes no more attempts.
    """

    path: Path

    def failed(self, champion: str, generation: int) -> bool:
        """Return whether the champion of this fingerprint has failed up to this generation."""
        failures = (line for line in self._lines() if not line["passed"])
        return any(
            line["champion"] == champion and line["generation"] <= generation for line in failures
        )

    def taken(self, generation: int) -> int:
        """Return the number of examinations up to this generation."""
        return len(self._until(generation))

    def attempt(self, champion: str, generation: int) -> int:
        """Return the attempt number that this champion has or would have, counted from 1."""
        before = self._until(generation)
        return before.index(champion) + 1 if champion in before else len(before) + 1

    def add(self, champion: str, generation: int, passed: bool) -> None:
        """Record an examination, once for each champion."""
        if champion in (line["champion"] for line in self._lines()):
            return
        line = {"generation": generation, "champion": champion, "passed": passed}
        write_lines(self.path, [*self._lines(), line])

    def _until(self, generation: int) -> list[str]:
        lines = sorted(self._lines(), key=lambda line: line["generation"])
        return [line["champion"] for line in lines if line["generation"] <= generation]

    def _lines(self) -> list[dict[str, Any]]:
        return read_records(self.path, _Exam)
