"""Seconds from the command to a certified walk: `mjxgait train` in new processes, first with an
empty cache, then with a warm one.

    python benchmarks/time_to_walk.py --json walk.json

Each seed is run twice in a cache folder of its own: the first run finds nothing compiled, the
second finds everything.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

SEEDS = range(5)


def run(env: str, seed: int, cache: Path, folder: Path) -> dict:
    """One run of the command: its wall time, and what came of it."""
    command = [
        sys.executable,
        "-m",
        "mjxgait",
        "train",
        "--env",
        env,
        "--seed",
        str(seed),
        "--out",
        str(folder),
        "--no-plots",
    ]
    began = time.perf_counter()
    subprocess.run(
        command,
        env=os.environ | {"XDG_CACHE_HOME": str(cache)},
        check=True,
        stdout=subprocess.DEVNULL,
    )
    seconds = time.perf_counter() - began
    lines = [
        json.loads(line)
        for line in (folder / "metrics.jsonl").read_text(encoding="utf-8").splitlines()
    ]
    certificate = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    shares = [line["sim_steps"] / line["computed_steps"] for line in lines]
    return {
        "seconds": seconds,
        "passed": certificate["passed"],
        "generations": lines[-1]["generation"],
        "simulating_s": sum(line["wall_s"] for line in lines),
        "steps_per_second": median(line["steps_per_second"] for line in lines),
        "useful_share": {"first": shares[0], "median": median(shares), "last": shares[-1]},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--env", default="tall_quadruped")
    options = parser.parse_args()
    runs: dict[str, list[dict]] = {"cold": [], "warm": []}
    for seed in SEEDS:
        with tempfile.TemporaryDirectory() as scratch:
            for kind, entries in runs.items():
                entries.append(
                    {"seed": seed}
                    | run(options.env, seed, Path(scratch) / "cache", Path(scratch) / kind)
                )
                print(
                    f"seed {seed} {kind}: {entries[-1]['seconds']:.1f} s, certified: "
                    f"{entries[-1]['passed']}",
                    flush=True,
                )
                options.json.write_text(json.dumps(report(runs), indent=2) + "\n", encoding="utf-8")


def report(runs: dict[str, list[dict]]) -> dict:
    """Medians of the runs so far, and how busy the machine is."""
    medians = {
        f"{kind}_median_s": median(entry["seconds"] for entry in entries)
        for kind, entries in runs.items()
        if entries
    }
    return medians | {"load": os.getloadavg()[0], "runs": runs}


if __name__ == "__main__":
    main()
