"""A contestant on all cores: one process per core, each with its share of the episodes, started together and waited for together."""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Protocol

from mjxgait.bench.workload import Lap, Workload

SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""One process per core leaves no core for the threads of a linear algebra library."""


class Peer(Protocol):
    """A contestant's share of the work."""

    def lap(self) -> tuple[int, float]:
        """Simulates all its episodes; useful steps, and the sum of the distances forward in m."""
        ...


def cores() -> int:
    """That this process may use; a container often has fewer than the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def single_threaded() -> Iterator[None]:
    """Processes that are started in here use one thread each for their linear algebra."""
    before = {name: os.environ.get(name) for name in SINGLE_THREADED}
    os.environ.update(SINGLE_THREADED)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


class Workers:
    """Processes that wait between laps, so that they take nothing from the other contestants. startup: s until all were ready."""

    def __init__(self, peer: Callable[[Workload, int, int], Peer], workload: Workload, count: int | None = None) -> None:
        count = count or cores()
        self.episodes = workload.episodes
        began = time.perf_counter()
        context = multiprocessing.get_context("spawn")
        pairs = [context.Pipe() for _ in range(count)]
        self.processes = [
            context.Process(target=_serve, args=(theirs, peer, workload, i, count), daemon=True) for i, (_, theirs) in enumerate(pairs)
        ]
        with single_threaded():
            for process in self.processes:
                process.start()
        self.pipes = [ours for ours, _ in pairs]
        for _, theirs in pairs:
            theirs.close()
        for pipe in self.pipes:
            pipe.recv()
        self.startup = time.perf_counter() - began

    def lap(self) -> Lap:
        """One pass over the workload."""
        began = time.perf_counter()
        for pipe in self.pipes:
            pipe.send("go")
        results = [pipe.recv() for pipe in self.pipes]
        seconds = time.perf_counter() - began
        steps, forward, processor = (sum(values) for values in zip(*results, strict=True))
        return Lap(seconds, steps, forward / self.episodes, processor)

    def close(self) -> None:
        """Ends the processes."""
        for pipe in self.pipes:
            pipe.close()
        for process in self.processes:
            process.join()


def _serve(pipe: Connection, peer: Callable[[Workload, int, int], Peer], workload: Workload, first: int, stride: int) -> None:
    contestant = peer(workload, first, stride)
    try:
        pipe.send("ready")
        while pipe.recv():
            began = time.process_time()
            pipe.send((*contestant.lap(), time.process_time() - began))
    except (EOFError, KeyboardInterrupt):
        pass
