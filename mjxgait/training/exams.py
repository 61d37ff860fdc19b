"""`exams.jsonl`: who of a run has been examined for the certificate, and how often it was tried."""

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
    """One line for each champion that a run has had examined; a file that only grows.

    An examination of the same champion says the same, so it counts once: a run that is resumed
    from an earlier checkpoint, and does again what it did, has not tried more often.
    """

    path: Path

    def failed(self, champion: str, generation: int) -> bool:
        """Whether the champion of this fingerprint has failed up to this generation."""
        failures = (line for line in self._lines() if not line["passed"])
        return any(
            line["champion"] == champion and line["generation"] <= generation for line in failures
        )

    def taken(self, generation: int) -> int:
        """Examinations up to this generation."""
        return len(self._until(generation))

    def attempt(self, champion: str, generation: int) -> int:
        """Which of the run's examinations this champion's is, or would be, counted from 1."""
        before = self._until(generation)
        return before.index(champion) + 1 if champion in before else len(before) + 1

    def add(self, champion: str, generation: int, passed: bool) -> None:
        """Writes an examination down, once for each champion."""
        if champion in (line["champion"] for line in self._lines()):
            return
        line = {"generation": generation, "champion": champion, "passed": passed}
        write_lines(self.path, [*self._lines(), line])

    def _until(self, generation: int) -> list[str]:
        lines = sorted(self._lines(), key=lambda line: line["generation"])
        return [line["champion"] for line in lines if line["generation"] <= generation]

    def _lines(self) -> list[dict[str, Any]]:
        return read_records(self.path, _Exam)
