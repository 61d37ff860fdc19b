"""Stored checkpoints: which are complete, and their validated arrays. Reads without JAX."""

import dataclasses
import hashlib
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import tensorstore
from numpy.typing import ArrayLike

from mjxgait.config.tables import Index, Text, check
from mjxgait.errors import UserError
from mjxgait.files import read_json
from mjxgait.training.folder import command
from mjxgait.training.lock import why_empty

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
        resume = command("train", "--resume", run, run=run)
        way_out = (
            "no other one is intact"
            if intact is None
            else f"generation {intact} is intact: `{resume} --generation {intact}` goes on from it"
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
