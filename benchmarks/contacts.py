"""Cost of a step by number of contact points: the plant's, and C MuJoCo's beside it.

    python benchmarks/contacts.py --points 4 8 12 20 --json contacts.json

A shipped body gets additional spheres that reach down to the floor, spread over its feet (`feet`),
over all its moving bodies (`all`), or over all at 20 cm above the floor (`high`: points that could
touch and do not). In C MuJoCo it treads on the spot for a second under stable PD, 64 times. The
plant (single precision, 64 lanes) and C (double precision, one after the other) then step those
states again, in turns, each on one core. A step is `forward` and `advance` of the plant and
`mj_step` of C, without any controller. Prints a table and writes everything as JSON. Compiling the
plant takes most of the time: minutes for 32 points and more.
"""

import argparse
import dataclasses
import json
import tempfile
import time
import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import tomli_w
from mujoco import rollout
from peers.machine import machine_facts

from mjxgait.config.layers import data_folder
from mjxgait.creature import Creature, load_creature
from mjxgait.physics import make_plant
from mjxgait.training.stages import prepare_devices
from mjxgait.types import BodyState, Plant

LANES = 64
STEPS = 200
RADIUS = 0.015
ABOVE = {"feet": 0.0, "all": 0.0, "high": 0.2}
"""Height of a placement's lowest points above the floor in m."""


@dataclasses.dataclass(frozen=True)
class Trace:
    """States of treading bodies, lane after lane, and the torques they apply; all [L * T, n]."""

    qpos: np.ndarray
    qvel: np.ndarray
    warmstart: np.ndarray
    torque: np.ndarray


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--env", nargs="+", default=["tall_quadruped"])
    parser.add_argument("--placement", nargs="+", choices=ABOVE, default=["all"])
    parser.add_argument("--points", nargs="+", type=int, default=[4, 8, 12, 20, 32, 40])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    prepare_devices()
    facts = {"lanes": LANES, "steps": STEPS, "machine": machine_facts()}
    points: list[dict[str, Any]] = []
    print(
        "body            placement points  near  ours, us (best)    C, us (best)  C/ours  compile"
    )
    for env in options.env:
        own = len(load_creature(data_folder("envs") / env).feet.foot_of)
        for placement in options.placement:
            for count in (n for n in options.points if n >= own):
                points.append(measure(env, placement, count, options.rounds))
                print(line(points[-1]), flush=True)
                if options.json:
                    written = json.dumps(facts | {"points": points}, indent=2)
                    options.json.write_text(written + "\n", encoding="utf-8")


def line(point: dict[str, Any]) -> str:
    ours, theirs = point["ours_us"], point["c_us"]
    return (
        f"{point['env']:15} {point['placement']:9} {point['points']:6} {point['near']:5.1f} "
        f"{median(ours):8.2f} ({min(ours):5.2f}) {median(theirs):8.2f} ({min(theirs):5.2f}) "
        f"{point['ratio']:7.2f} {point['compile_s']:6.1f} s"
    )


def measure(env: str, placement: str, count: int, rounds: int) -> dict[str, Any]:
    """One body: us of processor time per creature-step in each round, median ratio in a round.

    near: contacts that C MuJoCo finds, mean over the states.
    """
    creature = with_points(env, placement, count)
    plant, _ = make_plant(creature, "auto", True)
    if plant.lane_axis != -1:
        raise SystemExit(f"{env}: not a body for the fast plant")
    trace = tread(creature)
    ours, compile_s = our_replay(plant, trace)
    theirs = c_replay(creature, trace)
    turns = [(timed(ours), timed(theirs)) for _ in range(rounds + 1)][1:]
    return {
        "env": env,
        "placement": placement,
        "points": count,
        "near": near(creature, trace),
        "ours_us": [a for a, _ in turns],
        "c_us": [b for _, b in turns],
        "ratio": median(b / a for a, b in turns),
        "compile_s": compile_s,
    }


def timed(replay: Callable[[], object]) -> float:
    """us of processor time per creature-step."""
    began = time.process_time()
    replay()
    return 1e6 * (time.process_time() - began) / (STEPS * LANES)


def with_points(env: str, placement: str, count: int) -> Creature:
    """Return the shipped body with massless spheres, up to so many contact points."""
    folder = data_folder("envs") / env
    plain = load_creature(folder)
    bodies = host_bodies(plain, placement)
    tree = ElementTree.fromstring((folder / "creature.xml").read_text(encoding="utf-8"))
    names = [f"point{i}" for i in range(count - len(plain.feet.foot_of))]
    for i, name in enumerate(names):
        body = bodies[i % len(bodies)]
        where = placed(plain, body, i // len(bodies), ABOVE[placement])
        element = tree.find(f".//body[@name='{plain.model.body(body).name}']")
        assert element is not None
        attributes = {
            "name": name,
            "type": "sphere",
            "size": str(RADIUS),
            "pos": " ".join(f"{x:.5f}" for x in where),
            "mass": "0",
            "contype": "0",
            "conaffinity": "1",
        }
        ElementTree.SubElement(element, "geom", attributes)
    settings = tomllib.loads((folder / "creature.toml").read_text(encoding="utf-8"))
    settings["creature"]["ground"] = [*plain.settings.creature.ground, *names]
    with tempfile.TemporaryDirectory() as made:
        Path(made, "creature.xml").write_text(ElementTree.tostring(tree, "unicode"))
        Path(made, "creature.toml").write_text(tomli_w.dumps(settings))
        return load_creature(Path(made))


def host_bodies(creature: Creature, placement: str) -> list[int]:
    """Bodies that carry points; each has joints of its own."""
    if placement == "feet":
        feet = creature.model.geom_bodyid[creature.feet.watched[: len(creature.feet.foot_of)]]
        return sorted({int(body) for body in feet})
    return [b for b in range(1, creature.model.nbody) if creature.model.body_jntnum[b]]


def placed(creature: Creature, body: int, turn: int, above: float) -> np.ndarray:
    """[3] m in the body's frame: under the body's origin, later turns on a spiral about it."""
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.stand_qpos
    mujoco.mj_forward(creature.model, data)
    angle, reach = 2.4 * turn, 0.03 * np.sqrt(turn)
    world = data.xpos[body] + [reach * np.cos(angle), reach * np.sin(angle), 0.0]
    world[2] = RADIUS - 0.002 + above
    return data.xmat[body].reshape(3, 3).T @ (world - data.xpos[body])


def tread(creature: Creature) -> Trace:
    """Run stable PD with swaying targets in C MuJoCo, from standing (lane 0) to treading (last)."""
    rng, model = np.random.default_rng(0), quiet(creature)
    data, mass, joints = (
        mujoco.MjData(model),
        np.zeros((model.nv, model.nv)),
        creature.joints.dof_adr,
    )
    h, sign = float(model.opt.timestep), rng.choice([-1, 1], len(joints))
    states, torques = [], []
    for swing, phase in zip(np.linspace(0, 0.1, LANES), rng.uniform(0, 6, LANES), strict=True):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = creature.stand_qpos
        for t in range(STEPS):
            mujoco.mj_step1(model, data)
            goal = creature.joints.stand + swing * sign * np.sin(4 * np.pi * h * t + phase)
            q, v = data.qpos[creature.joints.qpos_adr], data.qvel[joints]
            force = -data.qfrc_bias + data.qfrc_passive
            pull = creature.gains.kp * (goal - q - h * v) - creature.gains.kd * v
            force[joints] += pull
            mujoco.mj_fullM(model, data, mass)
            mass[joints, joints] += h * creature.gains.kd
            acceleration = np.linalg.solve(mass, force)[joints]
            data.qfrc_applied[joints] = np.clip(
                pull - h * creature.gains.kd * acceleration,
                -creature.gains.torque_limit,
                creature.gains.torque_limit,
            )
            states.append(np.concatenate([data.qpos, data.qvel, data.qacc_warmstart]))
            torques.append(data.qfrc_applied.copy())
            mujoco.mj_step2(model, data)
    qpos, qvel, warmstart = np.split(np.array(states), [model.nq, model.nq + model.nv], axis=1)
    return Trace(qpos, qvel, warmstart, np.array(torques))


def our_replay(plant: Plant, trace: Trace) -> tuple[Callable[[], object], float]:
    """Return a pass over the states that sums up all results, to omit none; s to compile."""
    qpos, qvel, warmstart, torque = (side_by_side(x) for x in dataclasses.astuple(trace))
    states = BodyState(qpos, qvel, warmstart, warmstart, jnp.ones((STEPS, LANES)))

    def step(total: jax.Array, now: tuple[BodyState, jax.Array]) -> tuple[jax.Array, None]:
        sensed, step_data = plant.forward(now[0])
        results = jax.tree.leaves((sensed, plant.advance(now[0], step_data, now[1])))
        return total + sum(jnp.sum(x.reshape(-1, LANES), axis=0) for x in results), None

    def replay(trace: tuple[BodyState, jax.Array]) -> jax.Array:
        return jax.lax.scan(step, jnp.zeros(LANES), trace)[0]

    began = time.perf_counter()
    compiled = jax.jit(replay).lower((states, torque)).compile()
    compile_s = time.perf_counter() - began
    return lambda: jax.block_until_ready(compiled((states, torque))), compile_s


def side_by_side(values: np.ndarray) -> jax.Array:
    """Rearrange [L * T, n] to [T, n, L]."""
    return jnp.asarray(values.reshape(LANES, STEPS, -1).transpose(1, 2, 0), jnp.float32)


def c_replay(creature: Creature, trace: Trace) -> Callable[[], object]:
    """Return a pass of `mj_step` over the same states in one thread of C."""
    model = quiet(creature)
    data = mujoco.MjData(model)
    state = np.concatenate([np.zeros((STEPS * LANES, 1)), trace.qpos, trace.qvel], axis=1)
    out = np.zeros((len(state), 1, state.shape[1]))

    def replay() -> object:
        return rollout.rollout(
            model,
            data,
            state,
            trace.torque[:, None],
            control_spec=int(mujoco.mjtState.mjSTATE_QFRC_APPLIED),
            initial_warmstart=trace.warmstart,
            state=out,
        )

    return replay


def near(creature: Creature, trace: Trace) -> float:
    """Contacts of a state, mean over every fifth."""
    model = quiet(creature)
    data, found = mujoco.MjData(model), []
    for qpos in trace.qpos[::5]:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found.append(data.ncon)
    return float(np.mean(found))


def quiet(creature: Creature) -> mujoco.MjModel:
    """Return the model without islands, which cost more than they save on one creature."""
    model = creature.evolution_model
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    return model


if __name__ == "__main__":
    main()
