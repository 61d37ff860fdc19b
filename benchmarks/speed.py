"""Speed of the simulation against C MuJoCo, DART and the machine's peak.

python benchmarks/speed.py --json FILE
"""

import dataclasses
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from mjxgait.config.layers import data_folder, find_creature
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.files import write_text

if TYPE_CHECKING:
    from peers.contest import Result


@dataclasses.dataclass(frozen=True)
class SpeedOptions:
    """Measure useful creature-steps per second against C MuJoCo and DART, by turns in one run.

    The contestants are a program in C around MuJoCo's functions, NumPy between batched steps of C
    MuJoCo, and DART (docs/research/performance.md). C needs a compiler, DART needs dartpy (the
    extra peers); without them they are left out. Leave the machine idle meanwhile: the ratios
    tolerate some load, the rates do not.

    Attributes:
      json: File to write everything to; for several creatures `ratios` by name, and `creatures`.
      env: Names of shipped creatures or paths of creature folders; `all`: every shipped one.
      rounds: Turns of each contestant.
      population: Genomes in the workload, each from all initial conditions of the default settings.
      generations: Generations for which the better half of them has evolved.
      scaling: Also measure the curves over population and lanes of a single creature, and the
        overhead of a generation; takes minutes. The picture is written beside the JSON file.
      history: File to append a line per creature to, such as benchmarks/history.jsonl, to show
        regressions.
    """

    json: Path
    env: tuple[str, ...] = ("tall_quadruped",)
    rounds: int = 7
    population: int = 256
    generations: int = 10
    scaling: bool = False
    history: Path | None = None


def main() -> None:
    try:
        compare(tyro.cli(SpeedOptions))
    except UserError as error:
        sys.exit(f"speed.py: {error}")


def compare(options: SpeedOptions) -> None:
    """Measure, write and print."""
    folders = _folders(options.env)
    if options.scaling and len(folders) > 1:
        raise UserError("--scaling measures one creature; name it with --env")
    from peers.contest import append_history, ratio_table  # JAX takes a second to import

    results: list[Result] = []
    for folder in folders:
        results.append(_measured(folder, options))
        _write(options.json, _together(results) if len(folders) > 1 else results[0])
        if options.history:
            append_history(results[-1], options.history)
        print(_summary(results[-1]), flush=True)
    if options.scaling:
        from peers.scaling import draw, scaling_points

        results[0]["scaling"] = scaling_points(options.env[0], _say)
        _write(options.json, results[0])
        draw(results[0]["scaling"], options.json.with_suffix(".png"))
    print(ratio_table(results))
    print(f"written to {options.json}")


def _folders(names: Sequence[str]) -> list[Path]:
    if "all" in names:
        folders = sorted(path.parent for path in data_folder("envs").glob("*/creature.toml"))
        return [folder for folder in folders if not _grows(folder)]
    if not names:
        raise UserError("--env names no creature; leave it out for tall_quadruped, or give `all`")
    folders = [find_creature(name) for name in dict.fromkeys(names)]
    for folder in folders:
        if _grows(folder):
            raise UserError(f"{folder.name}: its body grows, and this needs one that is there")
    return folders


def _grows(folder: Path) -> bool:
    return load_creature(folder).settings.creature.grows


def _measured(folder: Path, options: SpeedOptions) -> "Result":
    from peers.contest import contest
    from peers.workload import walking

    settings = load_creature(folder).settings
    config = walking(settings)
    evolution = dataclasses.replace(config.evolution, population=options.population)
    # In the other simulators all joints have the creature's own gains.
    rollout = dataclasses.replace(config.rollout, gains=0.0)
    config = dataclasses.replace(config, evolution=evolution, rollout=rollout)
    _say(settings.creature.name)
    return contest(folder, config, options.rounds, options.generations, _say)


def _together(results: "list[Result]") -> dict[str, object]:
    """Merge the results of several creatures, ratios first."""
    ratios = {
        result["creature"]: {k: v for k, v in result.items() if k.startswith("ratio_over_")}
        for result in results
    }
    return {"ratios": ratios, "creatures": {result["creature"]: result for result in results}}


def _say(line: str) -> None:
    print(line, flush=True)


def _write(file: Path, result: Mapping[str, object]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text(file, json.dumps(result, indent=2) + "\n")


def _summary(result: "Result") -> str:
    from peers.contest import LABELS

    lines = []
    for name, rate in result["creature_steps_per_second"].items():
        ratio = result.get(f"ratio_over_{name}")
        lines.append(
            f"{LABELS[name]:14} {rate['median']:>10,.0f} creature-steps/s"
            + (f"   ours is {ratio:.2f} x" if ratio else "")
        )
    lines += [f"{LABELS[name]:14} left out: {why}" for name, why in result["left_out"].items()]
    share = result["limit"]["share_of_bound"]
    arithmetic, cache = f"{share['flops']:.1%}", f"{share['cache_bytes']:.1%}"
    lines.append(f"of the measured peak: {arithmetic} of arithmetic, {cache} of cache traffic")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
