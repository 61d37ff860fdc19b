"""Growth of time and memory with the population and with the lanes.

Each point runs in its own process, so that its memory can be measured.
"""

import dataclasses
import json
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median

from mjxgait.config.schema import RolloutConfig
from mjxgait.processes import python_command, safe_environment

POPULATIONS = (32, 128, 512, 2048, 8192)
LANES = (8, 16, 32, 64, 128, 256)
DEFAULTS = (32, 128, 512)
"""Populations that are also measured with the default starts and episode."""


@dataclasses.dataclass(frozen=True)
class Point:
    """One setting.

    lanes: per device, 0 for the default. starts, seconds: of each individual's episodes. laps:
    generations timed.
    """

    population: int = 64
    lanes: int = 0
    starts: int = 1
    seconds: float = 4.0
    laps: int = 3


def scaling_points(creature: str, say: Callable[[str], None]) -> dict[str, list[dict[str, float]]]:
    """Measure all curves: over the population, over the lanes, and the default settings."""
    curves = {
        "population": [Point(population=p) for p in POPULATIONS],
        "lanes": [Point(population=512, lanes=n) for n in LANES],
        "defaults": [
            Point(population=p, starts=RolloutConfig.starts, seconds=RolloutConfig.seconds)
            for p in DEFAULTS
        ],
    }
    found: dict[str, list[dict[str, float]]] = {name: [] for name in curves}
    for name, points in curves.items():
        for point in points:
            found[name].append(measured := measure(creature, point))
            say(_line(measured))
    return found


def _line(point: dict[str, float]) -> str:
    return (
        f"population {point['population']:>5}, {point['lanes']:>3} lanes: "
        f"{point['useful_steps_per_second']:>9,.0f} useful steps/s, {point['useful_share']:.0%} "
        f"useful, {point['generation_s']:.2f} s a generation, {point['memory_mib']:.0f} MiB"
    )


def measure(creature: str, point: Point) -> dict[str, float]:
    """Measure one point, in a new process."""
    arguments = [creature, json.dumps(dataclasses.asdict(point))]
    result = subprocess.run(
        python_command("peers.scaling", *arguments),
        env=safe_environment() | {"PYTHONPATH": str(Path(__file__).parents[1])},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(result.stdout.splitlines()[-1])


def measure_here(creature: str, point: Point) -> dict[str, float]:
    """Measure one point in this process, by evaluating an initial population repeatedly.

    Memory is the peak in MiB.
    """
    from mjxgait.config.layers import find_creature
    from mjxgait.creature import load_creature
    from peers.ours import Ours
    from peers.workload import walking

    folder = find_creature(creature)
    config = walking(load_creature(folder).settings)
    rollout = dataclasses.replace(
        config.rollout, starts=point.starts, seconds=point.seconds, lanes=point.lanes
    )
    evolution = dataclasses.replace(config.evolution, population=point.population)
    ours = Ours(folder, dataclasses.replace(config, rollout=rollout, evolution=evolution))
    compiled = _peak_memory()
    laps = [ours.lap() for _ in range(point.laps + 1)][1:]
    share = ours.useful_share()
    rate = median(lap.rate for lap in laps)
    return dataclasses.asdict(point) | {
        "lanes": ours.experiment.simulator.lanes,
        "generation_s": median(lap.seconds for lap in laps),
        "useful_steps": laps[0].steps,
        "useful_steps_per_second": rate,
        "computed_steps_per_second": rate / share,
        "useful_share": share,
        "compile_s": ours.compile,
        "memory_compiled_mib": compiled,
        "memory_mib": _peak_memory(),
    }


def draw(points: dict[str, list[dict[str, float]]], path: Path) -> None:
    """Draw the two curves and the memory."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 3.6), layout="constrained")
    panels = figure.subplots(1, 3)
    for axes, curve, key, label in (
        (panels[0], "population", "_steps_per_second", "creature-steps per second"),
        (panels[1], "lanes", "_steps_per_second", "creature-steps per second"),
    ):
        x = [point[curve] for point in points[curve]]
        for kind in ("useful", "computed"):
            axes.plot(x, [point[kind + key] for point in points[curve]], "o-", label=kind)
        axes.set(
            xlabel=curve if curve == "population" else "lanes per device",
            ylabel=label,
            ylim=(0, None),
        )
        axes.legend(frameon=False)
    x = [point["population"] for point in points["population"]]
    panels[2].plot(
        x, [point["memory_mib"] for point in points["population"]], "o-", color="tab:green"
    )
    panels[2].set(xlabel="population", ylabel="peak memory, MiB", ylim=(0, None))
    for axes in panels:
        axes.set_xscale("log", base=2)
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def _peak_memory() -> float:
    """Return the peak memory of this process so far, in MiB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20 if sys.platform == "darwin" else 1 << 10)


if __name__ == "__main__":
    print(json.dumps(measure_here(sys.argv[1], Point(**json.loads(sys.argv[2])))))
