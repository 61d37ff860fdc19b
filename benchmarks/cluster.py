"""Costs of a Ray cluster, measured on simulated machines of one core each on this machine.

    python benchmarks/cluster.py rows blocks overhead calls --json FILE

- rows: efficiency of a study's rows, two machines against one
- blocks: the same of one population, evaluated in chunks
- overhead: ms per generation besides the simulation, by chunk size
- calls: costs of dispatching, collecting and storing

Needs mjxgait[cluster] and two idle cores: each machine is bound to a core. One machine and two take
turns; efficiency is the median over laps of the wall time with one over twice that with two,
compilation not counted. On a busy machine it means nothing; there the workers' processor time with
one over that with two shows how much they slow each other down. The file keeps everything,
including results of earlier calls; `cluster_paper.py` uses it.
"""

import argparse
import contextlib
import dataclasses
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, cast

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "cluster"))

import jax
from simulated import Machines, machines

from mjxgait.api import load_creature
from mjxgait.config.schema import Config
from mjxgait.config.tables import build, merge
from mjxgait.creature import Creature
from mjxgait.distributed.connect import connected
from mjxgait.distributed.jobs import AdvanceRows, Job, Recipe
from mjxgait.distributed.rows import ChunkedEvaluator
from mjxgait.distributed.scheduler import Scheduler
from mjxgait.plugins import resolve_config
from mjxgait.simulation.evaluator import Evaluator
from mjxgait.tasks.starts import Starts
from mjxgait.training.checkpoint import Checkpoints, pack
from mjxgait.training.experiment import build_experiment
from mjxgait.training.stages import prepare_devices
from mjxgait.types import Evaluation, RequestedTrials

if TYPE_CHECKING:
    from mjxgait.distributed.ray_backend import RayBackend

SIZES = (64, 256, 1024, 4096)
"""Individuals per chunk; the population has the largest size."""
RUNS = 8


@dataclasses.dataclass(frozen=True)
class Nothing:
    """Job that returns its data after so many seconds."""

    data: bytes = b""
    seconds: float = 0.0

    def do(self, programs: Any, recipe: Any) -> bytes:
        time.sleep(self.seconds)
        return self.data


@dataclasses.dataclass(frozen=True)
class Clocked:
    """Another job, with the processor time that it took."""

    job: Job

    def do(self, programs: Any, recipe: Any) -> tuple[Any, float]:
        began = time.process_time()
        return self.job.do(programs, recipe), time.process_time() - began


class Clock:
    """Scheduler that measures its jobs; processor: s of processor time in all."""

    def __init__(self, scheduler: Scheduler) -> None:
        self.scheduler, self.processor = scheduler, 0.0

    def all(self, work: Iterable[tuple[Recipe, Job]]) -> list[Any]:
        found = self.scheduler.all((recipe, Clocked(job)) for recipe, job in work)
        done = found or []
        self.processor += sum(seconds for _, seconds in done)
        return [result for result, _ in done]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    stages = {"rows": rows, "blocks": blocks, "overhead": overhead, "calls": calls}
    parser.add_argument("what", nargs="+", choices=stages)
    parser.add_argument("--env", default="tall_quadruped")
    parser.add_argument("--seconds", type=float, default=4.0, help="of an episode")
    parser.add_argument("--generations", type=int, default=4)
    parser.add_argument("--laps", type=int, default=3)
    parser.add_argument("--json", type=Path, required=True)
    options = parser.parse_args()
    found = json.loads(options.json.read_text()) if options.json.exists() else {}
    prepare_devices(1)
    with bound(2) as made, connected(made.address, say) as scheduler:
        for name in options.what:
            load = [round(os.getloadavg()[0], 1)]
            gather(scheduler, 2)
            found[name] = stages[name](scheduler, options)
            load.append(round(os.getloadavg()[0], 1))
            found[name] |= {"cores": os.cpu_count(), "load before and after": load}
            print(name, json.dumps(found[name], indent=2, ensure_ascii=False), flush=True)
            options.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def subject(
    options: argparse.Namespace, population: int, **rollout: Any
) -> tuple[Creature, Config]:
    creature = load_creature(options.env)
    config = resolve_config(creature.settings.train, creature.name)
    table = {
        "rollout": {"seconds": options.seconds} | rollout,
        "evolution": {"population": population},
        "examination": {"candidates": 0},
    }
    return creature, build(type(config), merge(dataclasses.asdict(config), table), "the benchmark")


def rows(scheduler: Scheduler, options: argparse.Namespace) -> dict[str, Any]:
    """Eight runs as jobs of one row each."""
    creature, config = subject(options, 128)
    recipes = [
        Recipe.of(creature, [dataclasses.replace(config, seed=seed)]) for seed in range(RUNS)
    ]

    clock = Clock(scheduler)

    def work(until: int = options.generations) -> None:
        clock.all((recipe, AdvanceRows(None, until)) for recipe in recipes)

    for machine in (0, 1):
        with one_of(scheduler, machine):
            work(0)  # each machine builds and compiles everything
    found = in_turns(clock, work, options.laps)
    return found | {"runs": RUNS, "generations": options.generations}


def blocks(scheduler: Scheduler, options: argparse.Namespace) -> dict[str, Any]:
    """Generations of one population, in eight chunks."""
    creature, config = subject(options, 512)
    experiment = build_experiment(creature, config)
    clock = Clock(scheduler)
    step = experiment.compile(ChunkedEvaluator(cast(Scheduler, clock), creature, config))
    begun = experiment.place(experiment.init())
    for machine in (0, 1):
        with one_of(scheduler, machine):
            begun, _ = step(begun)

    def work() -> None:
        state = begun
        for _ in range(options.generations):
            state, _ = step(state)
        jax.block_until_ready(state)

    before, spent = sum(scheduler.done.values()), clock.processor
    found = in_turns(clock, work, options.laps)
    pieces = sum(scheduler.done.values()) - before
    return found | {
        "blocks per generation": 8,
        "generations": options.generations,
        "s of a processor per block": round((clock.processor - spent) / pieces, 4),
    }


def overhead(scheduler: Scheduler, options: argparse.Namespace) -> dict[str, Any]:
    """Wall time that the only machine spends idle, with the shortest episodes."""
    found: dict[str, Any] = {"population": SIZES[-1]}
    for size in SIZES:
        creature, config = subject(options, SIZES[-1], seconds=0.05, block=size)
        evaluation = Timed(ChunkedEvaluator(scheduler, creature, config))
        experiment = build_experiment(creature, config)
        step = experiment.compile(evaluation)
        state = experiment.place(experiment.init())
        beside, rest = [], []
        with one_of(scheduler, 0):
            for _ in range(6):
                began, worked, evaluation.seconds = time.perf_counter(), work_of(scheduler), 0.0
                state, _ = jax.block_until_ready(step(state))
                wall = time.perf_counter() - began
                beside.append(evaluation.seconds - (work_of(scheduler) - worked))
                rest.append(wall - evaluation.seconds)
        found[f"blocks of {size}"] = {
            "ms beside the blocks": round(1000 * median(beside[1:]), 1),
            "ms per block": round(1000 * median(beside[1:]) * size / SIZES[-1], 2),
            "ms of the generation's own programs": round(1000 * median(rest[1:]), 1),
        }
    return found


def calls(scheduler: Scheduler, options: argparse.Namespace) -> dict[str, Any]:
    """Costs of jobs that do nothing, hundreds at once, and this process's time for them."""
    recipe, found = Recipe({}, ()), dict[str, Any]()
    for size in (100, 10_000, 1_000_000):
        count = 400
        began, spent = time.perf_counter(), time.process_time()
        scheduler.all((recipe, Nothing(bytes(size))) for _ in range(count))
        found[f"pieces per second, {size} bytes"] = round(count / (time.perf_counter() - began))
        spent = 1000 * (time.process_time() - spent) / count
        found[f"ms of this process per piece, {size} bytes"] = round(spent, 3)
    with one_of(scheduler, 0):
        began = time.perf_counter()
        scheduler.all((recipe, Nothing()) for _ in range(200))
        found["ms there and back"] = round(1000 * (time.perf_counter() - began) / 200, 2)
    creature, config = subject(options, 128)
    state = build_experiment(creature, config).init()
    people = len(state.fitness)
    found["bytes per genome"] = (
        sum(leaf.nbytes for leaf in jax.tree.leaves(state.genomes)) // people
    )
    found["bytes per verdict"] = (state.terms.nbytes + state.outcome.nbytes) // people
    found["ms to put a row's state on disk"] = storing(creature, state)
    return found | {
        "µs per piece under way and look": looking(scheduler)
    }  # last: leaves a worker busy


def looking(scheduler: Scheduler) -> float:
    """us of `ray.wait` per result that is not there yet."""
    import ray  # only after `simulated` has set its environment

    actor, _ = next(iter(backend_of(scheduler)._actors.values()))
    recipe = ray.put(Recipe({}, ()))
    refs = [actor.do.remote(recipe, Nothing(seconds=0.02)) for _ in range(1000)]
    began, count = time.perf_counter(), 50
    for _ in range(count):
        ray.wait(refs[500:], num_returns=500, timeout=0)
    return round(1e6 * (time.perf_counter() - began) / count / 500, 2)


def storing(creature: Creature, state: Any) -> float:
    with tempfile.TemporaryDirectory() as scratch:
        store = Checkpoints(Path(scratch))
        began = time.perf_counter()
        for generation in range(20):
            store.keep(
                pack(dataclasses.replace(state, generation=jax.numpy.int32(generation))),
                creature.name,
                creature.digest,
            )
        store.close()
        return round(1000 * (time.perf_counter() - began) / 20, 1)


class Timed:
    """See `Evaluator`: another one, with the time that it took."""

    def __init__(self, evaluator: Evaluator) -> None:
        self._evaluator, self.seconds = evaluator, 0.0

    def evaluate(
        self, genomes: Any, trials: Starts, settings: Config, asked: RequestedTrials | None = None
    ) -> Evaluation:
        jax.block_until_ready(genomes)
        began = time.perf_counter()
        found = self._evaluator.evaluate(genomes, trials, settings, asked)
        self.seconds += time.perf_counter() - began
        return found


@contextlib.contextmanager
def bound(count: int) -> Iterator[Machines]:
    """Machines of one core each, the n-th bound to core n; this process is not bound."""
    before = os.sched_getaffinity(0)
    cores = sorted(before)
    os.sched_setaffinity(0, {cores[0]})
    try:
        with machines(1) as made:
            for core in cores[1:count]:
                os.sched_setaffinity(0, {core})
                made.add()
            os.sched_setaffinity(0, before)
            yield made
    finally:
        os.sched_setaffinity(0, before)


@contextlib.contextmanager
def one_of(scheduler: Scheduler, machine: int) -> Iterator[None]:
    """Let one of two machines do everything."""
    gather(scheduler, 2)
    scheduler.idle.sort(key=lambda worker: worker.number)
    resting = scheduler.idle.pop(1 - machine)
    yield
    scheduler.idle.append(resting)
    gather(scheduler, 2)


def in_turns(clock: Clock, work: Callable[[], None], laps: int) -> dict[str, Any]:
    walls: dict[str, list[float]] = {"one": [], "two": []}
    spent: dict[str, list[float]] = {"one": [], "two": []}

    def lap(machines: str) -> None:
        began, before = time.perf_counter(), clock.processor
        work()
        walls[machines].append(round(time.perf_counter() - began, 3))
        spent[machines].append(round(clock.processor - before, 3))
        say(f"{machines}: {walls[machines][-1]} s, of processors {spent[machines][-1]} s")

    for number in range(laps):
        with one_of(clock.scheduler, number % 2):
            lap("one")
        lap("two")
    ratio = {
        name: [one / two for one, two in zip(times["one"], times["two"], strict=True)]
        for name, times in (("wall", walls), ("processor", spent))
    }
    return {
        "wall_s": walls,
        "processor_s": spent,
        "efficiency": round(median(ratio["wall"]) / 2, 3),
        "processor time, one over two": round(median(ratio["processor"]), 3),
    }


def backend_of(scheduler: Scheduler) -> "RayBackend":
    """The scheduler's backend, which is Ray's."""
    return cast("RayBackend", scheduler.backend)


def work_of(scheduler: Scheduler) -> float:
    """Seconds of work of all workers."""
    return float(sum(backend_of(scheduler).seconds.values()))


def gather(scheduler: Scheduler, count: int) -> None:
    """Wait until all workers are idle."""
    scheduler.next(lambda: len(scheduler.idle) >= count)


def say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
