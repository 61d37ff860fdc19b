"""Results of `mjxgait train` with targets or styles, in new processes, one after the other.

    python benchmarks/wishes.py --json wishes.json
    python benchmarks/wishes.py --env crab --speeds 0.25 1 --gaits --seeds 0 1 --json crab.json
    python benchmarks/wishes.py --speeds --gaits --styles calm sneaky --json styles.json

For each creature every speed, every gait for its number of feet, every style; one row each, with
the speed in C MuJoCo, the gait's name there, stride and duty factor over an animal's, whether the
champion is certified, and the wall time. Options after `--` go to `train`, such as
`-- --cluster HOST:PORT`.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

from mjxgait.api import load_creature
from mjxgait.certification import verdict_of
from mjxgait.processes import python_command
from mjxgait.tasks.walk.gaits import GAITS
from mjxgait.tasks.walk.targets import NATURAL

ENVS = ("tall_quadruped", "short_quadruped", "crab", "duck")
SPEEDS = ("0.25", "0.5", "1", "1.5")
GAITS_ASKED = ("natural", "walk", "trot", "pace")
HEADER = (
    "creature",
    "asked",
    "seed",
    "m/s in C",
    "gait",
    "stride / animal's",
    "duty / animal's",
    "certified",
    "margin",
    "fails",
    "gens",
    "wall s",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--env", nargs="+", default=ENVS)
    parser.add_argument("--speeds", nargs="*", default=SPEEDS)
    parser.add_argument("--gaits", nargs="*", default=GAITS_ASKED)
    parser.add_argument("--styles", nargs="*", default=())
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--json", type=Path, required=True, help="file for all numbers")
    parser.add_argument("more", nargs="*", help="options of train, after --")
    options = parser.parse_args()
    row(HEADER)
    row(["---"] * len(HEADER))
    found: list[dict] = []
    for env in options.env:
        known = GAITS.get(len(load_creature(env).feet.names), {})
        asked = [["--speed", speed] for speed in options.speeds]
        asked += [["--gait", gait] for gait in options.gaits if gait in (*known, NATURAL)]
        asked += [["--style", style] for style in options.styles]
        for wish in asked:
            for seed in options.seeds:
                found.append(run(env, wish, seed, options.more))
                row([str(value) for value in found[-1].values()])
                options.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def run(env: str, wish: list[str], seed: int, more: list[str]) -> dict:
    """Run the command once and return its results."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        command = python_command("mjxgait", "train", "--env", env, "--seed", str(seed))
        command += [*wish, "--out", str(folder), "--no-plots", *more]
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=dict(os.environ))
        seconds = time.perf_counter() - began
        lines = (folder / "metrics.jsonl").read_text(encoding="utf-8").splitlines()
        certificate = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    verdict = verdict_of(certificate)
    failed = [f"{c.number} {m.name}" for c in verdict.failed for m in c.measures if not m.passed]
    likeness = certificate["report"]["likeness"]
    return {
        "creature": env,
        "asked": " ".join(wish),
        "seed": seed,
        "speed": round(certificate["report"]["speed"] or float("nan"), 3),
        "gait": certificate["report"]["gait"],
        "stride": round(likeness["stride"] or float("nan"), 2),
        "duty_factor": round(likeness["duty_factor"] or float("nan"), 2),
        "certified": verdict.certified,
        "margin": None if certificate["margin"] is None else round(certificate["margin"], 2),
        "fails": "; ".join(failed) or "-",
        "generations": json.loads(lines[-1])["generation"],
        "seconds": round(seconds),
    }


def row(cells: tuple[str, ...] | list[str]) -> None:
    print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
