"""What runs on the machines of a cluster: one process per core, with one device of JAX each.

So the bits of a result depend on no machine's number of cores. Nothing here imports JAX before the
process has been told of its core.
"""

import contextlib
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ENVIRONMENT = {
    "NPROC": "1",  # the threads of XLA
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "JAX_NUM_CPU_DEVICES": "1",
    "JAX_PLATFORMS": "cpu",
}

ROOM = 2**20
"""Bytes that a creature's files or a lock may take."""


class RemoteWorker:
    """An actor. tag: of its kind of machine, see `Machine`."""

    def __init__(self, tag: str) -> None:
        os.environ.update(ENVIRONMENT)
        from mjxgait.distributed.programs import Programs
        from mjxgait.training.devices import prepare_devices

        prepare_devices(1, tag)
        self._programs = Programs(_turn)

    def ready(self) -> int:
        """Its process, once it can work.

        Raises:
          OSError: there is no room for a creature's files.
        """
        from mjxgait.training.disk import try_room

        try_room(Path(tempfile.gettempdir()), ROOM)
        return os.getpid()

    def do(self, recipe: Any, job: Any) -> tuple[Any, float]:
        """The job's result, and how many seconds it took."""
        began = time.perf_counter()
        result = job.do(self._programs, recipe)
        return result, time.perf_counter() - began


@contextlib.contextmanager
def _turn(name: str, patience: float = -1.0) -> Iterator[None]:
    """Of all workers of a machine one compiles a program; the others then find it in the cache.

    Where nothing can be kept each compiles its own at once. patience: s; waits for ever by default.
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
