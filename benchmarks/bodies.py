"""Cost of a step with the body's numbers as constants, as inputs, or as one set per lane.

    python benchmarks/bodies.py --env tall_quadruped duck --json bodies.json

A step is the plant's with stable PD towards the standing pose: 64 lanes on one core, no controller,
episode statistics or genetic algorithm. All variants step the same bodies (equal in all lanes)
through the same motion, in turns in one process; a ratio is taken within a round.

- constants: the numbers are part of the program, as in `mjxgait train`.
- inputs: one body for all lanes; its numbers are arguments of the program, which fits any body of
  this topology.
- lanes: a body per lane, in the state.
"""

import argparse
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from peers.machine import machine_facts

from mjxgait.config.layers import find_creature
from mjxgait.controllers import spd
from mjxgait.creature import Creature, load_creature
from mjxgait.physics import make_plant
from mjxgait.training.stages import prepare_devices
from mjxgait.types import BodyState, ModelPlant, Plant, Sensed

LANES = 64
STEPS = 400


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
    rows = []
    print("body             numbers  way        us (best)        ratio  compile")
    for env in options.env:
        rows += measure(env, options.rounds)
    if options.json:
        facts = {"lanes": LANES, "steps": STEPS, "machine": machine_facts(), "rows": rows}
        options.json.write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")


def measure(env: str, rounds: int) -> list[dict[str, Any]]:
    """us of processor time per creature-step in each round, and s to compile, per variant."""
    creature = load_creature(find_creature(env))
    plant, _ = make_plant(creature, "auto", True)
    if plant.lane_axis != -1:
        raise SystemExit(f"{env}: not a body for the fast plant")
    numbers = jax.tree.map(jnp.float32, plant.parameters)
    every = jax.tree.map(lambda x: jnp.tile(x[..., None], LANES), numbers)
    ways = {
        "constants": build(creature, plant, None, None),
        "inputs": build(creature, plant, numbers, None),
        "lanes": build(creature, plant, None, every),
    }
    ends = [np.asarray(run()) for run, _ in ways.values()]
    told = [np.abs(end - ends[0]).max() for end in ends]
    turns = [{name: timed(run) for name, (run, _) in ways.items()} for _ in range(rounds)]
    rows = []
    for (name, (_, compile_s)), apart in zip(ways.items(), told, strict=True):
        us = [turn[name] for turn in turns]
        ratio = median(turn[name] / turn["constants"] for turn in turns)
        size = sum(x.size for x in jax.tree.leaves(numbers))
        rows.append(
            {"env": env, "way": name, "us": us, "ratio": ratio, "compile_s": compile_s}
            | {"numbers": size, "apart": float(apart)}
        )
        print(
            f"{env:15} {size:8}  {name:10} {median(us):5.2f} ({min(us):5.2f}) {ratio:10.2f} "
            f"{compile_s:6.1f} s   m, rad apart in the end: {apart:.1e}",
            flush=True,
        )
    return rows


def build(
    creature: Creature, plant: ModelPlant, numbers: Any, every: Any
) -> tuple[Callable[[], jax.Array], float]:
    """Return a pass of so many steps, and s to compile it.

    numbers: of one body for all lanes; every: of one per lane; None for constants.
    """

    def walk(numbers: Any, state: BodyState) -> jax.Array:
        own = plant if numbers is None else plant.with_parameters(numbers)
        step = partial(follow, creature, own)
        return jax.lax.fori_loop(0, STEPS, lambda _, now: step(now)[0], state).qpos

    arguments = numbers, start(creature, every)
    began = time.perf_counter()
    compiled = jax.jit(walk).lower(*arguments).compile()
    compile_s = time.perf_counter() - began
    return lambda: jax.block_until_ready(compiled(*arguments)), compile_s


def start(creature: Creature, every: Any) -> BodyState:
    """Return the standing pose [lanes last], the joints a little off, differently in each lane."""
    qpos = np.tile(creature.stand_qpos[:, None], LANES)
    noise = np.random.default_rng(0).uniform(-0.1, 0.1, (len(creature.joints.qpos_adr), LANES))
    qpos[creature.joints.qpos_adr] += noise
    still = jnp.zeros((creature.model.nv, LANES))
    return BodyState(jnp.asarray(qpos, jnp.float32), still, still, still, jnp.ones(LANES), every)


def follow(creature: Creature, plant: Plant, state: BodyState) -> tuple[BodyState, Sensed]:
    """Return the state after a step of stable PD towards standing, and what was sensed before."""
    step = float(creature.model.opt.timestep)
    kp, kd, limit, goal = (
        jnp.asarray(x, jnp.float32)[:, None]
        for x in (
            creature.gains.kp,
            creature.gains.kd,
            creature.gains.torque_limit,
            creature.joints.stand,
        )
    )
    sensed, step_data = plant.forward(state)
    pull = spd.pd_force(sensed.joint_pos, sensed.joint_vel, goal, kp, kd, step)
    lift = partial(lifted, creature)
    force = lift(pull) + state.constraint_force - sensed.bias
    braked = jnp.broadcast_to(step * kd, pull.shape)
    acceleration = plant.solve_damped(step_data, lift(braked), force)
    torque = spd.limited_torque(pull, acceleration[creature.joints.dof_adr], braked, limit)
    return plant.advance(state, step_data, lift(torque)), sensed


def lifted(creature: Creature, joints: jax.Array) -> jax.Array:
    """Pad joint values [J, L] to all degrees of freedom; the joints are the last ones."""
    first = int(creature.joints.dof_adr[0])
    assert list(creature.joints.dof_adr) == list(range(first, creature.model.nv))
    return jnp.pad(joints, ((first, 0), (0, 0)))


def timed(run: Callable[[], object]) -> float:
    """us of processor time per creature-step."""
    began = time.process_time()
    run()
    return 1e6 * (time.process_time() - began) / (STEPS * LANES)


if __name__ == "__main__":
    main()
