"""Bounded reading of files that may be damaged or untrusted, and atomic writing of files."""

import contextlib
import errno
import json
import os
import re
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from mjxgait.errors import UserError

MOST_TEXT, MOST_LINES = 50_000_000, 400_000_000
"""Size limits, bytes: of a text file, and of one with a line for each generation."""
TAKE_OUT = "take the line out, or the file away"
MOST_DEPTH = 60
"""Limit on the nesting of tables and lists."""
UNSHOWN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff]")
"""Control codes, which a terminal obeys, and lone surrogates, which it cannot print."""
MOST_WHOLE = 2**64
"""Limit on whole numbers: ours are smaller; a larger one may have no float."""


class DamagedFile(UserError):
    """File that exists but has invalid content."""


def read_bytes(path: Path, most: int = MOST_TEXT) -> bytes:
    """Return the content of a regular file.

    A pipe or a device is not waited for.

    Raises:
      UserError: it is missing, no regular file, too large or cannot be read.
    """
    try:
        # Without O_NONBLOCK, opening a pipe waits for a writer.
        number = os.open(
            path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        )
        with open(number, "rb") as file:
            if not stat.S_ISREG(os.fstat(number).st_mode):
                raise DamagedFile(f"{path}: not a file; put one in its place, or take it away")
            data = file.read(most + 1)
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        cause = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else error
        kind = DamagedFile if getattr(error, "errno", None) == errno.EISDIR else UserError
        raise kind(f"{path}: cannot be read ({cause})") from None
    if len(data) > most:
        raise DamagedFile(f"{path}: larger than {most // 1_000_000} MB, so it is not read")
    return data


def read_text(path: Path, most: int = MOST_TEXT) -> str:
    """Return the content of a text file in UTF-8; see `read_bytes`."""
    try:
        return read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DamagedFile(f"{path}: not a text file in UTF-8") from None


def require_ending(path: Path, endings: Sequence[str]) -> None:
    """Check that a file to be written has one of these endings.

    Raises:
      UserError: names the endings.
    """
    if path.suffix.lower() not in endings:
        known = ", ".join(endings)
        raise UserError(f'{path}: cannot write "{path.suffix}"; end the name with {known}')


def read_json(path: Path) -> Any:
    """Return the content of a JSON file.

    Raises:
      UserError: see `read_text`; or it is no JSON, or refused by `check_tree`.
    """
    return _parsed(read_text(path), str(path))


def read_lines(path: Path) -> list[dict[str, Any]]:
    """Return the objects of a file with one in each line; an empty list if there is no file.

    A last line cut off by a kill is left out.

    Raises:
      UserError: see `read_text`; or a line is no JSON object.
    """
    if not path.exists():
        return []
    *whole, rest = read_text(path, MOST_LINES).split("\n")
    found = [_line(text, f"{path}, line {i}") for i, text in enumerate(whole, 1) if text.strip()]
    with contextlib.suppress(UserError):
        found += [_line(rest, "")] if rest.strip() else []
    return found


def check_tree(value: object) -> None:
    """Refuse nested tables and lists that this program never writes.

    Raises:
      ValueError: too deep, a whole number too large, or text that cannot be shown.
    """
    level = [value]
    for _ in range(MOST_DEPTH):
        inner: list[object] = []
        for one in level:
            match one:
                case dict():
                    inner += [*one, *one.values()]
                case list() | tuple():
                    inner += one
                case str() if UNSHOWN.search(one):
                    raise ValueError("text with characters that cannot be shown")
                case int() if abs(one) >= MOST_WHOLE:
                    raise ValueError("a number that is too large")
        if not inner:
            return
        level = inner
    raise ValueError(f"nested deeper than {MOST_DEPTH}")


def path_of(place: str | os.PathLike[str]) -> Path:
    """Return the path of a file or folder that a user names.

    Raises:
      UserError: it is neither text nor a path.
    """
    if isinstance(place, str | os.PathLike):
        return Path(place)
    raise UserError(f"{place!r}: name a file or a folder, as text or as a path")


@contextlib.contextmanager
def writing(place: Path) -> Iterator[None]:
    """Raise a UserError for an error of the system in the block, which writes a file or a folder.

    Raises:
      UserError: names the place and the reason.
    """
    try:
        yield
    except OSError as error:
        raise UserError(f"{place}: cannot be written ({error.strerror or error})") from None


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file atomically: it holds either the old content or the new."""
    with replaced(path) as beside:
        beside.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8 atomically; see `write_bytes`."""
    write_bytes(path, text.encode("utf-8"))


@contextlib.contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Yield the path of a file that replaces `path` when the block ends without an error.

    A device or a pipe cannot be replaced: it is written directly.
    """
    real = path.resolve()
    if real.exists() and not real.is_file():
        yield path
        return
    beside = real.with_name(f".{os.getpid()}.{real.name}")
    try:
        yield beside
        beside.replace(real)
    finally:
        with contextlib.suppress(OSError):
            beside.unlink()


def _line(text: str, where: str) -> dict[str, Any]:
    try:
        found = _parsed(text, where)
    except DamagedFile as error:
        raise DamagedFile(f"{error}; {TAKE_OUT}") from None
    if not isinstance(found, dict):
        raise DamagedFile(f"{where}: not an object; {TAKE_OUT}")
    return found


def _parsed(text: str, where: str) -> Any:
    try:
        found = json.loads(text)
        check_tree(found)
    except RecursionError:
        raise DamagedFile(f"{where}: nested deeper than {MOST_DEPTH}") from None
    except ValueError as error:
        raise DamagedFile(f"{where}: damaged ({error})") from None
    return found
