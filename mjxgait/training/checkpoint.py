"""Orbax checkpoints of the whole evolution state; `stored` validates and reads them.

They are written in the background, where a disk may fill. The error that Orbax passes on reaches
the caller of `save` or `close`; further output of Orbax's threads is suppressed.
"""

import dataclasses
import logging
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import jax
import numpy as np
import orbax.checkpoint as ocp

from mjxgait.errors import UserError
from mjxgait.evolution.chance import check_generator, key_from
from mjxgait.evolution.state import EvolutionState
from mjxgait.training.disk import disk_errors, try_room
from mjxgait.training.stored import (
    FOLDER,
    MANIFEST,
    SCHEMA,
    STATE,
    Manifest,
    array_hash,
    read_stored,
    stored_generations,
)
from mjxgait.types import by_name


@dataclasses.dataclass(frozen=True, eq=False)
class Packed:
    """State of one run or of a batch.

    arrays: by dotted name; the typed key as numbers. key_impl: the key's random generator.
    """

    arrays: Mapping[str, np.ndarray]
    key_impl: str

    @property
    def generation(self) -> int:
        """Generation of the state."""
        return int(np.max(self.arrays["generation"]))

    @property
    def size(self) -> int:
        """Size of the arrays in bytes."""
        return sum(array.nbytes for array in self.arrays.values())

    def with_arrays(self, arrays: Mapping[str, np.ndarray]) -> "Packed":
        """Return the state with these arrays replaced."""
        return Packed({**self.arrays, **arrays}, self.key_impl)

    def with_first(self, arrays: Mapping[str, np.ndarray]) -> "Packed":
        """Return the states of a batch with their first individuals replaced.

        arrays: [B, N, ...], at most as many individuals as the states have.
        """
        rest = {name: self.arrays[name][:, array.shape[1] :] for name, array in arrays.items()}
        return self.with_arrays(
            {n: np.concatenate([a, rest[n]], axis=1) for n, a in arrays.items()}
        )

    def __getitem__(self, some: int | slice) -> "Packed":
        """Return the state of one run of a batch, or the states of some."""
        return Packed({name: array[some] for name, array in self.arrays.items()}, self.key_impl)

    @property
    def count(self) -> int:
        """Number of runs in the batch."""
        return len(self.arrays["generation"])

    def state(self, abstract: EvolutionState, where: str) -> EvolutionState:
        """Return the state on the first of this machine's devices.

        Args:
          abstract: a state with the shapes that the run's settings require.
          where: origin of the state, for the error.

        Raises:
          UserError: the state has other settings or another random generator.
        """
        wanted = _by_name(abstract)
        _check_shapes(self.arrays, wanted, where)
        place = jax.local_devices()[0]
        arrays = [jax.device_put(self.arrays[name], place) for name in wanted]
        state = jax.tree.unflatten(jax.tree.structure(abstract), arrays)
        return dataclasses.replace(state, key=key_from(state.key, self.key_impl, where))


def side_by_side(rows: Sequence[Packed]) -> Packed:
    """Stack the states of several runs into a batch, the inverse of indexing."""
    first = rows[0]
    arrays = {name: np.stack([row.arrays[name] for row in rows]) for name in first.arrays}
    return Packed(arrays, first.key_impl)


def pack(state: EvolutionState) -> Packed:
    """Return the state in NumPy, transferred from the devices at once."""
    impl = str(jax.random.key_impl(state.key))
    return Packed(jax.device_get(_by_name(state)), impl)


Shaped = np.ndarray | jax.Array | jax.ShapeDtypeStruct
"""Something with a shape and a type."""


def _by_name(state: EvolutionState) -> dict[str, Shaped]:
    """Return the arrays of a state by dotted name; its typed key as numbers."""
    key = state.key
    plain = (
        jax.eval_shape(jax.random.key_data, key)
        if isinstance(key, jax.ShapeDtypeStruct)
        else jax.random.key_data(key)
    )
    return by_name(dataclasses.replace(state, key=plain))


def _check_shapes(found: Mapping[str, Shaped], wanted: Mapping[str, Shaped], where: str) -> None:
    """Refuse a state with other arrays than the settings require.

    Raises:
      UserError: names the first array with another name, shape or type.
    """
    there, here = (
        {name: (tuple(leaf.shape), str(np.dtype(leaf.dtype))) for name, leaf in tree.items()}
        for tree in (found, wanted)
    )
    if name := first_difference(there, here):
        raise UserError(
            f"{where}: does not fit the settings of this run: {name} is "
            f"{there.get(name, 'missing')}, the settings ask for {here.get(name, 'nothing')}; "
            "resume with the settings it was written with"
        )


def first_difference(one: Mapping[str, object], other: Mapping[str, object]) -> str | None:
    """Return the first name, in alphabetical order, with different values; None without any."""
    names = sorted(one.keys() | other.keys())
    return next((name for name in names if one.get(name) != other.get(name)), None)


OVERHEAD = 2**18
"""Largest size of a checkpoint in bytes, on top of twice its arrays."""


class Checkpoints:
    """Checkpoints of one run, written in the background, each complete or absent."""

    def __init__(self, run: Path, keep_every: int = 1) -> None:
        """Keep the latest three, and each generation that is a multiple of `keep_every`."""
        _keep_threads_quiet()
        self._run, self._folder = run, (run / FOLDER).resolve()
        options = ocp.CheckpointManagerOptions(
            max_to_keep=3,
            keep_period=keep_every,
            cleanup_tmp_directories=True,
            # Else a thread waits five minutes for a folder that cannot be made, and the program
            # cannot end before it.
            async_options=ocp.options.AsyncOptions(create_directories_asynchronously=False),
        )
        handlers = {
            STATE: ocp.StandardCheckpointHandler(),
            MANIFEST: ocp.JsonCheckpointHandler(),
        }
        with disk_errors(self._folder):
            self._manager = ocp.CheckpointManager(
                self._folder, options=options, item_handlers=handlers
            )
        self._beginner = ThreadPoolExecutor(1, "checkpoints")
        self._begun: Future[object] = Future()
        self._begun.set_result(None)

    def generations(self) -> list[int]:
        """Return the generations that have checkpoints, oldest first."""
        return stored_generations(self._run)

    def drop_after(self, generation: int) -> list[int]:
        """Delete the checkpoints of later generations; return these generations, oldest first."""
        later = [known for known in self.generations() if known > generation]
        with disk_errors(self._folder):
            for known in reversed(later):
                self._manager.delete(known)
        return later

    def save(self, state: EvolutionState, creature: str, digest: str) -> None:
        """Start to write the state of one run or of a batch.

        Raises:
          UserError: the disk is full or cannot be written, now or in an earlier write.
        """
        self.keep(pack(state), creature, digest)

    def keep(self, packed: Packed, creature: str, digest: str) -> None:
        """Start to write a packed state; see `save`."""
        arrays = dict(packed.arrays)
        manifest = Manifest(
            SCHEMA, creature, digest, packed.generation, array_hash(arrays), packed.key_impl
        )
        args = ocp.args.Composite(
            state=ocp.args.StandardSave(arrays),
            manifest=ocp.args.JsonSave(dataclasses.asdict(manifest)),
        )
        with disk_errors(self._folder):
            self._begun.result()
            # Raises before anything of it is written.
            try_room(self._folder, 2 * packed.size + OVERHEAD)
        # Orbax writes in the background, but starting takes it a tenth of a generation.
        self._begun = self._beginner.submit(
            self._manager.save, manifest.generation, args=args, force=True
        )

    def wait(self) -> None:
        """Wait until everything is on disk."""
        with disk_errors(self._folder):
            self._begun.result()
            self._manager.wait_until_finished()

    def close(self) -> None:
        """Wait until every write is done or has failed, and close."""
        with self._beginner, disk_errors(self._folder):
            self.wait()
            self._manager.close()

    def restore(
        self, abstract: EvolutionState, digest: str, generation: int | None = None
    ) -> EvolutionState:
        """Return the state of a generation, the latest by default.

        Args:
          abstract: a state with the shapes that the run's settings require.
          digest: hash of the creature's current files.

        Raises:
          UserError: no checkpoint, a damaged or foreign one, or one of other settings.
        """
        packed = self.read(digest, generation)
        found = self.generations()[-1] if generation is None else generation
        return packed.state(abstract, str(self._folder / str(found)))

    def read(self, digest: str, generation: int | None = None) -> Packed:
        """Return the packed state of a generation, the latest by default, of any shapes.

        Raises:
          UserError: no checkpoint, a damaged or foreign one, or one of another random generator.
        """
        stored = read_stored(self._run, digest, generation)
        check_generator(stored.manifest.key_impl, str(self._folder))
        return Packed(stored.arrays, stored.manifest.key_impl)


def _keep_threads_quiet() -> None:
    """Suppress output of Orbax's threads that repeats raised errors or advises programmers."""
    log = logging.getLogger("absl")
    if _is_not_raised not in log.filters:
        log.addFilter(_is_not_raised)
    if not isinstance(sys.unraisablehook, _WithoutClosedLoops):
        sys.unraisablehook = _WithoutClosedLoops(sys.unraisablehook)


def _is_not_raised(record: logging.LogRecord) -> bool:
    """Return False for Orbax's warnings, and its log records of errors that are also raised.

    On slow disks it warns that a write waits for the previous one; users can do nothing about it.
    """
    warning = record.levelno <= logging.WARNING
    return "orbax" not in Path(record.pathname).parts or not (record.exc_info or warning)


class _WithoutClosedLoops:
    """Hook for unraisable errors that drops those of writes after a failed one.

    Orbax closes its event loop at the first error; TensorStore's native threads still report to it.
    """

    def __init__(self, before: Callable[["sys.UnraisableHookArgs"], object]) -> None:
        self._before = before

    def __call__(self, error: "sys.UnraisableHookArgs", /) -> None:
        foreign = threading.current_thread().name.startswith("Dummy-")
        if not (foreign and str(error.exc_value) == "Event loop is closed"):
            self._before(error)
