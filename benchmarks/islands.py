"""Islands against one population at equal evaluations, on the same seeds and starts.

    python benchmarks/islands.py runs/islands.json

All seeds and islands of a variant are rows of one program, so it takes minutes and no cluster. Each
variant is stored in the file when it ends; stored ones are not run again.
"""

import argparse
import dataclasses
import json
import time
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.api import load_creature
from mjxgait.config.evolution import IslandsConfig
from mjxgait.config.schema import Config
from mjxgait.config.tables import build, merge
from mjxgait.distributed.islands import exchanged
from mjxgait.evolution.state import EvolutionState
from mjxgait.experiments.ablation.findings import compare, estimate
from mjxgait.plugins import resolve_config
from mjxgait.training.checkpoint import Packed, pack
from mjxgait.training.experiment import build_batch
from mjxgait.training.stages import prepare_devices

WAYS = {
    "one population": IslandsConfig(1, 0),
    "no exchange": IslandsConfig(4, 0),
    "ring, every 5": IslandsConfig(4, 5),
    "ring, every 20": IslandsConfig(4, 20),
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--env", default="tall_quadruped")
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--population", type=int, default=128, help="of all islands together")
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=3.0, help="of an episode")
    parser.add_argument("--starts", type=int, default=2)
    options = parser.parse_args()
    prepare_devices()
    asked = {key: value for key, value in vars(options).items() if key != "file"}
    kept = json.loads(options.file.read_text()) if options.file.exists() else {"asked": asked}
    if kept["asked"] != asked:
        raise SystemExit(f"{options.file}: of other settings; name another file")
    for name, islands in WAYS.items():
        if name not in kept:
            kept[name] = best(options, islands)
            options.file.parent.mkdir(parents=True, exist_ok=True)
            options.file.write_text(json.dumps(kept) + "\n", encoding="utf-8")
    report(kept, options.generations)


def best(options: argparse.Namespace, islands: IslandsConfig) -> dict[str, Any]:
    """Return the best fitness [seed] of each generation."""
    creature = load_creature(options.env)
    config = resolve_config(creature.settings.train, creature.name)
    table = {
        "evolution": {"population": options.population // islands.count},
        "rollout": {"seconds": options.seconds, "starts": options.starts},
    }
    config = build(type(config), merge(dataclasses.asdict(config), table), "the benchmark")
    batch = build_batch(creature, rows(config, options.seeds, islands.count))
    begun = [one.init(row % islands.count) for row, one in enumerate(batch.experiments)]
    states = batch.place(jax.tree.map(lambda *leaves: jnp.stack(leaves), *begun))
    step, found, evaluations = batch.compile(), [], 0
    began, generation = time.perf_counter(), -1
    while generation < options.generations:
        if islands.every and generation > 0 and generation % islands.every == 0:
            states = batch.place(exchange(states, batch.abstract(), islands))
        states, metrics = step(states)
        generation = int(metrics.generation.max())
        evaluations += int(metrics.evaluations.sum())
        fitness = np.where(np.isfinite(metrics.best), metrics.best, -np.inf)
        found.append(fitness.reshape(options.seeds, islands.count).max(axis=1).tolist())
        print(islands, generation, round(time.perf_counter() - began), "s", flush=True)
    return {"best": found, "evaluations": evaluations // options.seeds}


def rows(config: Config, seeds: int, count: int) -> list[Config]:
    return [dataclasses.replace(config, seed=seed) for seed in range(seeds) for _ in range(count)]


def exchange(states: EvolutionState, abstract: Any, islands: IslandsConfig) -> EvolutionState:
    """Exchange individuals between the islands of each seed."""
    packed = pack(states)
    each = [
        Packed({name: array[row] for name, array in packed.arrays.items()}, packed.key_impl)
        for row in range(len(packed.arrays["fitness"]))
    ]
    after: list[Packed] = []
    for first in range(0, len(each), islands.count):
        after += exchanged(each[first : first + islands.count], islands)
    arrays = {name: np.stack([one.arrays[name] for one in after]) for name in packed.arrays}
    return Packed(arrays, packed.key_impl).state(abstract, "the islands")


def report(kept: dict[str, Any], last: int) -> None:
    for generation in (last // 2, last):
        values = {name: np.array(kept[name]["best"][generation - last - 1]) for name in WAYS}
        base, *others = values.values()
        print(f"\ngeneration {generation}: best fitness, trimmed mean of seeds with 95 % interval")
        found = [None, *compare(base, others, paired=True)]
        for (name, value), against in zip(values.items(), found, strict=True):
            own = estimate(value)
            text = f"{name:16} {own.value:.3f} ({own.low:.3f} to {own.high:.3f})"
            if against:
                gap = against.difference
                text += (
                    f"  against one population {gap.value:+.3f} ({gap.low:+.3f} to {gap.high:+.3f})"
                    f", p {against.corrected:.3f}"
                )
            print(text, f" {kept[name]['evaluations']} evaluations in all")


if __name__ == "__main__":
    main()
