"""`mjxgait bench`: how fast the simulation is, against C MuJoCo by hand, DART, and the machine."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.config import find_creature, resolve_config
from mjxgait.creature import load_creature


@dataclasses.dataclass(frozen=True)
class BenchOptions:
    """Measure useful creature-steps per second beside C MuJoCo by hand and DART, turn by turn in one run (docs/performance.md).

    DART is left out unless dartpy is installed (mjxgait[peers]). Leave the machine alone meanwhile: the ratios stand some load, the
    rates do not.

    Attributes:
      json: File to write everything to.
      env: Name of a shipped creature, or path of a creature folder.
      rounds: Turns of each contestant.
      population: Genomes in the workload, each on all starts of the default settings.
      generations: How long the better half of them has evolved.
      scaling: Also measure the curves over population and lanes, and the overhead of a generation; takes minutes. The picture is
        written beside the JSON file.
      history: File to append a line to, such as benchmarks/history.jsonl, so that a regression shows.
    """

    json: Path
    env: str = "tall_quadruped"
    rounds: int = 7
    population: int = 256
    generations: int = 10
    scaling: bool = False
    history: Path | None = None


def bench_command(arguments: Sequence[str]) -> int:
    """Returns the exit code."""
    options = tyro.cli(BenchOptions, args=list(arguments), prog="mjxgait bench")
    folder = find_creature(options.env)
    settings = load_creature(folder).settings
    config = resolve_config(settings.train, settings.creature.name)
    config = dataclasses.replace(
        config, evolution=dataclasses.replace(config.evolution, population=options.population)
    )
    from mjxgait.bench.contest import append_history, contest  # JAX takes a second to import

    result = contest(
        folder, config, options.rounds, options.generations, lambda line: print(line, flush=True)
    )
    _write(options.json, result)
    if options.scaling:
        from mjxgait.bench.scaling import draw, scaling_points

        result["scaling"] = scaling_points(options.env, lambda line: print(line, flush=True))
        _write(options.json, result)
        draw(result["scaling"], options.json.with_suffix(".png"))
    if options.history:
        append_history(result, options.history)
    print(_summary(result))
    print(f"written to {options.json}")
    return 0


def _write(file: Path, result: dict[str, object]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


def _summary(result: dict) -> str:
    lines = []
    for name, rate in result["creature_steps_per_second"].items():
        ratio = result.get(f"ratio_over_{name}")
        lines.append(
            f"{name:14} {rate['median']:>10,.0f} creature-steps/s"
            + (f"   ours is {ratio:.2f} x" if ratio else "")
        )
    lines += [f"{name:14} left out: {why}" for name, why in result["left_out"].items()]
    share = result["limit"]["share_of_bound"]
    return "\n".join(
        [
            *lines,
            f"of the measured peak: {share['flops']:.1%} of arithmetic, {share['cache_bytes']:.1%} of cache traffic",
        ]
    )
