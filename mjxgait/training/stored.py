"""Run folders on the disk: errors, the lock of the writer, and stored checkpoints.

The operating system holds the lock and releases it when the process ends, even if it is killed. A
lock file left behind therefore locks nothing. Systems without `flock`, such as Windows, have no
lock: a live run is not detected there.
"""

import contextlib
import dataclasses
import errno
import hashlib
import json
import math
import os
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np
import tensorstore
from numpy.typing import ArrayLike

from mjxgait.config.tables import Index, Text, check
from mjxgait.errors import UserError
from mjxgait.files import read_json, writing

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
        elif not _same(file, path):  # its holder has just ended and removed it
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


SCHEMA = 2
FOLDER = "checkpoints"
MOST_BYTES = 20_000_000_000
"""Largest total size of a checkpoint's arrays in bytes."""
STATE, MANIFEST = "state", "manifest"


@dataclasses.dataclass(frozen=True)
class Manifest:
    """Metadata of a checkpoint.

    schema: of the state. creature: its name, creature_digest: hash of its files. generation.
    arrays: hash of all values of the state. key_impl: the key's random generator.
    """

    schema: Index
    creature: Text
    creature_digest: Text
    generation: Index
    arrays: Text
    key_impl: Text


@dataclasses.dataclass(frozen=True, eq=False)
class Stored:
    """Complete checkpoint. arrays: of the state, by dotted name."""

    manifest: Manifest
    arrays: Mapping[str, np.ndarray]


class _Damaged(Exception):
    """Unreadable checkpoint, or one with other values than were written."""


def stored_generations(run: Path) -> list[int]:
    """Return the generations that have complete checkpoints, oldest first.

    A checkpoint that was being written when the run was killed has another name and is left out.
    """
    folder = run / FOLDER
    return (
        sorted(int(entry.name) for entry in folder.iterdir() if is_number(entry.name))
        if folder.is_dir()
        else []
    )


def is_number(name: str) -> bool:
    """Return whether a folder's name is a generation; `int` accepts fewer digits than `str`."""
    return name.isascii() and name.isdecimal()


def read_stored(run: Path, digest: str, generation: int | None = None) -> Stored:
    """Return the checkpoint of a generation, the latest by default.

    digest: hash of the creature's current files.

    Raises:
      UserError: no checkpoint, a damaged or foreign one; names the newest that is intact.
    """
    known = stored_generations(run)
    if not known:
        raise UserError(f"{run}: no checkpoint yet; {why_empty(run)}")
    wanted = known[-1] if generation is None else generation
    if wanted not in known:
        raise UserError(
            f"{run}: no checkpoint of generation {wanted}; there are {', '.join(map(str, known))}"
        )
    folder = run / FOLDER / str(wanted)
    try:
        return _read(folder, digest)
    except _Damaged as damage:
        others = (known for known in reversed(known) if known != wanted)
        intact = next((other for other in others if _intact(run, other, digest)), None)
        way_out = (
            "no other one is intact"
            if intact is None
            else f"generation {intact} is intact: add --generation {intact}"
        )
        raise UserError(f"{folder}: the checkpoint is damaged ({damage}); {way_out}") from None


def array_hash(arrays: Mapping[str, ArrayLike]) -> str:
    """Return a hash of named arrays: their names, types, shapes and values."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        value = np.asarray(arrays[name])
        digest.update(f"{name} {value.dtype} {value.shape} ".encode())
        digest.update(value.tobytes())
    return digest.hexdigest()


def _intact(run: Path, generation: int, digest: str) -> bool:
    try:
        _read(run / FOLDER / str(generation), digest)
    except (_Damaged, UserError):
        return False
    return True


def _read(folder: Path, digest: str) -> Stored:
    try:
        path = folder / MANIFEST / "metadata"
        document = read_json(path)
        check(Manifest, document, str(path), "it cannot be read")
        manifest = Manifest(**document)
    except (UserError, TypeError) as error:
        raise _Damaged(_reason(error)) from None
    if manifest.schema != SCHEMA:
        raise UserError(
            f"{folder}: written with schema {manifest.schema}, this version reads {SCHEMA}; "
            "use the version that wrote it"
        )
    if manifest.creature_digest != digest:
        raise UserError(
            f"{folder}: belongs to another body than {manifest.creature} as it is now; "
            "put the creature's files back as they were"
        )
    try:
        arrays = _read_arrays(folder / STATE)
    except ValueError as error:  # all that TensorStore raises
        raise _Damaged(_reason(error)) from None
    if array_hash(arrays) != manifest.arrays:
        raise _Damaged("its values are not those that were written")
    return Stored(manifest, arrays)


def _read_arrays(folder: Path) -> dict[str, np.ndarray]:
    """Read the arrays one after the other.

    Orbax reads all at once in an event loop, which it closes at the first broken array; pending
    reads then print errors.
    """
    place = {"driver": "ocdbt", "base": {"driver": "file", "path": f"{folder.resolve()}/"}}
    keys = tensorstore.KvStore.open(place).result().list().result()
    names = [key.decode().removesuffix("/.zarray") for key in keys if key.endswith(b"/.zarray")]
    stores = {
        name: tensorstore.open(
            {"driver": "zarr", "kvstore": {**place, "path": f"{name}/"}}
        ).result()
        for name in names
    }
    size = sum(
        math.prod(store.shape) * store.dtype.numpy_dtype.itemsize for store in stores.values()
    )
    if size > MOST_BYTES:
        raise ValueError(f"its arrays would take {size / 1e9:.0f} GB")
    return {name: store.read().result() for name, store in stores.items()}


def _reason(error: Exception) -> str:
    reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return reason if len(reason) < 120 else reason[:117] + "..."
