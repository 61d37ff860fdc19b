"""Worker processes on the machines of a cluster: one per core, with one JAX device each.

A result's bits thus do not depend on a machine's number of cores. Nothing here imports JAX before
`ENVIRONMENT` is set.
"""

import contextlib
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from mjxgait.distributed.jobs import Job, Recipe

Result = TypeVar("Result")

ENVIRONMENT = {
    "NPROC": "1",  # XLA's threads
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "JAX_NUM_CPU_DEVICES": "1",
    "JAX_PLATFORMS": "cpu",
}

ROOM = 2**20
"""Bytes that a creature's files or a lock may take."""


class RemoteWorker:
    """An actor that runs jobs. tag: of its kind of machine, see `Machine`."""

    def __init__(self, tag: str) -> None:
        os.environ.update(ENVIRONMENT)
        from mjxgait.distributed.jobs import Programs
        from mjxgait.training.stages import prepare_devices

        prepare_devices(1, tag)
        self._programs = Programs(_turn)

    def ready(self) -> int:
        """Return the process id, once the worker can work.

        Raises:
          OSError: there is no room for a creature's files.
        """
        from mjxgait.training.disk import try_room

        try_room(Path(tempfile.gettempdir()), ROOM)
        return os.getpid()

    def do(self, recipe: "Recipe", job: "Job[Result]") -> tuple[Result, float]:
        """Return the job's result and its duration in s."""
        began = time.perf_counter()
        result = job.do(self._programs, recipe)
        return result, time.perf_counter() - began


@contextlib.contextmanager
def _turn(name: str, patience: float = -1.0) -> Iterator[None]:
    """Let one worker of a machine compile a program; the others then find it in the cache.

    Without a writable cache each compiles at once. patience: s; waits forever by default.
    """
    import filelock
    import jax

    from mjxgait.training.disk import try_room

    folder = Path(jax.config.values["jax_compilation_cache_dir"])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        try_room(folder, ROOM)
        lock = filelock.FileLock(folder / f"{name}.lock")
        lock.acquire(timeout=patience)
    except filelock.Timeout:
        raise
    except OSError:
        yield
        return
    try:
        yield
    finally:
        lock.release()
