"""Useful creature-steps per second of a study's rows relative to a single run's, in turns.

    python benchmarks/rows.py --variants 4 --seeds 16 --generations 4

Both alternate by generation, with the shipped tall_quadruped or another creature, its own settings
and the same lanes; the study's variants differ in their mutation rate. Prints both rates for each
generation, the median ratio, and the peak memory of the process before and after.
"""

import argparse
import dataclasses
import resource
import time
from statistics import median

import jax

from mjxgait.config.layers import find_creature, resolve_config
from mjxgait.config.schema import Config
from mjxgait.config.tables import build, merge
from mjxgait.creature import load_creature
from mjxgait.training.experiment import build_batch, build_experiment
from mjxgait.training.stages import prepare_devices


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--variants", type=int, default=4)
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--generations", type=int, default=4)
    parser.add_argument("--env", default="tall_quadruped")
    parser.add_argument("--population", type=int, help="instead of the creature's own")
    parser.add_argument(
        "--seconds", type=float, help="of an episode, instead of the creature's own"
    )
    options = parser.parse_args()
    prepare_devices()
    creature = load_creature(find_creature(options.env))
    config = resolve_config(creature.settings.train, creature.name)
    table = {
        "evolution": {"population": options.population or config.evolution.population},
        "rollout": {"seconds": options.seconds or config.rollout.seconds},
    }
    config = build(Config, merge(dataclasses.asdict(config), table), "the options")
    single = build_experiment(creature, config)
    batch = build_batch(
        creature,
        [variant(config, v, s) for v in range(options.variants) for s in range(options.seeds)],
    )
    alone, rows = single.compile(), batch.compile()
    state, states = single.place(single.init()), batch.place(batch.init())
    before, ratios = memory(), []
    for generation in range(options.generations + 1):
        state, one = timed(alone, state)
        states, many = timed(rows, states)
        ratios.append(many / one)
        print(
            f"generation {generation}: alone {one / 1e6:.2f}, rows {many / 1e6:.2f} M steps/s, "
            f"ratio {many / one:.2f}",
            flush=True,
        )
    print(
        f"{len(batch.experiments)} rows: median ratio {median(ratios):.2f} ({min(ratios):.2f} to "
        f"{max(ratios):.2f})"
    )
    print(f"peak memory {before:.0f} MiB when compiled, {memory():.0f} MiB at the end")


def variant(config: Config, number: int, seed: int) -> Config:
    evolution = dataclasses.replace(
        config.evolution, mutation_rate=config.evolution.mutation_rate / (1 + number)
    )
    return dataclasses.replace(config, seed=seed, evolution=evolution)


def timed(step, state):
    """Return the next state, and useful steps per second."""
    began = time.perf_counter()
    state, metrics = jax.block_until_ready(step(state))
    return state, int(metrics.sim_steps.sum()) / (time.perf_counter() - began)


def memory() -> float:
    """Peak memory of this process in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
