"""Contest: all contestants do the same work, in turns within one run.

Other load on the machine affects all alike.
"""

import dataclasses
import importlib.metadata
import importlib.util
import json
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, Protocol

import numpy as np

from mjxgait.config.schema import Config
from mjxgait.extras import install_command
from mjxgait.processes import cores
from peers.c_peer import CPeer, NoCompiler, Workers, build
from peers.machine import distance_to_limit, machine_facts, measured_peak, step_cost
from peers.ours import Ours, as_workload, half_and_half, overhead
from peers.workload import Lap, Workload

DART_STRIDE = 4
"""DART is so slow that it gets only every fourth genome."""
LABELS = {
    "ours": "ours",
    "c": "C",
    "mujoco_c": "NumPy + C",
    "dart": "DART",
    "dart_one_core": "DART, one core",
}
"""Display names of the contestants."""
PACKAGES = ("mjxgait", "jax", "jaxlib", "mujoco", "mujoco-mjx", "numpy", "dartpy")


Result = dict[str, Any]
"""Results of one creature, as in the JSON file."""


class Contestant(Protocol):
    """Anything that can run a workload once."""

    def lap(self) -> Lap:
        """Run the workload once."""
        ...


def contest(
    folder: Path, config: Config, rounds: int, generations: int, say: Callable[[str], None]
) -> Result:
    """Return all results of the benchmark, ready for JSON.

    Args:
      rounds: passes of each contestant.
      generations: of evolution before the workload is taken.
    """
    facts = machine_facts()
    say("compiling")
    ours = Ours(folder, config)
    say(f"evolving {generations} generations for the workload")
    early = ours.useful_share()
    ours.take(half_and_half(ours, generations))
    work = as_workload(folder, ours.experiment, ours.first)
    say("starting the other contestants")
    peers, left_out = _peers(work)
    try:
        laps = _interleave({"ours": ours, **peers}, rounds, say)
    finally:
        for peer in peers.values():
            peer.close()
    share = ours.useful_share()
    say("timing what a generation does besides simulating")
    besides = overhead(ours)
    say("counting operations, measuring the cores")
    # Processor time excludes other work on the machine. The peaks, the best of short tries, hardly
    # include it either.
    computed = 1e6 * cores() / (median(lap.cost for lap in laps["ours"]) * share)
    cost, peak = step_cost(ours.experiment), measured_peak()
    return {
        "creature": ours.experiment.creature.name,
        **_ratios(laps),
        "creature_steps_per_second": {
            name: _spread([lap.rate for lap in entry]) for name, entry in laps.items()
        },
        "processor_us_per_step": {
            name: _spread([lap.cost for lap in entry]) for name, entry in laps.items()
        },
        "useful_share": {"initial_population": early, "workload": share},
        "startup_s": {"ours": ours.startup, **{name: peer.startup for name, peer in peers.items()}},
        "compile_s": {"ours": ours.compile},
        "limit": {"cost_per_step": cost, "peak": peak, **distance_to_limit(cost, peak, computed)},
        "overhead": besides,
        "left_out": left_out,
        "workload": _described(work, ours, rounds, generations),
        "laps": {name: [dataclasses.asdict(lap) for lap in entry] for name, entry in laps.items()},
        "machine": facts,
        "versions": _versions(),
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }


def append_history(result: Result, file: Path) -> None:
    """Append a line with the figures that would show a regression."""
    kept = (
        "date",
        "creature",
        "ratio_over_c",
        "ratio_over_mujoco_c",
        "ratio_over_dart",
        "creature_steps_per_second",
        "processor_us_per_step",
        "compile_s",
        "useful_share",
        "machine",
        "versions",
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as history:
        history.write(json.dumps({key: result.get(key) for key in kept}) + "\n")


def _peers(work: Workload) -> tuple[dict[str, Workers], dict[str, str]]:
    """Return the contestants by name (see `LABELS`), and for each one left out the reason."""
    from peers.mujoco_peer import MujocoPeer

    peers: dict[str, Workers] = {}
    left_out: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        try:
            library = build(Path(folder))
        except NoCompiler as error:
            left_out["c"] = str(error)
        else:
            peers["c"] = Workers(partial(CPeer, library=library), work)
    peers["mujoco_c"] = Workers(MujocoPeer, work)
    if importlib.util.find_spec("dartpy") is None:
        left_out["dart"] = f"dartpy is not installed: {install_command('peers')}"
        return peers, left_out
    from peers.dart_peer import DartPeer, Unsupported, check_supported

    try:
        check_supported(work.creature())
    except Unsupported as error:
        left_out["dart"] = str(error)
    else:
        peers["dart"] = Workers(DartPeer, work.every(DART_STRIDE))
        peers["dart_one_core"] = Workers(DartPeer, work.every(2 * DART_STRIDE), count=1)
    return peers, left_out


def _interleave(
    contestants: dict[str, Contestant], rounds: int, say: Callable[[str], None]
) -> dict[str, list[Lap]]:
    """Let the contestants run in turns; the first turn of each is a warm-up."""
    laps: dict[str, list[Lap]] = {name: [] for name in contestants}
    for turn in range(rounds + 1):
        for name, contestant in contestants.items():
            lap = contestant.lap()
            if turn:
                laps[name].append(lap)
        said = "  ".join(f"{name} {entry[-1].rate:,.0f}/s" for name, entry in laps.items() if entry)
        say(f"round {turn} of {rounds}: {said or 'warm-up'}")
    return laps


def ratio_table(results: Sequence[Result]) -> str:
    """Make a line per creature: us of processor time per useful step, and its ratio to ours."""
    names = [name for name in LABELS if any(name in r["laps"] for r in results)]
    lines = [f"{'us per useful step':18}" + "".join(f"{LABELS[name]:>18}" for name in names)]
    for result in results:
        cells = []
        for name in names:
            ratio = result["processor_ratio"].get(name)
            cost = result["processor_us_per_step"].get(name)
            cell = f"{cost['median']:.1f}" if cost else "-"
            cells.append(f"{cell + (f' ({ratio:.2f} x)' if ratio else ''):>18}")
        lines.append(f"{result['creature']:18}" + "".join(cells))
    return "\n".join(lines)


def _ratios(laps: dict[str, list[Lap]]) -> dict[str, object]:
    """Return our speed over each contestant's within a round: medians, None if left out.

    ratio_over_NAME: by wall time, ratio_spread: its quartiles. processor_ratio: by processor time,
    which other work on the machine changes less.
    """
    result: dict[str, object] = {f"ratio_over_{name}": None for name in ("c", "mujoco_c", "dart")}
    spread, processor = {}, {}
    for name in (name for name in laps if name != "ours"):
        rounds = list(zip(laps["ours"], laps[name], strict=True))
        ratios = [ours.rate / theirs.rate for ours, theirs in rounds]
        result[f"ratio_over_{name}"], spread[name] = median(ratios), _spread(ratios)
        processor[name] = median(theirs.cost / ours.cost for ours, theirs in rounds)
    return result | {"ratio_spread": spread, "processor_ratio": processor}


def _spread(values: list[float]) -> dict[str, float]:
    low, quarter, middle, three_quarters, high = np.percentile(values, [0, 25, 50, 75, 100])
    return {
        "median": middle,
        "lower_quartile": quarter,
        "upper_quartile": three_quarters,
        "lowest": low,
        "highest": high,
    }


def _described(work: Workload, ours: Ours, rounds: int, generations: int) -> dict[str, object]:
    option = ours.experiment.creature.evolution_model.opt
    return {
        "creature": ours.experiment.creature.name,
        "genomes": len(work.key_poses),
        "starts": len(work.qpos),
        "episode_steps": work.steps,
        "lanes_per_device": ours.experiment.simulator.lanes,
        "solver_iterations": int(option.iterations),
        "line_search_iterations": int(option.ls_iterations),
        "evolved_generations": generations,
        "rounds": rounds,
    }


def _versions() -> dict[str, str]:
    found = {}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found
