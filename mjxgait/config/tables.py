"""Strict reading of TOML tables into frozen dataclasses.

Unknown keys, wrong types and bad ranges are errors that name the key; none is dropped silently.
"""

import dataclasses
import reprlib
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import pydantic
import tomli_w

from mjxgait.errors import UserError, did_you_mean
from mjxgait.files import DamagedFile, check_tree, read_text

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from pydantic_core import ErrorDetails

T = TypeVar("T")
Table = Mapping[str, Any]

Positive = Annotated[float, pydantic.Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, pydantic.Field(ge=0, allow_inf_nan=False)]
Fraction = Annotated[float, pydantic.Field(ge=0, le=1)]
Share = Annotated[float, pydantic.Field(gt=0, le=1)]
Finite = Annotated[float, pydantic.Field(allow_inf_nan=False)]
Count = Annotated[int, pydantic.Field(ge=1)]
Whole = Annotated[int, pydantic.Field(ge=0)]
Seed = Annotated[int, pydantic.Field(ge=0, lt=2**32)]
"""Random numbers are of 32 bits: seeds that differ by 2^32 would be the same run."""


def _ordered(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] > interval[1]:
        raise ValueError(f"[{interval[0]}, {interval[1]}]: the first must not be the larger")
    return interval


Interval = Annotated[tuple[Finite, Finite], pydantic.AfterValidator(_ordered)]

SHAPE = "shape"
"""Marks a setting that decides the shape of the compiled program; all others are its inputs."""

KIND = "kind"
"""Marks a text that shapes the compiled program only by its part before the first colon."""

HOST = "host"
"""Marks a setting that only the host reads, never the compiled program."""

ADDED = "added"
"""Marks a setting that older run folders lack; its default says what those runs did."""

MOST_TOML = 8_000_000
"""Size limit of a file, bytes."""
Number = Annotated[float, pydantic.Field(strict=True)]
Text = pydantic.StrictStr
Flag = pydantic.StrictBool
Index = Annotated[int, pydantic.Field(strict=True, ge=0)]
"""Types for schemas of files written by a program: they never read a number from text."""
STORED = pydantic.ConfigDict(extra="ignore")
"""`__pydantic_config__` of a schema of such a file: keys may be added to it."""

UNKNOWN = "unexpected_keyword_argument"
STRICT = pydantic.ConfigDict(extra="forbid")
"""`__pydantic_config__` of a dataclass read by `build`."""


@dataclasses.dataclass(frozen=True)
class NoSettings:
    """Settings of a part that has none."""

    __pydantic_config__ = STRICT


def read_toml(path: Path) -> dict[str, Any]:
    """Return the table in a TOML file; UserError names the file and the faulty line."""
    return parse_toml(read_text(path, MOST_TOML), str(path))


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the table in a text; UserError names `where` it is from and the faulty line."""
    try:
        table = tomllib.loads(text)
        check_tree(table)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{where}: not valid TOML ({error})") from None
    return table


def dump_toml(value: "DataclassInstance") -> str:
    """Return the TOML text of a dataclass; keys that are None are left out."""
    return tomli_w.dumps(_without_none(dataclasses.asdict(value)))


def merge(base: Table, over: Table) -> dict[str, Any]:
    """Return `base` with the keys of `over` laid on top, table by table."""
    merged = dict(base)
    for key, value in over.items():
        old = merged.get(key)
        merged[key] = (
            merge(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
        )
    return merged


def not_none(**values: Any) -> dict[str, Any]:
    """Return the values that are not None, by name: the options that were given."""
    return {name: value for name, value in values.items() if value is not None}


def as_table(value: object, where: str) -> Table:
    """Return a value that must be a table.

    Raises:
      UserError: it is none.
    """
    if not isinstance(value, Mapping):
        raise UserError(f"{where} = {reprlib.repr(value)}: give a table")
    return value


def build(cls: type[T], table: Table, where: str) -> T:
    """Build `cls` (a dataclass, nested ones included) from a table.

    Args:
      where: name of the source in errors, such as `configs/mine.toml`.

    Raises:
      UserError: names the first key that is unknown, missing, of a wrong type or out of range, and
        the allowed values.
    """
    given = as_table(table, where)
    try:
        return _adapter(cls).validate_python(dict(given))  # type: ignore[arg-type]
    except pydantic.ValidationError as error:
        problems = error.errors(include_url=False)
        # A misspelt key is also a missing one: report the misspelling, which the user can correct.
        problems.sort(key=lambda problem: problem["type"] != UNKNOWN)
        raise UserError(f"{where}: {_sentence(cls, problems[0])}") from None


def check(cls: type, document: object, where: str, cure: str) -> None:
    """Refuse a document written by a program that violates the schema `cls`.

    Args:
      cure: the way out.

    Raises:
      DamagedFile: names the first key that is wrong.
    """
    if not isinstance(document, Mapping):
        raise DamagedFile(f"{where}: damaged (not a table); {cure}")
    try:
        build(cls, document, where)
    except UserError as error:
        raise DamagedFile(f"{error}; {cure}") from None


def check_whole(value: "DataclassInstance", table: Table, where: str) -> None:
    """Refuse a table that lacks keys which `dump_toml` writes for the dataclass read from it.

    Keys that are marked `ADDED` may be missing.

    Raises:
      UserError: names the first.
    """
    if missing := _missing(_without_none(dataclasses.asdict(value)), table, added_in(type(value))):
        raise UserError(
            f'{where}: the key "{missing}" is missing; write it there again, or take the folder '
            "from a copy"
        )


def _missing(wanted: Table, table: Table, added: frozenset[str], prefix: str = "") -> str | None:
    """Return the first key, dotted, that a table lacks; None where it has all but those added."""
    for key, value in wanted.items():
        if key not in table:
            if prefix + key not in added:
                return prefix + key
            continue
        inner = table[key]
        if not isinstance(value, Mapping) or not isinstance(inner, Mapping):
            continue
        if found := _missing(value, inner, added, f"{prefix}{key}."):
            return found
    return None


@cache
def added_in(cls: type, prefix: str = "") -> frozenset[str]:
    """Return the dotted keys of a schema that are marked `ADDED`."""
    found: set[str] = set()
    for name, hint in get_type_hints(cls, include_extras=True).items():
        if ADDED in getattr(hint, "__metadata__", ()):
            found.add(prefix + name)
        inner = getattr(hint, "__origin__", hint)
        if dataclasses.is_dataclass(inner) and isinstance(inner, type):
            found |= added_in(inner, f"{prefix}{name}.")
    return frozenset(found)


@cache
def _adapter(cls: type) -> pydantic.TypeAdapter:
    """Return the validator of a dataclass, cached: making one takes longer than using it."""
    return pydantic.TypeAdapter(cls)


def _sentence(cls: type, problem: "ErrorDetails") -> str:
    *parents, last = (str(part) for part in problem["loc"]) if problem["loc"] else [""]
    key = ".".join([*parents, last])
    match problem["type"]:
        case _ if problem["type"] == UNKNOWN:
            return f'unknown key "{key}"; {did_you_mean(last, _keys(cls, parents))}'
        case "missing":
            return f'the key "{key}" is missing'
        case "value_error":
            return f"{key}: {problem['ctx']['error']}" if key else str(problem["ctx"]["error"])
        case "dataclass_type":
            return f"{key} = {reprlib.repr(problem['input'])}: input should be a table"
        case _:
            return f"{key} = {reprlib.repr(problem['input'])}: {problem['msg'].lower()}"


def _keys(cls: type, parents: list[str]) -> list[str]:
    """Return the names of the fields of the dataclass at a dotted place within `cls`."""
    for name in parents:
        fields = {field.name: field for field in dataclasses.fields(cls)}
        if name in fields:
            inner = fields[name].type
            cls = next(
                (
                    t
                    for t in (inner, *getattr(inner, "__args__", ()))
                    if dataclasses.is_dataclass(t)
                ),
                cls,
            )  # type: ignore[assignment]
    return [field.name for field in dataclasses.fields(cls)]


def _without_none(value: object) -> Any:
    match value:
        case Mapping():
            return {key: _without_none(inner) for key, inner in value.items() if inner is not None}
        case list() | tuple():
            return [_without_none(inner) for inner in value]
        case _:
            return value


def flat(table: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    """Return the leaves of nested tables by dotted key; tuples as lists, as in TOML and JSON."""
    leaves: dict[str, object] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            leaves |= flat(value, f"{prefix}{key}.")
        else:
            leaves[prefix + key] = list(value) if isinstance(value, tuple) else value
    return leaves
