"""PPO against evolution: seconds until the first certificate.

    python benchmarks/ppo.py --env tall_quadruped --seeds 0 1 2 --out FOLDER --minutes 10 --certify
    JAX_PLATFORMS=cpu python benchmarks/ppo.py --out FOLDER --envs 512

PPO (`benchmarks/peers/policy_gradient.py`) trains a network on `mjxgait.environment`. Its policy is
the controller `network`, so a run folder holds a champion as evolution's does, and `mjxgait
certify`, `share`, `render` and `inspect` work on it. With --certify the policy is validated every
so many seconds and examined as a run of evolution examines its best: a nominal check, a selection
draw, then the certificate; the first half of the time with a margin of `examination.enough`, then
with any. All that happens in C MuJoCo beside the training, on the CPU. A seed ends at its first
certificate or when its time is up.

Prints a Markdown table, and writes it after each seed, with everything as JSON:

- wall: s from the start of the seed to its certificate or end, validations and examinations
  included. processor: the same in s of one core. compile: s before the first seed; all seeds of a
  call share the programs.
- steps: millions of control steps, a control step being the physics' own (5 ms).
- return: mean fitness of the episodes of the last iteration, as evolution counts it.
- attempts: examinations. margin: of the certificate.
"""

import argparse
import dataclasses
import json
import time
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from peers.gait_reward import GaitReward
from peers.policy_gradient import AXIS, Agent, Learner, Settings, World

import mjxgait
from mjxgait.certification import Certificate, certify, nominal_check, trial_run
from mjxgait.champion import Champion, write_champion
from mjxgait.config.schema import Config
from mjxgait.controllers.network.config import READS
from mjxgait.controllers.network.controller import Network, split
from mjxgait.environments.functional import Environment, State
from mjxgait.evolution.chance import key_of
from mjxgait.files import write_text
from mjxgait.simulation.rollout import choose
from mjxgait.training.advance import versions
from mjxgait.training.folder import CERTIFICATE, CHAMPION, create_run
from mjxgait.training.logs import append_lines
from mjxgait.training.stages import compiler_options, prepare_devices

COLUMNS = (
    *("seed", "certified", "wall", "processor", "compile", "steps", "return"),
    *("attempts", "margin"),
)
SHOWN = "seconds", "return", "outcome_forward", "outcome_seconds", "divergence", "deviation"
"""What is printed of every tenth iteration."""
LOG = "ppo.jsonl"
"""File in a run folder with a line per iteration."""
FITNESS, GAIT = 10.0, 5.0
"""Factors on the rewards: values then have a size of about 1."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out", type=Path, required=True, help="folder for results and run folders"
    )
    parser.add_argument("--env", default="tall_quadruped")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--minutes", type=float, default=10.0, help="of a seed, at most")
    parser.add_argument("--envs", type=int, default=1024, help="environments side by side")
    parser.add_argument("--unroll", type=int, default=20, help="actions from update to update")
    parser.add_argument("--minibatches", type=int, default=16)
    parser.add_argument("--rate", type=float, default=3e-4, help="of learning")
    parser.add_argument("--entropy", type=float, default=5e-3)
    parser.add_argument("--discount", type=float, default=0.97)
    parser.add_argument("--deviation", type=float, default=0.5, help="of the first actions")
    parser.add_argument("--hidden", nargs="+", type=int, default=[64, 64])
    parser.add_argument("--every", type=int, default=4, help="control steps per action")
    parser.add_argument("--period", type=float, default=0.5, help="s, of the policy's clock")
    parser.add_argument("--reward", choices=("gait", "fitness"), default="gait")
    parser.add_argument("--physics", choices=("auto", "mjx"), default="auto")
    parser.add_argument("--certify", action="store_true", help="end at the first certificate")
    parser.add_argument("--look", type=float, default=20.0, help="s between validations")
    parser.add_argument("--iterations", type=int, default=10**9, help="of a seed, at most")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    prepare_devices()
    bench = Bench.of(options)
    compiled = bench.compile()
    print(f"{jax.devices()}: compiled in {compiled:.1f} s", flush=True)
    rows: list[dict[str, Any]] = []
    for seed in options.seeds:
        rows.append(Training(bench, seed, options).run() | {"compile": compiled})
        write(options, rows)
    print(table(rows), flush=True)


@dataclasses.dataclass(frozen=True, eq=False)
class Bench:
    """Environment, agent and compiled programs, which all seeds share."""

    env: Environment
    network: Network
    agent: Agent
    envs: int

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Bench":
        """Return the programs for the options, not yet compiled."""
        env = mjxgait.environment(
            options.env, settings={"rollout": {"physics": options.physics}}, observe=READS
        )
        creature = env.problem.creature
        shape = Network.Settings(tuple(options.hidden), options.every, options.period)
        network = Network(creature, env.dt, shape)
        settings = Settings(
            envs=options.envs,
            unroll=options.unroll,
            minibatches=options.minibatches,
            learning_rate=options.rate,
            entropy=options.entropy,
            discount=options.discount,
            deviation=options.deviation,
        )
        gait = GaitReward(creature, options.period, options.every * env.dt)
        world = world_of(env, network, shape.period, gait if options.reward == "gait" else None)
        return cls(env, network, Agent(world, settings), options.envs)

    @property
    def inputs(self) -> int:
        """Inputs of the networks."""
        return self.network.layers[0][0]

    @cached_property
    def reset(self) -> Any:
        """States [B] at the start of episodes, from a key."""

        def begun(key: jax.Array) -> State:
            return self.env.reset_lanes(jax.random.split(key, self.envs))

        spread = jax.tree.map(lambda spec: NamedSharding(self.mesh, spec), self._spread(begun))
        options = compiler_options("some")
        return jax.jit(begun, out_shardings=spread, compiler_options=options)

    @cached_property
    def iterate(self) -> Any:
        """See `Agent.iterate`; every device has its share of the environments."""
        whole, spread = PartitionSpec(), self._spread(self.reset)
        given, found = (whole, spread, spread, whole), (whole, spread, whole)
        function = jax.shard_map(
            self.agent.iterate, mesh=self.mesh, in_specs=given, out_specs=found, check_vma=False
        )
        options = compiler_options("best")
        return jax.jit(function, donate_argnums=(0, 1), compiler_options=options)

    @cached_property
    def mesh(self) -> Mesh:
        """All devices."""
        return Mesh(np.array(jax.devices()), (AXIS,))

    def _spread(self, states: Any) -> Any:
        """Specification of states spread over the devices by their lanes."""
        front = self.env.plant.lane_axis == 0

        def spec(leaf: jax.ShapeDtypeStruct) -> PartitionSpec:
            rest = [None] * (leaf.ndim - 1)
            return PartitionSpec(AXIS, *rest) if front else PartitionSpec(*rest, AXIS)

        return jax.tree.map(spec, jax.eval_shape(states, key_of(0)))

    def compile(self) -> float:
        """Compile everything, and return how long it took in s."""
        began, key = time.perf_counter(), key_of(0)
        learner, states = self.init(key), self.reset(key)
        for _ in range(2):  # the second shows that what an iteration returns compiles nothing anew
            learner, states, found = self.iterate(learner, states, self.reset(key), key)
        jax.block_until_ready(found)
        return time.perf_counter() - began

    def init(self, key: jax.Array) -> Learner:
        """Return a learner of this size, on all devices."""
        *hidden, (_, joints) = self.network.layers
        sizes = tuple(outputs for _, outputs in hidden)
        begun = jax.jit(lambda key: self.agent.init(key, self.inputs, sizes, joints))
        return jax.device_put(begun(key), NamedSharding(self.mesh, PartitionSpec()))


def world_of(
    env: Environment, network: Network, period: float, gait: GaitReward | None = None
) -> World:
    """Return an environment as PPO sees it. gait: a reward besides the environment's own."""
    joints, axis = env.action_size, env.plant.lane_axis

    def step(states: State, outputs: jax.Array) -> State:
        act = jax.vmap(lambda one: env.action(network.angles(one)), out_axes=axis)
        actions = act(outputs)

        def once(states: State, _: None) -> tuple[State, jax.Array]:
            states = env.step_lanes(states, actions)
            return states, states.reward

        after, rewards = jax.lax.scan(once, states, None, length=network.every)
        reward = FITNESS * rewards.sum(0)
        if gait is not None:
            reward = GAIT * jax.vmap(gait.of, in_axes=axis)(states, after)
        return after.replace(reward=jnp.nan_to_num(reward))

    def observe(states: State) -> jax.Array:
        see = jax.vmap(lambda obs: network.inputs(split(obs, joints), period), in_axes=axis)
        return see(states.obs)

    def outcome(states: State) -> tuple[jax.Array, jax.Array, jax.Array]:
        fell = states.done * (1 - states.info["time_out"])
        return states.reward, fell, states.done

    restart = jax.vmap(choose, in_axes=axis, out_axes=axis)
    return World(step, observe, outcome, restart, jax.vmap(network.outputs, (None, 0)))


class Training:
    """One seed: trains, validates, examines, and writes a run folder."""

    def __init__(self, bench: Bench, seed: int, options: argparse.Namespace) -> None:
        self.bench, self.seed, self.options = bench, seed, options
        creature = bench.env.problem.creature
        problem = bench.env.problem
        table = {"hidden": tuple(options.hidden), "every": options.every, "period": options.period}
        self.config = settings_of(problem.config, seed, table)
        self.creature = creature
        self.folder = create_run(options.out / f"{creature.name}-{seed}", creature, self.config)
        self.attempts = 0
        self.certificate: Certificate | None = None

    def run(self) -> dict[str, Any]:
        """Train until the certificate or the end of the time; return a row of the table."""
        self.began, worked = time.perf_counter(), time.process_time()
        looked = self.began
        key, line, looks = key_of(self.seed), {}, None
        learner, states = self.bench.init(key), self.bench.reset(jax.random.fold_in(key, 1))
        with ThreadPoolExecutor(1) as aside:
            for iteration in range(self.options.iterations):
                now = jax.random.fold_in(key, iteration + 2)
                learner, states, found = self.bench.iterate(
                    learner, states, self.bench.reset(now), now
                )
                line = self._logged(iteration, jax.device_get(found))
                late = self.seconds > 60 * self.options.minutes
                if looks is not None and (looks.done() or late):
                    looks = looks.result()
                if late or self.certificate is not None:
                    break
                if looks is None and time.perf_counter() - looked > self.options.look:
                    looked = time.perf_counter()
                    looks = aside.submit(self._look, self._champion(learner, line))
        if self.certificate is None:
            self._look(self._champion(learner, line))
        return self._row(line) | {"processor": time.process_time() - worked}

    @property
    def seconds(self) -> float:
        """Time since the seed began, in s."""
        return time.perf_counter() - self.began

    def _logged(self, iteration: int, found: dict[str, np.ndarray]) -> dict[str, Any]:
        settings = self.bench.agent.settings
        actions = (iteration + 1) * settings.envs * settings.unroll
        kept = {n: float(value) if np.isfinite(value) else None for n, value in found.items()}
        fitness = kept.pop("fitness") if kept["ended"] else None
        line = {
            "iteration": iteration,
            "return": fitness,
            "seconds": self.seconds,
            "sim_steps": actions * self.bench.network.every,
        } | kept
        append_lines(self.folder / LOG, [line])
        if iteration % 10 == 0:
            print(iteration, {name: cell(line.get(name)) for name in SHOWN}, flush=True)
        return line

    def _champion(self, learner: Learner, line: dict[str, Any]) -> Champion:
        genome = {name: np.asarray(array) for name, array in learner.actor.items()}
        terms = {n.removeprefix("term_"): v for n, v in line.items() if n.startswith("term_")}
        origin = {"generation": line["iteration"], "seed": self.seed, "versions": versions()}
        fitness = float(line["return"] or 0.0)
        return Champion.of(
            self.creature, self.config, genome, fitness=fitness, terms=terms, origin=origin
        )

    def _look(self, champion: Champion) -> None:
        """Validate a policy, and examine it if it is good enough; see `training.examination`."""
        write_champion(champion, self.creature, self.folder / CHAMPION)
        if not self.options.certify:
            return
        exam = self.config.examination
        wanted = exam.enough if self.seconds < 30 * self.options.minutes else 0.0
        checked = nominal_check(self.creature, champion)
        margin, worst = checked.margin, min(checked.criteria, key=lambda c: c.margin)
        if margin >= wanted:
            margin = min(
                margin,
                trial_run(self.creature, champion, exam.draws, wanted=wanted, caution=exam.caution),
            )
        number = champion.origin["generation"]
        print(
            f"  {self.seconds:.0f} s: {number} has margin {margin:.2f}; {said(worst)}", flush=True
        )
        if margin < wanted:
            return
        self.attempts += 1
        found = certify(self.creature, champion, seen=checked, attempts=self.attempts)
        write_text(self.folder / CERTIFICATE, found.to_json())
        print(f"  {self.seconds:.0f} s: {'certified' if found.passed else 'failed'}", flush=True)
        if found.passed:
            self.certificate = found

    def _row(self, line: dict[str, Any]) -> dict[str, Any]:
        return {
            "env": self.options.env,
            "seed": self.seed,
            "certified": self.certificate is not None,
            "wall": self.seconds,
            "steps": line["sim_steps"] / 1e6,
            "return": line["return"],
            "attempts": self.attempts,
            "margin": self.certificate.margin if self.certificate else None,
            "device": jax.devices()[0].device_kind,
        }


def said(criterion: Any) -> str:
    """Return the worst measure of a criterion as text."""
    worst = min(criterion.measures, key=lambda m: m.margin)
    return f"{criterion.number} {criterion.name}: {worst.name} {worst.value:.3g}"


def settings_of(config: Config, seed: int, controller: dict[str, Any]) -> Config:
    """Return the settings of a run folder: the environment's, with a network for controller."""
    from mjxgait.plugins import build_config

    table = dataclasses.asdict(config) | {"seed": seed, "controller": controller}
    table["use"] = {"controller": "network", "task": config.use.task}
    return build_config(table, "the settings of the policy")


def write(options: argparse.Namespace, rows: list[dict[str, Any]]) -> None:
    given = {name: str(value) for name, value in vars(options).items()}
    file = options.out / "ppo.json"
    file.write_text(json.dumps({"options": given, "rows": rows}, indent=2) + "\n", encoding="utf-8")
    file.with_suffix(".md").write_text(table(rows), encoding="utf-8")


def table(rows: list[dict[str, Any]]) -> str:
    lines = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    lines += ["| " + " | ".join(cell(row[name]) for name in COLUMNS) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return "" if value is None else str(value)
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


if __name__ == "__main__":
    main()
