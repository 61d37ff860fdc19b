"""Orbax checkpoints of the whole evolution state, each with a manifest that tells whether it is whole and whose it is."""

import contextlib
import dataclasses
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np
import orbax.checkpoint as ocp

from mjxgait.errors import UserError
from mjxgait.search.evolution import EvolutionState

SCHEMA = 2
FOLDER = "checkpoints"


@dataclasses.dataclass(frozen=True)
class Manifest:
    """What a checkpoint says of itself.

    schema: of the state. creature: its name, creature_digest: hash of its files. generation. arrays: hash of all values of the state.
    key_impl: which random generator the key belongs to.
    """

    schema: int
    creature: str
    creature_digest: str
    generation: int
    arrays: str
    key_impl: str


class Checkpoints:
    """The checkpoints of one run, written in the background, each complete or absent."""

    def __init__(self, run: Path, keep_every: int = 1) -> None:
        """keep_every: of all checkpoints the latest three stay, and each whose generation is a multiple of this."""
        options = ocp.CheckpointManagerOptions(
            max_to_keep=3, keep_period=keep_every, cleanup_tmp_directories=True
        )
        self._folder = (run / FOLDER).resolve()
        handlers = {
            "state": ocp.StandardCheckpointHandler(),
            "manifest": ocp.JsonCheckpointHandler(),
        }
        self._manager = ocp.CheckpointManager(self._folder, options=options, item_handlers=handlers)

    def generations(self) -> list[int]:
        """The generations there are checkpoints of, oldest first."""
        return sorted(self._manager.all_steps())

    def save(self, state: EvolutionState, creature: str, digest: str) -> None:
        """Starts to write the state, of one run or of several side by side; an earlier write that failed is reported now."""
        arrays = _by_name(state)
        manifest = Manifest(
            SCHEMA,
            creature,
            digest,
            int(np.max(state.generation)),
            array_hash(arrays),
            str(jax.random.key_impl(state.key)),
        )
        args = ocp.args.Composite(
            state=ocp.args.StandardSave(arrays),
            manifest=ocp.args.JsonSave(dataclasses.asdict(manifest)),
        )
        with disk_errors(self._folder):
            self._manager.save(manifest.generation, args=args, force=True)

    def close(self) -> None:
        """Waits until everything is on disk."""
        with disk_errors(self._folder):
            self._manager.wait_until_finished()
            self._manager.close()

    def restore(
        self, abstract: EvolutionState, digest: str, generation: int | None = None
    ) -> EvolutionState:
        """The state of a generation, the latest by default.

        Args:
          abstract: a state of the shapes that the run's settings ask for.
          digest: hash of the creature's files as they are now.

        Raises:
          UserError: no checkpoint, a damaged or foreign one; names the newest that is intact.
        """
        known = self.generations()
        if not known:
            raise UserError(
                f"{self._folder}: no checkpoint to resume from; the run ended before its first generation"
            )
        wanted = known[-1] if generation is None else generation
        if wanted not in known:
            raise UserError(
                f"{self._folder}: no checkpoint of generation {wanted}; there are {', '.join(map(str, known))}"
            )
        try:
            return self._read(wanted, abstract, digest)
        except _Damaged as damage:
            intact = next(
                (g for g in reversed(known) if g < wanted and self._intact(g, abstract, digest)),
                None,
            )
            way_out = (
                f"generation {intact} is intact: add --generation {intact}"
                if intact is not None
                else "no older one is intact"
            )
            raise UserError(
                f"{self._folder / str(wanted)}: the checkpoint is damaged ({damage}); {way_out}"
            ) from None

    def _intact(self, generation: int, abstract: EvolutionState, digest: str) -> bool:
        try:
            self._read(generation, abstract, digest)
        except (_Damaged, UserError):
            return False
        return True

    def _read(self, generation: int, abstract: EvolutionState, digest: str) -> EvolutionState:
        where = self._folder / str(generation)
        try:
            read = self._manager.restore(
                generation, args=ocp.args.Composite(manifest=ocp.args.JsonRestore())
            )
            manifest = Manifest(**read.manifest)
        except Exception as error:  # Orbax raises many kinds on a broken folder
            raise _Damaged(_first_line(error)) from None
        if manifest.schema != SCHEMA:
            raise UserError(
                f"{where}: written with schema {manifest.schema}, this version reads {SCHEMA}; use the version that wrote it"
            )
        if manifest.creature_digest != digest:
            raise UserError(
                f"{where}: belongs to another body than {manifest.creature} as it is now; restore the creature's files to go on"
            )
        place = jax.sharding.SingleDeviceSharding(jax.local_devices()[0])
        target = {
            name: jax.ShapeDtypeStruct(leaf.shape, leaf.dtype, sharding=place)
            for name, leaf in _by_name(abstract).items()
        }
        try:
            found = self._manager.item_metadata(generation)["state"]
            _check_shapes(found, target, where)
            arrays = self._manager.restore(
                generation, args=ocp.args.Composite(state=ocp.args.StandardRestore(target))
            ).state
        except UserError:
            raise
        except Exception as error:
            raise _Damaged(_first_line(error)) from None
        if array_hash(arrays) != manifest.arrays:
            raise _Damaged("its values are not those that were written")
        state = jax.tree.unflatten(jax.tree.structure(abstract), [arrays[name] for name in target])
        return dataclasses.replace(
            state, key=jax.random.wrap_key_data(state.key, impl=manifest.key_impl)
        )


class _Damaged(Exception):
    """A checkpoint that cannot be read or is not what was written."""


def _by_name(state: EvolutionState) -> dict[str, Any]:
    """The arrays of a state by dotted name; its typed key as numbers, which is what checkpoint formats can hold."""
    key = state.key
    plain = (
        jax.eval_shape(jax.random.key_data, key)
        if isinstance(key, jax.ShapeDtypeStruct)
        else jax.random.key_data(key)
    )
    leaves, _ = jax.tree_util.tree_flatten_with_path(dataclasses.replace(state, key=plain))
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in leaves}


def array_hash(arrays: dict[str, Any]) -> str:
    """Hash of named arrays: their names, types, shapes and values."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        value = np.asarray(arrays[name])
        digest.update(f"{name} {value.dtype} {value.shape} ".encode())
        digest.update(value.tobytes())
    return digest.hexdigest()


def _check_shapes(found: Any, wanted: dict[str, Any], where: Path) -> None:
    """Refuses a checkpoint whose arrays have other names or shapes than the settings ask for, and names the first that differs."""
    there, here = (
        {name: (tuple(leaf.shape), str(np.dtype(leaf.dtype))) for name, leaf in tree.items()}
        for tree in (found, wanted)
    )
    for name in sorted(there.keys() | here.keys()):
        if there.get(name) != here.get(name):
            raise UserError(
                f"{where}: does not fit the settings of this run: {name} is {there.get(name, 'missing')}, "
                f"the settings ask for {here.get(name, 'nothing')}; resume with the settings it was written with"
            )


@contextlib.contextmanager
def disk_errors(folder: Path) -> Iterator[None]:
    """Turns what a full or read-only disk raises into one sentence."""
    try:
        yield
    except Exception as error:
        raise UserError(
            f"{folder}: cannot be written ({_first_line(error)}); "
            "the run is safe up to its latest checkpoint: make room and go on with --resume"
        ) from error


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
