"""Model of a large cluster: the real scheduler, with a backend and clock of measured costs.

    python benchmarks/cluster_paper.py FILE          # that `cluster.py rows blocks calls` wrote
    python benchmarks/cluster_paper.py FILE --check  # the same against Ray, with tiny fake work

Counted: the seconds of a job; this machine's costs of dispatching and collecting, serially, by
number and bytes; a check of all running jobs at every turn; storing the results on disk. Not
counted: Ray's own limits in numbers of machines and actors, real networks, compilation.
"""

import argparse
import dataclasses
import heapq
import json
import time
from collections.abc import Hashable
from pathlib import Path
from statistics import median
from typing import Any, cast

from cluster import Nothing, gather, say
from simulated import machines

from mjxgait.api.studies import ROWS, STRIDE
from mjxgait.distributed.connect import connected
from mjxgait.distributed.jobs import Job, Recipe
from mjxgait.distributed.scheduler import Report, Scheduler, Worker

RUNS, PEOPLE, BLOCK = 10_000, 1_000_000, 64
MB = 1e6


@dataclasses.dataclass(frozen=True)
class Costs:
    """Costs on this machine in seconds.

    Per job, per byte, and per check of a running job; latency: of one job.
    """

    piece: float
    byte: float
    look: float
    latency: float

    @classmethod
    def of(cls, calls: dict[str, Any]) -> "Costs":
        """Return the costs that `cluster.py calls` found."""
        spent = [calls[f"ms of this process per piece, {n} bytes"] / 1e3 for n in (100, 1_000_000)]
        # The bytes travel both ways.
        return cls(
            piece=spent[0],
            byte=max(spent[1] - spent[0], 0.0) / 2e6,
            look=calls["µs per piece under way and look"] / 1e6,
            latency=calls["ms there and back"] / 1e3,
        )


@dataclasses.dataclass(frozen=True)
class Piece:
    """Modelled job: its duration, the bytes sent there and back; disk: s to store the result."""

    seconds: float
    size: int
    disk: float = 0.0


class Paper:
    """See `Backend`. Its clock is the scheduler's; this machine's own work advances it."""

    def __init__(self, workers: int, costs: Costs) -> None:
        self.now, self.costs = 0.0, costs
        self._coming = [Worker(number, "paper") for number in range(workers)]
        self._ends: list[tuple[float, int, Worker, Piece]] = []
        self.worked = 0.0

    def arrivals(self) -> list[Worker]:
        coming, self._coming = self._coming, []
        return coming

    def start(self, worker: Worker, recipe: Any, job: Any) -> None:
        self.now += self.costs.piece + self.costs.byte * job.size
        self.worked += job.seconds
        end = self.now + self.costs.latency + job.seconds
        heapq.heappush(self._ends, (end, worker.number, worker, job))

    def wait(self, seconds: float) -> list[Report]:
        self.now += self.costs.look * len(self._ends)
        first = self._ends[0][0] if self._ends else self.now + seconds
        self.now = max(self.now, min(first, self.now + seconds))
        done = []
        while self._ends and self._ends[0][0] <= self.now:
            _, _, worker, job = heapq.heappop(self._ends)
            done.append(Report(worker, job))
        self.now += sum(report.value.disk for report in done)
        return done


def on_paper(
    workers: int, costs: Costs, piece: Piece, count: int, in_a_row: int = 1
) -> tuple[float, float]:
    """Seconds for `count` chains of `in_a_row` jobs each, and the share of time that workers work.

    Each job of a chain follows on the one before.
    """
    hands = Paper(workers, costs)
    scheduler = Scheduler(hands, clock=lambda: hands.now)
    left: dict[Hashable, int] = dict.fromkeys(range(count), in_a_row)
    recipe, job = Recipe({}, ()), cast(Job, piece)  # `Paper` does nothing with either
    for key in left:
        scheduler.submit(key, lambda: (recipe, job))
    while left:
        ended = scheduler.next(bool)
        assert ended is not None  # nothing stops it
        key = ended[0]
        left[key] -= 1
        if left[key]:
            scheduler.submit(key, lambda: (recipe, job), first=True)
        else:
            del left[key]
    return hands.now, count * in_a_row * piece.seconds / (workers * hands.now)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    known = json.loads(options.file.read_text())
    costs = Costs.of(known["calls"])
    say(str(costs))
    print(json.dumps(checked(costs) if options.check else reckoned(known, costs), indent=2))


def reckoned(known: dict[str, Any], costs: Costs) -> dict[str, Any]:
    rows, calls, blocks = known["rows"], known["calls"], known["blocks"]
    of_one = median(rows["processor_s"]["one"]) / rows["runs"] / (rows["generations"] + 1)
    state = 128 * (calls["bytes per genome"] + calls["bytes per verdict"])
    disk, last = calls["ms to put a row's state on disk"] / 1e3, 30
    each = BLOCK * (calls["bytes per genome"] + calls["bytes per verdict"]) // 2
    found: dict[str, Any] = {"s per generation of a run": round(of_one, 3)}
    for cores in (100, 10_000):
        for rows_of, stride in ((ROWS, STRIDE), (1, STRIDE), (1, last)):
            piece = Piece(rows_of * stride * of_one, rows_of * state, disk)
            wall, used = on_paper(cores, costs, piece, RUNS // rows_of, last // stride)
            found[
                f"{cores} cores: {RUNS} runs of {last} generations, "
                f"{rows_of} runs and {stride} generations a piece"
            ] = told(wall, used)
        for block in (BLOCK, 1024):
            piece = Piece(
                blocks["s of a processor per block"] * block / BLOCK, each * block // BLOCK
            )
            wall, used = on_paper(cores, costs, piece, -(-PEOPLE // block))
            found[f"{cores} cores: one generation of a million, blocks of {block}"] = told(
                wall, used
            )
    return found


def told(wall: float, used: float) -> str:
    return f"{wall:.0f} s, cores at work {used:.0%}"


def checked(costs: Costs) -> dict[str, Any]:
    """Compare with 16 real workers that sleep: on two cores, jobs must compute little."""
    workers, count, found = 16, 400, {}
    with machines(1) as made:
        made.add(cores=workers - 1)
        with connected(made.address, say) as scheduler:
            gather(scheduler, workers)
            recipe = Recipe({}, ())
            for seconds in (0.02, 0.1, 0.3):
                began = time.perf_counter()
                scheduler.all((recipe, Nothing(bytes(1000), seconds)) for _ in range(count))
                wall = time.perf_counter() - began
                paper, _ = on_paper(workers, costs, Piece(seconds, 1000), count)
                found[f"{count} pieces of {seconds} s"] = (
                    f"{wall:.2f} s, on paper {paper:.2f} s ({paper / wall - 1:+.0%})"
                )
    return found | {"workers": workers}


if __name__ == "__main__":
    main()
