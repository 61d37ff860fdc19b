"""Logs of a run: files with a JSON object per line, which a resumed run truncates."""

import dataclasses
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pydantic

from mjxgait.config.tables import STORED, Flag, Index, Number, check
from mjxgait.evolution.state import NO_PARENT
from mjxgait.files import TAKE_OUT, DamagedFile, read_lines, write_text
from mjxgait.training.disk import disk_errors

MOTHERS, FATHERS = "mothers", "fathers"
"""Keys in a log line: each individual's own place in the previous generation, or its mother's; and
its father's, of those that were born of two.
"""
PARENTS = (MOTHERS, FATHERS)


Line = dict[str, Any]
"""A JSON object by name: a line of an append-only file."""


@dataclasses.dataclass(frozen=True)
class Numbered:
    """Schema of a line in files that a resumed run truncates."""

    __pydantic_config__ = STORED
    generation: Annotated[int, pydantic.Field(strict=True)]


@dataclasses.dataclass(frozen=True)
class _Metrics:
    """Schema of a line of `metrics.jsonl`; all further fields are numbers."""

    __pydantic_config__ = STORED
    generation: Index
    best: Number | None
    mean: Number | None
    forced: Flag
    mothers: list[int] = dataclasses.field(default_factory=list)
    fathers: list[int] = dataclasses.field(default_factory=list)


def read_metrics(path: Path) -> list[Line]:
    """Return the lines of a `metrics.jsonl`, without a last line that a kill cut off.

    Raises:
      UserError: it is damaged; names the line.
    """
    lines = read_records(path, _Metrics)
    for number, line in enumerate(lines, 1):
        for name, value in line.items():
            if not isinstance(value, int | float | None) and name not in (*PARENTS, "variant"):
                raise DamagedFile(f"{path}, line {number}: {name} is not a number; {TAKE_OUT}")
    return lines


def columns(lines: Sequence[Line]) -> dict[str, np.ndarray]:
    """Return each metric but those of parents over the generations [G], NaN where it is missing."""
    names = dict.fromkeys(name for line in lines for name in line if name not in PARENTS)
    return {
        name: np.array([np.nan if line.get(name) is None else line[name] for line in lines])
        for name in names
    }


def read_records(path: Path, schema: type) -> list[Line]:
    """Return the lines of an append-only file, checked by schema; see `files.read_lines`."""
    lines = read_lines(path)
    for number, line in enumerate(lines, 1):
        check(schema, line, f"{path}, line {number}", TAKE_OUT)
    return lines


def truncate_metrics(path: Path, generation: int) -> None:
    """Remove the lines after a generation, because a resumed run writes them again."""
    kept = [line for line in read_records(path, Numbered) if line["generation"] <= generation]
    write_lines(path, kept)


def append_lines(path: Path, lines: Iterable[Mapping[str, object]]) -> None:
    """Append JSON objects to a log, one per line.

    Logs are written before the checkpoint that they lead to: a kill in between leaves surplus
    lines, which a resumed run removes (`truncate_metrics`), and never a gap.
    """
    with disk_errors(path.parent), path.open("a", encoding="utf-8") as log:
        log.writelines(json.dumps(line) + "\n" for line in lines)


def write_lines(path: Path, lines: Iterable[Mapping[str, object]]) -> None:
    """Write a file at once, with one JSON object per line."""
    write_text(path, "".join(json.dumps(line) + "\n" for line in lines))


def mothers_line(lines: Sequence[Mapping[str, Any]], generation: int, place: int) -> dict[int, int]:
    """Return the places of an individual's maternal ancestors by generation, latest first.

    The line ends at an individual without a mother or a generation without a log line.
    """
    known = {line["generation"]: line[MOTHERS] for line in lines if MOTHERS in line}
    found = {generation: place}
    while (mother := parent(known.get(generation, ()), place)) != NO_PARENT:
        generation, place = generation - 1, mother
        found[generation] = place
    return found


def parent(places: Sequence[int], place: int) -> int:
    """Return the place of a parent of an individual; `NO_PARENT` if the log does not have it.

    places: of all mothers, or of all fathers, of a generation.
    """
    return places[place] if 0 <= place < len(places) else NO_PARENT
