"""Which process writes a run folder: one at a time, and others can see that it is alive.

The operating system holds the lock and lets go of it when the process ends, however that ends. A
file that a killed process left behind therefore locks nothing. Systems without `flock`, such as
Windows, have no lock: there a run that is alive is not known as such.
"""

import contextlib
import json
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mjxgait.errors import UserError
from mjxgait.training.disk import disk_errors

try:
    import fcntl
except ImportError:  # pragma: no cover
    fcntl = None  # type: ignore[assignment]

LOCK = "running.lock"
"""In a folder that is being written; it says which process does, and goes with it."""
TRIES, PAUSE = 5, 0.1
"""A process that only looks holds the lock for a moment: how often, and after how many seconds, to
try again."""


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep a folder for this process as long as the block lasts.

    Raises:
      UserError: another process has it, or it cannot be written.
    """
    file = _acquired(folder)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # the folder may be gone
            (folder / LOCK).unlink()
        file.close()


def running(run: Path) -> str | None:
    """Return which process writes a run now, in words; None where none does.

    A folder of several runs is locked as a whole.
    """
    return next(
        filter(None, (_holder(folder / LOCK) for folder in (run, run.resolve().parent))), None
    )


def why_empty(run: Path) -> str:
    """Return why a run has nothing to show yet."""
    if who := running(run):
        return f"it runs now ({who}) and has not done its first generation"
    return "the run ended before its first generation was done"


def _acquired(folder: Path) -> BinaryIO:
    """Return the lock's file, open and locked."""
    path, own = folder / LOCK, {"pid": os.getpid(), "host": socket.gethostname()}
    for _ in range(TRIES):
        with disk_errors(folder):
            file = path.open("a+b")
        if not _try(file):
            file.close()
            time.sleep(PAUSE)
        elif not _same(file, path):  # its holder has just ended and taken it away
            file.close()
        else:
            with disk_errors(folder):
                file.truncate(0)
                file.write(json.dumps(own).encode())
                file.flush()
            return file
    who = _holder(path) or "another process"
    raise UserError(f"{folder}: {who} works on it now; wait until that has ended, or end it first")


def _try(file: BinaryIO, shared: bool = False) -> bool:
    """Lock an open file; return whether no other process has it. Without locks none ever has."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system that knows no locks
        return True
    return True


def _same(file: BinaryIO, path: Path) -> bool:
    """Return whether an open file is still the one of that name."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _holder(path: Path) -> str | None:
    """Return which process holds a lock; None where none does."""
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
