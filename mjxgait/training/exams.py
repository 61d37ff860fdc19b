"""Log of a run's examinations, each an attempt to pass."""

import dataclasses
from pathlib import Path

from mjxgait.config.tables import STORED, Flag, Index, Text
from mjxgait.training.logs import Line, read_records, write_lines


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
        return any(line["champion"] == champion for line in self._failures(generation))

    def any_failed(self, generation: int) -> bool:
        """Return whether any champion has failed up to this generation."""
        return bool(self._failures(generation))

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
        line: Line = {"generation": generation, "champion": champion, "passed": passed}
        write_lines(self.path, [*self._lines(), line])

    def _failures(self, generation: int) -> list[Line]:
        lines = self._lines()
        return [line for line in lines if not line["passed"] and line["generation"] <= generation]

    def _until(self, generation: int) -> list[str]:
        lines = sorted(self._lines(), key=lambda line: line["generation"])
        return [line["champion"] for line in lines if line["generation"] <= generation]

    def _lines(self) -> list[Line]:
        return read_records(self.path, _Exam)
