"""Cost of a step on each kind of ground, relative to the plane z = 0.

    python benchmarks/ground.py --env tall_quadruped duck --json ground.json

As in benchmarks/bodies.py: the plant's step with stable PD towards the standing pose, 64 lanes on
one core, no controller, episode statistics or genetic algorithm; heights above the ground are used.
All stand where the ground is level, so every variant steps through the same motion, in turns in one
process; a ratio is taken within a round.
"""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from bodies import LANES, STEPS, follow, start, timed
from peers.machine import machine_facts

from mjxgait.config.layers import find_creature
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.creature import start_place
from mjxgait.creature.ground.spec import parse_ground
from mjxgait.creature.ground.surface import lay_ground, named_draws
from mjxgait.physics import make_plant
from mjxgait.training.stages import prepare_devices
from mjxgait.types import BodyState, Plant, Sensed

WIDE: dict[str, str | bool] = {"xla_cpu_prefer_vector_width": "512"}
"""As in `mjxgait train`."""
GROUNDS = ("flat", "slope:0.1", "steps:0.05", "bumps:0.05", "rough:0.05")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--env", nargs="+", default=["tall_quadruped", "duck"])
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    prepare_devices()
    jax.config.update("jax_enable_compilation_cache", False)
    print("body            ground       us (best)        ratio  compile")
    rows = [row for env in options.env for row in measure(env, options.rounds)]
    if options.json:
        facts = {"lanes": LANES, "steps": STEPS, "machine": machine_facts(), "rows": rows}
        options.json.write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")


def measure(env: str, rounds: int) -> list[dict[str, Any]]:
    """us of processor time per creature-step in each round, and s to compile, per ground."""
    creature = load_creature(find_creature(env))
    plant, _ = make_plant(creature, "auto", True)
    if plant.lane_axis != -1:
        raise SystemExit(f"{env}: not a body for the fast plant")
    ways = {text: build(creature, plant, text) for text in GROUNDS}
    ends = [np.asarray(run()) for run, _ in ways.values()]
    turns = [{text: timed(run) for text, (run, _) in ways.items()} for _ in range(rounds)]
    rows = []
    for (text, (_, compile_s)), end in zip(ways.items(), ends, strict=True):
        us, apart = [turn[text] for turn in turns], float(np.abs(end - ends[0]).max())
        ratio = median(turn[text] / turn["flat"] for turn in turns)
        row = {"env": env, "ground": text, "us": us, "ratio": ratio, "compile_s": compile_s}
        rows.append(row | {"apart": apart})
        print(
            f"{env:15} {text:10} {median(us):5.2f} ({min(us):5.2f}) {ratio:10.2f} "
            f"{compile_s:6.1f} s   m, rad apart in the end: {apart:.1e}",
            flush=True,
        )
    return rows


def build(creature: Creature, plant: Plant, text: str) -> tuple[Callable[[], jax.Array], float]:
    """Return a pass of so many steps, and s to compile it."""
    spec = parse_ground(text)
    ground = lay_ground(spec, start_place(creature), named_draws(spec.seed))
    every = jax.tree.map(lambda leaf: jnp.tile(leaf[..., None], LANES), ground)
    arguments = BodyState(**{**vars(start(creature, None)), "ground": every}), jnp.zeros(LANES)

    def walk(state: BodyState, low: jax.Array) -> tuple[jax.Array, jax.Array]:
        def step(_: int, now: tuple[BodyState, jax.Array]) -> tuple[BodyState, jax.Array]:
            after, sensed = follow(creature, plant, now[0])
            return after, least(now[1], sensed)

        state, low = jax.lax.fori_loop(0, STEPS, step, (state, low))
        return state.qpos, low

    began = time.perf_counter()
    compiled = jax.jit(walk).lower(*arguments).compile(compiler_options=WIDE)
    compile_s = time.perf_counter() - began
    return lambda: jax.block_until_ready(compiled(*arguments))[0], compile_s


def least(low: jax.Array, sensed: Sensed) -> jax.Array:
    """Lowest height [L] of anything above the ground in m, so that heights cannot be omitted."""
    low = jnp.minimum(low, sensed.geom_low.min(0))
    return low if sensed.floor is None else jnp.minimum(low, sensed.trunk_pos[2] - sensed.floor)


if __name__ == "__main__":
    main()
