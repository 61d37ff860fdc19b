"""The lock of the process that writes a folder.

The operating system holds the lock and releases it when the process ends, even if it is killed. A
lock file left behind therefore locks nothing. Systems without `flock`, such as Windows, have no
lock: a live run is not detected there.
"""

import contextlib
import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from mjxgait.errors import UserError
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import command, shows_skill_of

try:
    import fcntl
except ImportError:  # pragma: no cover
    fcntl = None  # type: ignore[assignment]

LOCK = "running.lock"
"""File in a folder that is being written; it names the process and is removed with it."""
TRIES, PAUSE = 5, 0.1
"""Number of attempts, and s between them: a process that only reads holds the lock briefly."""


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder for this process within the block.

    Raises:
      UserError: another process holds the lock, or the folder cannot be written.
    """
    file = _acquired(folder)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # the folder may be gone
            (folder / LOCK).unlink()
        file.close()


@contextlib.contextmanager
def locked_run(folder: Path, resume: bool, begin: Callable[[], object]) -> Iterator[None]:
    """Begin a run and lock its folder within the block.

    begin: makes the folder of a new run. One that is resumed is locked before.

    Raises:
      UserError: see `locked`.
    """
    if not resume:
        begin()
    with locked(folder):
        if resume:
            begin()
        yield


def running(run: Path) -> str | None:
    """Return a description of the process that writes a run now; None if none does.

    A folder of several runs is locked as a whole.
    """
    return next(
        filter(None, (_holder(folder / LOCK) for folder in (run, run.resolve().parent))), None
    )


def why_empty(run: Path) -> str:
    """Return why a run has no results yet."""
    if writer := running(run):
        return f"it runs now ({writer}) and has not done its first generation"
    if whole := shows_skill_of(run):
        return f"it shows one skill of {whole}; name that run"
    resume = command("train", "--resume", run, run=run)
    return f"the run ended before its first generation was done; `{resume}` goes on with it"


def _acquired(folder: Path) -> BinaryIO:
    """Return the lock's file, open and locked."""
    path, own = folder / LOCK, {"pid": os.getpid(), "host": socket.gethostname()}
    for _ in range(TRIES):
        with disk_errors(folder):
            file = path.open("a+b")
        if not _try(file):
            file.close()
            time.sleep(PAUSE)
        elif not _same(file, path):  # its holder has just ended and removed it
            file.close()
        else:
            with disk_errors(folder):
                file.truncate(0)
                file.write(json.dumps(own).encode())
                file.flush()
            return file
    holder = _holder(path) or "another process"
    raise UserError(
        f"{folder}: {holder} works on it now; wait until that has ended, or end it first"
    )


def _try(file: BinaryIO, shared: bool = False) -> bool:
    """Lock an open file; return False if another process holds it. Without `flock` return True."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _same(file: BinaryIO, path: Path) -> bool:
    """Return whether the path still leads to this open file."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _holder(path: Path) -> str | None:
    """Return a description of the process that holds a lock; None if none does."""
    try:
        with path.open("rb") as file:
            if _try(file, shared=True):
                return None
            said = json.loads(file.read() or "{}")
        return f"process {int(said['pid'])} on {said['host']}"
    except OSError:
        return None
    except (ValueError, KeyError, TypeError):
        return "another process"
