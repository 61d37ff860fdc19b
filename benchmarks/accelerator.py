"""Benchmark of the compiled step on an accelerator: creature-steps per second, joules per million.

    python benchmarks/accelerator.py --out FOLDER
    JAX_PLATFORMS=cpu python benchmarks/accelerator.py --out FOLDER --engines ours --lanes 64

A pass is the program by which a run evaluates its individuals: controller, drive, physics and
statistics. Every lane simulates one episode of an individual that treads on the spot, so all lanes
work until the end and all engines have the same episodes. The engines differ only in the physics:
`ours` is the lane-major step, `mjx` is MuJoCo's own MJX in JAX. `warp` is MuJoCo Warp, where it is
installed: it steps as a whole and leaves no place for stable PD, so it computes the bare step of a
body that springs hold up (`peers/warp_peer.py`), as long and in as many lanes.

Each row is a process of its own. All compile at the same time; then each is measured alone, one
after the other. A row that fails or takes too long shows the reason. Prints a Markdown table, and
writes it after each row, with everything as JSON:

- lanes: simulations at once, on all devices together.
- compile: s, tracing included, while the other rows compile, too.
- steps/s: creature-steps per second, the best pass; us: of one control step of all lanes.
- W, J/M: mean of the card's power during the passes, and joules per million creature-steps; empty
  where nvidia-smi reports none.
- alive, forward: share of the episodes that lasted, and m that the bodies moved: a check that the
  engines did the same.
"""

import argparse
import dataclasses
import json
import os
import select
import subprocess
import sys
import time
from pathlib import Path
from statistics import mean
from typing import Any, Literal, TextIO

ENGINES: dict[str, Literal["auto", "mjx"]] = {"ours": "auto", "mjx": "mjx"}
"""Engines, and their names in `rollout.physics`."""
WARP = "warp"
"""The engine that is not one of `rollout.physics`."""
INDIVIDUALS = 64
"""Different individuals; further lanes repeat them."""
SWING = 4.0
"""Range of the treading about the standing pose, in degrees."""
COLUMNS = "engine", "lanes", "compile", "steps/s", "us", "W", "J/M", "alive", "forward"
POWER = (
    "nvidia-smi --query-gpu=power.draw.instant --format=csv,noheader,nounits --id=0 --loop-ms=100"
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")
    parser.add_argument("--name", default="accelerator", help="of the two files in it")
    parser.add_argument("--env", default="tall_quadruped")
    parser.add_argument("--engines", nargs="+", choices=(*ENGINES, WARP), default=list(ENGINES))
    parser.add_argument("--lanes", nargs="+", type=int, default=[1024, 4096, 16384, 65536])
    parser.add_argument("--seconds", type=float, default=0.8, help="of an episode")
    parser.add_argument("--passes", type=float, default=3.0, help="s for which passes are timed")
    parser.add_argument("--budget", type=float, default=200.0, help="s for everything")
    parser.add_argument("--row", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        measure(options, *options.row.split(":"))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    report(options)


def report(options: argparse.Namespace) -> None:
    """Compile all rows in parallel, measure them one after the other, write after each."""
    end = time.monotonic() + options.budget
    names = [(engine, lanes) for lanes in options.lanes for engine in options.engines]
    started = {name: start(*name) for name in names}
    # Compilation gets half of the time: a slow row must not cost the others.
    ready = {name: answer(child, end - options.budget / 2) for name, child in started.items()}
    rows: list[dict[str, Any]] = []
    for (engine, lanes), child in started.items():
        row = ready[engine, lanes]
        if "error" not in row:
            child.stdin.write("go\n")
            row = answer(child, end)
        child.kill()
        rows.append({"engine": engine, "lanes": lanes} | row)
        write(options, rows)
        print(rows[-1], flush=True)
    print(table(rows), flush=True)


def start(engine: str, lanes: int) -> Any:
    """Start the process of a row. It allocates memory as needed: it shares the card."""
    return subprocess.Popen(
        [sys.executable, *sys.argv, "--row", f"{engine}:{lanes}"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
        env=os.environ | {"XLA_PYTHON_CLIENT_PREALLOCATE": "false"},
    )


def answer(child: Any, end: float) -> dict[str, Any]:
    """Return the next JSON line of a process; an error when it ends or the time is up."""
    if not select.select([child.stdout], [], [], max(end - time.monotonic(), 0.0))[0]:
        child.kill()
        return {"error": "took too long"}
    line = child.stdout.readline()
    return json.loads(line) if line else {"error": f"ended with {child.wait()}"}


def measure(options: argparse.Namespace, engine: str, lanes: str) -> None:
    """Compile and report it; measure after a line on standard input, and report the result."""
    # Libraries print to standard error, so that only answers are read.
    said = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    if engine == WARP:
        found = measure_warp(options, int(lanes), said)
        said.write(json.dumps(found) + "\n")
        return
    # Imported here: the parent process needs neither JAX nor the card.
    import jax

    from mjxgait.training.stages import compiled, everywhere, prepare_devices

    prepare_devices()
    jax.config.update("jax_enable_compilation_cache", False)
    batch, genomes = workload(options, engine, int(lanes))
    experiment = batch.experiments[0]
    given = (batch.known[0], batch.rows.settings, batch.rows.starts, genomes)
    given = jax.device_put(given, everywhere(experiment.simulator))
    began = time.perf_counter()
    program = compiled(batch.lower_evaluate(genomes, batch.rows.starts))
    compile_s = time.perf_counter() - began
    said.write(json.dumps({"compile": compile_s}) + "\n")
    sys.stdin.readline()
    evaluation = jax.block_until_ready(program(*given))
    seconds, power = passes(lambda: jax.block_until_ready(program(*given)), options.passes)
    steps = int(evaluation.sim_steps.sum())
    outcome = evaluation.outcome[..., experiment.simulator.task.outcomes.index("forward")]
    found = rates(steps, experiment.simulator.steps, seconds, power) | {
        "compile": compile_s,
        "alive": 1.0 - float(evaluation.failed.mean()),
        "forward": float(outcome.mean()),
        "steps": steps,
        "computed_steps": int(evaluation.computed_steps.sum()),
        "device": jax.devices()[0].device_kind,
        "devices": jax.device_count(),
    }
    said.write(json.dumps(found) + "\n")


def measure_warp(options: argparse.Namespace, lanes: int, said: TextIO) -> dict[str, Any]:
    """Report the compilation; measure after a line on standard input, and return the result."""
    from peers.warp_peer import WarpPeer

    from mjxgait.config.layers import find_creature
    from mjxgait.creature import load_creature

    creature = load_creature(find_creature(options.env))
    steps = round(options.seconds / creature.evolution_model.opt.timestep)
    peer = WarpPeer(creature, lanes, steps)
    said.write(json.dumps({"compile": peer.compile_s}) + "\n")
    sys.stdin.readline()
    peer.lap()
    seconds, power = passes(peer.lap, options.passes)
    found = {"compile": peer.compile_s, "alive": peer.standing}
    return found | rates(lanes * steps, steps, seconds, power)


def rates(
    steps: int, control_steps: int, seconds: list[float], power: list[float]
) -> dict[str, Any]:
    """Return rate and energy of passes of `steps` creature-steps in `control_steps` steps."""
    fastest = min(seconds)
    return {
        "steps/s": steps / fastest,
        "us": 1e6 * fastest / control_steps,
        "W": mean(power) if power else None,
        "J/M": mean(power) * mean(seconds) / (steps / 1e6) if power else None,
        "seconds": seconds,
    }


def workload(options: argparse.Namespace, engine: str, lanes: int) -> tuple[Any, Any]:
    """Return the run to be measured and its individuals [1, N, ...], one per lane."""
    import jax
    import jax.numpy as jnp
    from peers.workload import walking

    from mjxgait.config.layers import find_creature
    from mjxgait.creature import load_creature
    from mjxgait.training.experiment import Batch, build_experiment

    creature = load_creature(find_creature(options.env))
    config = walking(creature.settings)
    stand = tuple(map(float, creature.joints.stand)) * config.controller.key_poses
    config = dataclasses.replace(
        config,
        controller=dataclasses.replace(config.controller, around=stand, within=SWING),
        evolution=dataclasses.replace(config.evolution, population=INDIVIDUALS),
        rollout=dataclasses.replace(
            config.rollout,
            physics=ENGINES[engine],
            lanes=-(-lanes // jax.device_count()),
            seconds=options.seconds,
            starts=1,
            variety=1,
        ),
    )
    batch = Batch((build_experiment(creature, config),))
    places = jnp.arange(lanes) % INDIVIDUALS
    return batch, jax.tree.map(lambda leaf: leaf[:, places], batch.init().genomes)


def passes(work: Any, at_least: float) -> tuple[list[float], list[float]]:
    """Return seconds of each pass, for so many s in all; W of the card, ten times a second."""
    try:
        watch = subprocess.Popen(POWER.split(), stdout=subprocess.PIPE, text=True)
    except OSError:
        watch = None
    seconds: list[float] = []
    while sum(seconds) < at_least:
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    if watch is None:
        return seconds, []
    watch.terminate()
    # The first readings are from before the passes.
    said = watch.communicate()[0].split()[2:]
    return seconds, [float(word) for word in said if word.replace(".", "", 1).isdigit()]


def write(options: argparse.Namespace, rows: list[dict[str, Any]]) -> None:
    said = {"env": options.env, "seconds": options.seconds, "rows": rows}
    file = options.out / f"{options.name}.json"
    file.write_text(json.dumps(said, indent=2) + "\n", encoding="utf-8")
    file.with_suffix(".md").write_text(table(rows), encoding="utf-8")


def table(rows: list[dict[str, Any]]) -> str:
    lines = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    for row in rows:
        cells = [cell(row.get(name)) for name in COLUMNS]
        if "error" in row:
            cells[2] = row["error"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def cell(value: Any) -> str:
    if not isinstance(value, float):
        return "" if value is None else str(value)
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


if __name__ == "__main__":
    main()
