"""Orbax checkpoints of the whole evolution state; `stored` tells which are whole and reads them.

They are written in the background, where a disk may fill. Who saves or closes is told so by the
error that Orbax hands on; what its threads would say on the screen besides is kept off it.
"""

import dataclasses
import logging
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import orbax.checkpoint as ocp

from mjxgait.evolution.chance import check_generator
from mjxgait.evolution.state import EvolutionState
from mjxgait.training.disk import disk_errors, try_room
from mjxgait.training.packed import Packed, pack
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

OVERHEAD = 2**18
"""Bytes that a checkpoint takes at most beside twice its arrays."""


class Checkpoints:
    """The checkpoints of one run, written in the background, each complete or absent."""

    def __init__(self, run: Path, keep_every: int = 1) -> None:
        """Besides the latest three, each generation that is a multiple of `keep_every` stays."""
        _keep_threads_quiet()
        self._run, self._folder = run, (run / FOLDER).resolve()
        options = ocp.CheckpointManagerOptions(
            max_to_keep=3,
            keep_period=keep_every,
            cleanup_tmp_directories=True,
            # Threads that wait for a folder which cannot be made do so for five minutes, and so
            # does the end of the program.
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
        self._begun: Future[Any] = Future()
        self._begun.set_result(None)

    def generations(self) -> list[int]:
        """The generations there are checkpoints of, oldest first."""
        return stored_generations(self._run)

    def drop_after(self, generation: int) -> list[int]:
        """Deletes the checkpoints of later generations; returns which, oldest first."""
        later = [known for known in self.generations() if known > generation]
        with disk_errors(self._folder):
            for known in reversed(later):
                self._manager.delete(known)
        return later

    def save(self, state: EvolutionState, creature: str, digest: str) -> None:
        """Starts to write the state, of one run or of several side by side.

        Raises:
          UserError: the disk is full or cannot be written, now or in an earlier write.
        """
        self.keep(pack(state), creature, digest)

    def keep(self, packed: Packed, creature: str, digest: str) -> None:
        """Starts to write a packed state; see `save`."""
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
            # Told before anything of it is written.
            try_room(self._folder, 2 * packed.size + OVERHEAD)
        # Orbax writes in the background, but takes a tenth of a generation to begin with it.
        self._begun = self._beginner.submit(
            self._manager.save, manifest.generation, args=args, force=True
        )

    def wait(self) -> None:
        """Waits until everything is on disk."""
        with disk_errors(self._folder):
            self._begun.result()
            self._manager.wait_until_finished()

    def close(self) -> None:
        """Waits until everything is on disk, or will never be."""
        with self._beginner, disk_errors(self._folder):
            self.wait()
            self._manager.close()

    def restore(
        self, abstract: EvolutionState, digest: str, generation: int | None = None
    ) -> EvolutionState:
        """The state of a generation, the latest by default.

        Args:
          abstract: a state of the shapes that the run's settings ask for.
          digest: hash of the creature's files as they are now.

        Raises:
          UserError: no checkpoint, a damaged or foreign one, or one of other settings.
        """
        packed = self.read(digest, generation)
        found = self.generations()[-1] if generation is None else generation
        return packed.state(abstract, str(self._folder / str(found)))

    def read(self, digest: str, generation: int | None = None) -> Packed:
        """The packed state of a generation, the latest by default, whatever its shapes.

        Raises:
          UserError: no checkpoint, a damaged or foreign one, or one of another random generator.
        """
        stored = read_stored(self._run, digest, generation)
        check_generator(stored.manifest.key_impl, str(self._folder))
        return Packed(stored.arrays, stored.manifest.key_impl)


def _keep_threads_quiet() -> None:
    """Keeps off the screen what Orbax hands on to the caller anyway, and its advice to programmers."""
    log = logging.getLogger("absl")
    if _told_to_the_caller not in log.filters:
        log.addFilter(_told_to_the_caller)
    if not isinstance(sys.unraisablehook, _WithoutClosedLoops):
        sys.unraisablehook = _WithoutClosedLoops(sys.unraisablehook)


def _told_to_the_caller(record: logging.LogRecord) -> bool:
    """Lets a record pass that is no error of Orbax's that is raised too, and no warning of it.

    It warns on slow disks that a write waits for the one before, which no user can do anything with.
    """
    warning = record.levelno <= logging.WARNING
    return "orbax" not in Path(record.pathname).parts or not (record.exc_info or warning)


class _WithoutClosedLoops:
    """A hook for errors that nobody can catch, without those of writes after a failed one.

    Orbax closes its event loop at the first error; the threads of TensorStore, which are not
    Python's, still report to it.
    """

    def __init__(self, before: Callable[["sys.UnraisableHookArgs"], Any]) -> None:
        self._before = before

    def __call__(self, error: "sys.UnraisableHookArgs", /) -> None:
        foreign = threading.current_thread().name.startswith("Dummy-")
        if not (foreign and str(error.exc_value) == "Event loop is closed"):
            self._before(error)
