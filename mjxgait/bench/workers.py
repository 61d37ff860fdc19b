"""A contestant on all cores: one process per core with a share of the episodes, run together."""

import multiprocessing
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Protocol

from mjxgait.bench.workload import Lap, Workload
from mjxgait.cores import cores, single_threaded


class Peer(Protocol):
    """A contestant's share of the work."""

    def lap(self) -> tuple[int, float]:
        """Simulate all its episodes; return useful steps, and the sum of distances forward in m."""
        ...


class Workers:
    """Processes that wait between laps, so that they take no time from other contestants.

    startup: s until all were ready.
    """

    def __init__(
        self,
        peer: Callable[[Workload, int, int], Peer],
        workload: Workload,
        count: int | None = None,
    ) -> None:
        count = count or cores()
        self.episodes = workload.episodes
        began = time.perf_counter()
        context = multiprocessing.get_context("spawn")
        pairs = [context.Pipe() for _ in range(count)]
        self.processes = [
            context.Process(target=_serve, args=(theirs, peer, workload, i, count), daemon=True)
            for i, (_, theirs) in enumerate(pairs)
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
        """Run the workload once."""
        began = time.perf_counter()
        for pipe in self.pipes:
            pipe.send("go")
        results = [pipe.recv() for pipe in self.pipes]
        seconds = time.perf_counter() - began
        steps, forward, processor = (sum(values) for values in zip(*results, strict=True))
        return Lap(seconds, steps, forward / self.episodes, processor)

    def close(self) -> None:
        """End the processes."""
        for pipe in self.pipes:
            pipe.close()
        for process in self.processes:
            process.join()


def _serve(
    pipe: Connection,
    peer: Callable[[Workload, int, int], Peer],
    workload: Workload,
    first: int,
    stride: int,
) -> None:
    contestant = peer(workload, first, stride)
    try:
        pipe.send("ready")
        while pipe.recv():
            began = time.process_time()
            pipe.send((*contestant.lap(), time.process_time() - began))
    except (EOFError, KeyboardInterrupt):
        pass
