"""Errors of a full, read-only or lost disk, in one sentence; and checks before long work."""

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from mjxgait.errors import UserError
from mjxgait.files import writing

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
CLOSED = (errno.EROFS, errno.EACCES, errno.EPERM)
GONE = (errno.ENOENT, errno.EIO, errno.ESTALE, errno.ENODEV, errno.ENXIO)
"""The folder was removed, or the disk was pulled out or is broken."""
CURES = (
    dict.fromkeys(FULL, "make room")
    | dict.fromkeys(CLOSED, "make it writable")
    | dict.fromkeys(GONE, "bring it back")
)
SAFE, AGAIN = "the run is safe up to its latest checkpoint", "go on with --resume"


@contextlib.contextmanager
def disk_errors(path: Path, safe: str = SAFE, again: str = AGAIN) -> Iterator[None]:
    """Turn errors of a full, read-only or lost disk into one sentence.

    path: what is being written. safe: what is not lost. again: what to do with room on the disk.

    Raises:
      UserError: instead of such an error; no other error is touched.
    """
    try:
        yield
    except Exception as error:
        code = refusal(error)
        if code is None:
            raise
        reason = f"{os.strerror(code)}; {safe}: {CURES[code]} and {again}"
        raise UserError(f"{path}: cannot be written: {reason}") from error


def require_writable(path: Path) -> None:
    """Check before long work that a file can be written; leaves nothing behind.

    Raises:
      UserError: names the file, or the folder that is missing.
    """
    if not path.absolute().parent.is_dir():
        raise UserError(f"{path}: the folder {path.parent} does not exist")
    there = path.exists()
    with writing(path):
        path.open("ab").close()
        if not there:
            path.unlink()


def refusal(error: BaseException) -> int | None:
    """Return the error number of a failed write; None for any other error.

    TensorStore, which Orbax uses, puts its message into the text of a ValueError.
    """
    if isinstance(error, OSError):
        return error.errno if error.errno in CURES else None
    if isinstance(error, ValueError):
        return next((code for code in CURES if os.strerror(code) in str(error)), None)
    return None


def try_room(folder: Path, size: int) -> None:
    """Write a temporary file of this size in bytes.

    Raises:
      OSError: the disk refuses.
    """
    with tempfile.TemporaryFile(dir=folder) as scratch:
        scratch.write(bytes(size))
