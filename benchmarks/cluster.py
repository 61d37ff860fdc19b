"""What a cluster of Ray costs and what it bears, on simulated machines of one core each on this one.

    python benchmarks/cluster.py rows       # efficiency of a study's rows, two machines against one
    python benchmarks/cluster.py blocks     # the same of one population, and ms per generation over blocks
    python benchmarks/cluster.py calls      # ms per call and calls per second with work that does nothing
    python benchmarks/cluster.py faults     # twenty random kills in a study and in a run on islands
    python benchmarks/cluster.py paper FILE # 100 and 10,000 cores, reckoned from what was measured

Needs mjxgait[cluster] and two idle cores for `rows` and `blocks`: each machine is bound to a core.
Efficiency is the wall time with one machine over twice that with two, compilation not counted.
`--env`, `--seconds`, `--population`, `--generations` make it smaller; `--json FILE` keeps everything.
"""

import argparse
import contextlib
import dataclasses
import json
import os
import random
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "cluster"))

import jax
import psutil
from simulated import Machines, machines

from mjxgait.cluster import islands
from mjxgait.cluster.blocks import Blocks
from mjxgait.cluster.connect import connected
from mjxgait.cluster.crew import Crew
from mjxgait.cluster.jobs import AdvanceRows
from mjxgait.cluster.recipe import Recipe
from mjxgait.creature import Creature
from mjxgait.library import load_creature
from mjxgait.parts import resolve_config
from mjxgait.runs.experiment import build_experiment, prepare_devices
from mjxgait.runs.folder import CHAMPION, create_run
from mjxgait.runs.screen import Screen
from mjxgait.settings.config import Config
from mjxgait.settings.tables import build, merge

BLOCKS = (64, 256, 1024, 4096)


@dataclasses.dataclass(frozen=True)
class Nothing:
    """Work that brings back what it was given. size: bytes."""

    data: bytes

    def do(self, programs: Any, recipe: Any) -> bytes:
        return self.data


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("rows", "blocks", "calls", "faults", "paper"))
    parser.add_argument("measured", nargs="*", type=Path)
    parser.add_argument("--env", default="tall_quadruped")
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--population", type=int, default=128)
    parser.add_argument("--generations", type=int, default=5)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    if options.what == "paper":
        found = paper(options.measured)
    else:
        prepare_devices(1)
        found = {"rows": rows, "blocks": blocks, "calls": calls, "faults": faults}[options.what](
            options
        )
    found |= {"load": os.getloadavg()[0], "cores": os.cpu_count()}
    print(json.dumps(found, indent=2))
    if options.json:
        options.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def subject(options: argparse.Namespace, **evolution: Any) -> tuple[Creature, Config]:
    creature = load_creature(options.env)
    config = resolve_config(creature.settings.train, creature.name)
    table = {
        "rollout": {"seconds": options.seconds},
        "evolution": {"population": options.population, "generations": options.generations}
        | evolution,
        "examination": {"candidates": 0},
    }
    return creature, build(type(config), merge(dataclasses.asdict(config), table), "the benchmark")


@contextlib.contextmanager
def bound(count: int) -> Iterator[Machines]:
    """Machines of one core each, the n-th bound to core n; this process has what they leave."""
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


def rows(options: argparse.Namespace) -> dict[str, Any]:
    """Eight runs as pieces of work of one row each."""
    creature, config = subject(options)
    recipes = [Recipe.of(creature, [dataclasses.replace(config, seed=seed)]) for seed in range(8)]

    def seconds(crew: Crew, count: int) -> float:
        gather(crew, count)
        # Everybody compiles, and evolves from the same: what is timed is the rest.
        crew.all((recipes[0], AdvanceRows(None, 0)) for _ in range(2 * count))
        began = time.perf_counter()
        crew.all((recipe, AdvanceRows(None, options.generations)) for recipe in recipes)
        return time.perf_counter() - began

    return efficiency(seconds) | {"runs": len(recipes), "generations": options.generations}


def blocks(options: argparse.Namespace) -> dict[str, Any]:
    """One population, and what a generation costs beside the simulation, over its size."""
    creature, config = subject(options)
    found: dict[str, Any] = {}

    def seconds(crew: Crew, count: int) -> float:
        gather(crew, count)
        return timed_generations(crew, creature, config, options.generations)[0]

    found |= efficiency(seconds)
    found["ms beside the blocks"] = {}
    for population in BLOCKS:
        small = dataclasses.replace(
            config,
            rollout=dataclasses.replace(config.rollout, seconds=0.05, block=population),
            evolution=dataclasses.replace(config.evolution, population=population),
        )
        with bound(1) as made, connected(made.address, say) as crew:
            gather(crew, 1)
            _, beside = timed_generations(crew, creature, small, 5)
            found["ms beside the blocks"][population] = round(1000 * beside, 2)
    return found


def timed_generations(
    crew: Crew, creature: Creature, config: Config, count: int
) -> tuple[float, float]:
    """Wall time of so many generations, the first left out; and of one, the time that no worker worked."""
    experiment = build_experiment(creature, config)
    step = experiment.compile(Blocks(crew, creature, config))
    state, walls, works = experiment.place(experiment.init()), [], []
    for _ in range(count + 1):
        began, worked = time.perf_counter(), sum(crew.hands.seconds.values())
        state, _ = jax.block_until_ready(step(state))
        walls.append(time.perf_counter() - began)
        works.append(sum(crew.hands.seconds.values()) - worked)
    beside = [wall - work for wall, work in zip(walls, works, strict=True)]
    return sum(walls[1:]), median(beside[1:])


def efficiency(seconds: Any) -> dict[str, Any]:
    """Of two machines against one."""
    walls = {}
    for count in (1, 2):
        with bound(count) as made, connected(made.address, say) as crew:
            walls[count] = seconds(crew, count)
            say(f"{count} of one core: {walls[count]:.1f} s")
    return {"wall_s": walls, "efficiency": round(walls[1] / walls[2] / 2, 3)}


def calls(options: argparse.Namespace) -> dict[str, Any]:
    """With work that does nothing, hundreds of pieces at once."""
    recipe = Recipe({}, ())
    found: dict[str, Any] = {}
    with bound(2) as made, connected(made.address, say) as crew:
        gather(crew, 2)
        for size in (100, 10_000, 1_000_000):
            began, count = time.perf_counter(), 400
            crew.all((recipe, Nothing(bytes(size))) for _ in range(count))
            found[f"pieces per second, {size} bytes"] = round(count / (time.perf_counter() - began))
    creature, config = subject(options)
    state = build_experiment(creature, config).init()
    genes = sum(leaf.nbytes for leaf in jax.tree.leaves(state.genomes)) / options.population
    verdict = (state.terms.nbytes + state.outcome.nbytes) / options.population
    return found | {"bytes per genome": round(genes), "bytes per verdict": round(verdict)}


def faults(options: argparse.Namespace) -> dict[str, Any]:
    """A run on islands whose workers and machines are killed at random ends as one that nobody touched."""
    creature, config = subject(options, islands={"count": 4, "every": 1})
    chance, champions, losses = random.Random(0), [], []
    with machines(2) as made, tempfile.TemporaryDirectory() as scratch:
        spare, killed = [made.add()], 0
        for name, kills in (("quiet", 0), ("shaken", options.kills)):
            folder, said = Path(scratch) / name, []
            create_run(folder, creature, config)
            due = time.monotonic() + 10

            def harm(crew: Crew, kills: int = kills) -> None:
                nonlocal due, killed
                if killed >= kills or time.monotonic() < due:
                    return
                due, killed = time.monotonic() + chance.uniform(1, 8), killed + 1
                if chance.random() < 0.3:
                    made.kill(spare.pop())
                    spare.append(made.add())
                elif found := workers():
                    chance.choice(found).kill()

            with connected(made.address, said.append, harm) as crew:
                islands.train(folder, creature, config, Screen(), crew, resume=False)
            champions.append((folder / CHAMPION).read_text())
            losses.append(sum("is lost" in line for line in said))
    return {"kills": killed, "work lost": losses, "same champion": champions[0] == champions[1]}


def paper(files: list[Path]) -> dict[str, Any]:
    """From what `rows` and `calls` measured."""
    known: dict[str, Any] = {}
    for file in files:
        known |= json.loads(file.read_text())
    run_s = known["wall_s"]["1"] / known["runs"]
    rate = known["pieces per second, 10000 bytes"]
    each = known["bytes per genome"] + known["bytes per verdict"]
    found: dict[str, Any] = {}
    for cores in (100, 10_000):
        work, hand = 10_000 * run_s / cores, 10_000 / rate
        blocks_of = 1_000_000 / 64
        found[f"{cores} cores"] = {
            "study of 10,000 runs, hours": round(max(work, hand) / 3600, 2),
            "population of a million: s to hand out and collect its blocks": round(
                blocks_of / rate, 1
            ),
            "MB through this machine per generation": round(1e6 * each / 1e6),
        }
    return found


def workers() -> list[psutil.Process]:
    found = psutil.process_iter(["cmdline"])
    return [p for p in found if (p.info["cmdline"] or [""])[0].startswith("ray::RemoteWorker")]


def gather(crew: Crew, count: int) -> None:
    """Waits until all are there."""
    crew.next(lambda: len(crew.idle) >= count)


def say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
