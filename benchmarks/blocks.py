"""Cost of a step of a mixed population relative to the tall quadruped's, in turns on one core.

    python benchmarks/blocks.py

64 lanes. Modular bodies: 64 random ones, another in each lane, driven by sines on land and in
water. The quadruped treads. Processor time, best of the rounds; no controllers or tasks.
"""

import argparse
import dataclasses
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp

from mjxgait import load_creature
from mjxgait.controllers.sims_brain.genotype import Capacity, Ranges, random_graph
from mjxgait.controllers.sims_brain.phenotype import body_of
from mjxgait.evolution.chance import key_of
from mjxgait.physics import make_plant
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.physics.batched_trees.tree import Surroundings
from mjxgait.types import BodyState

LANES, STEPS = 64, 200
Run = Callable[[], BodyState]


def blocks(capacity: Capacity, around: Surroundings) -> Run:
    """Random bodies, dropped or afloat."""

    def grow(key: jax.Array):
        return body_of(random_graph(key, capacity, Ranges()), capacity)

    plant = TreePlant(around)
    bodies = jax.jit(jax.vmap(grow))(jax.random.split(key_of(0), LANES))
    trees = jax.vmap(plant.prepared)(bodies.tree)
    tree = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), trees)
    still = jnp.zeros((capacity.links + 5, LANES))
    qpos = jnp.zeros((capacity.links + 6, LANES)).at[2].set(0.4).at[3].set(1.0)
    torque = jnp.concatenate([still[:6], 0.3 * bodies.strength.T[1:]])
    return stepped(
        plant,
        BodyState(qpos, still, still, still, jnp.ones(LANES), parameters=tree),
        torque,
    )


def quadruped() -> Run:
    """The tall quadruped with whole-body contacts, as `train` simulates it."""
    creature = load_creature("tall_quadruped")
    plant, _ = make_plant(creature, "auto", False)
    qpos = jnp.tile(jnp.asarray(creature.stand_qpos, jnp.float32)[:, None], (1, LANES))
    still = jnp.zeros((creature.nv, LANES))
    body = BodyState(qpos, still, still, still, jnp.ones(LANES))
    return stepped(plant, body, still.at[6:].set(3.0))


def stepped(plant, body: BodyState, torque: jax.Array) -> Run:
    """Compile a pass, run it once and return it."""

    @jax.jit
    def go(body: BodyState, torque: jax.Array) -> BodyState:
        def one(step: jax.Array, body: BodyState) -> BodyState:
            _, step_data = plant.forward(body)
            return plant.advance(body, step_data, jnp.sin(0.05 * step) * torque)

        return jax.lax.fori_loop(0, STEPS, one, body)

    jax.block_until_ready(go(body, torque))
    return lambda: jax.block_until_ready(go(body, torque))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--links", type=int, nargs="+", default=[12, 16], help="room of a body")
    options = parser.parse_args()
    water = Surroundings(floor=False, gravity=0.0, drag=300.0)
    media = {"land": Surroundings(), "water": water}
    runs = {"tall quadruped": quadruped()}
    for links in options.links:
        capacity = Capacity(links=links)
        for name, around in media.items():
            runs[f"blocks, {links} links, {name}"] = blocks(capacity, around)
            pushing = dataclasses.replace(around, collide=True)
            runs[f"blocks, {links} links, {name}, collide"] = blocks(capacity, pushing)
    best = dict.fromkeys(runs, float("inf"))
    for _ in range(options.rounds):
        for name, run in runs.items():
            began = time.process_time()
            run()
            best[name] = min(best[name], time.process_time() - began)
    base = best["tall quadruped"]
    print("| | µs per creature-step | of the tall quadruped's rate |")
    print("|---|---|---|")
    for name, seconds in best.items():
        print(f"| {name} | {seconds / STEPS / LANES * 1e6:.2f} | {base / seconds:.2f} |")


if __name__ == "__main__":
    main()
