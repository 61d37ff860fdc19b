"""Processes that the package starts, and the cores that they use.

Python puts the current folder, or the folder of the script, first on the path of modules; a file
`json.py` there would run in place of Python's own. `-P` leaves it out, and `PYTHONSAFEPATH` does so
for processes started further down.
"""

import concurrent.futures
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from mjxgait.errors import UserError

SAFE_PATH = {"PYTHONSAFEPATH": "1"}


def python_command(module: str, *words: str) -> list[str]:
    """Return the command that runs a module of this package in a new process."""
    return [sys.executable, "-P", "-m", module, *words]


def safe_environment() -> dict[str, str]:
    """Return the environment of a new process."""
    return {**os.environ, **SAFE_PATH}


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for the duration of the block."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


Item = TypeVar("Item")
Done = TypeVar("Done")

SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""One process per core leaves no core for the threads of a linear algebra library."""


def cores() -> int:
    """Return the number of cores available to this process; in a container often not all."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def single_threaded() -> Iterator[None]:
    """Limit processes started in this block to one linear algebra thread each.

    None of them looks for modules in the current folder.
    """
    with environment({**SINGLE_THREADED, **SAFE_PATH}):
        yield


@contextmanager
def process_per_core(
    most: int | None = None, prepare: Callable[[], object] | None = None
) -> Iterator[concurrent.futures.Executor]:
    """Yield a pool of fresh processes, at most `most`; only the waiting process handles Ctrl-C.

    prepare: called in each before its first work.
    """
    count = min(cores(), most or cores())
    context = multiprocessing.get_context(
        "spawn"
    )  # a fork of a process in which JAX has threads may hang
    with (
        single_threaded(),
        concurrent.futures.ProcessPoolExecutor(count, context, _begin, (prepare,)) as pool,
    ):
        try:
            _start(pool, count)
            yield pool
        except concurrent.futures.BrokenExecutor:
            # The pool waits forever for a process that was starting while another was killed.
            for child in multiprocessing.active_children():
                child.kill()
            raise


@contextmanager
def survivable(folder: Path, again: str) -> Iterator[None]:
    """Raise a UserError with the way to go on if a process was killed, such as for lack of memory.

    again: the command that goes on.
    """
    try:
        yield
    except BrokenProcessPool:
        raise UserError(
            f"{folder}: a process that examined champions was killed from outside, perhaps for "
            f"want of memory; what was examined before is kept: go on with {again}"
        ) from None


def one_per_core(
    work: Callable[[Item], Done],
    items: Sequence[Item],
    tell: Callable[[int, int], object],
    *,
    folder: Path,
    again: str,
    prepare: Callable[[], object] | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> list[Done] | None:
    """Return the result of each item, in order; None if stopped before all were done.

    tell: called with the number done and the total. folder, again: see `survivable`. prepare: see
    `process_per_core`.

    Raises:
      UserError: a process was killed from outside.
    """
    if not items:
        return []
    with survivable(folder, again), process_per_core(len(items), prepare) as pool:
        futures = [pool.submit(work, item) for item in items]
        try:
            for number, done in enumerate(concurrent.futures.as_completed(futures), 1):
                done.result()
                tell(number, len(items))
                if number < len(items) and stopped():
                    pool.shutdown(cancel_futures=True)
                    return None
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
        return [done.result() for done in futures]


def _start(pool: concurrent.futures.Executor, count: int) -> None:
    """Start all processes at once, so that none starts later while another is killed.

    A pool that loses a process closes its queues. A process being started then meets a closed
    handle (OSError), or its number taken by another file (ValueError).
    """
    try:
        with _interrupts_held():
            for _ in range(count):
                pool.submit(int)
    except (OSError, ValueError) as error:
        raise BrokenProcessPool("a process was killed as the others were started") from error


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back in this thread, and for good in processes that it starts.

    A process that is importing modules would print a traceback before `_begin` can prevent it.
    """
    if not hasattr(signal, "pthread_sigmask"):  # as on Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(prepare: Callable[[], object] | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare is not None:
        prepare()


def _end_with_parent() -> None:
    """End this process if the one that started it is killed; else it would wait forever."""
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(1)
