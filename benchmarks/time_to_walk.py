"""Seconds from the command to a certified walk, by part, with an empty and then a warm cache.

    python benchmarks/time_to_walk.py --json walk.json --picture walk.png

Each `mjxgait train` is a new process. Each seed is run twice in a cache folder of its own: the
first run finds nothing compiled, the second everything. `benchmarks/stopwatch.py` times the parts
from within.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import mean, median

import matplotlib.pyplot as plt

KINDS = ("cold", "warm")
PARTS = (
    "imports",
    "body and starts",
    "tracing",
    "compiling",
    "evolution",
    "waiting for looks",
    "examination at the end",
    "checkpoints",
    "rest",
)


def run(env: str, seed: int, cache: Path, folder: Path, more: list[str]) -> dict:
    """Run the command once and return its wall time and results."""
    parts = folder.with_suffix(".parts.json")
    command = [
        sys.executable,
        str(Path(__file__).with_name("stopwatch.py")),
        str(parts),
        "--env",
        env,
        "--seed",
        str(seed),
        "--out",
        str(folder),
        "--no-plots",
        *more,
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
    held_up = json.loads(parts.read_text(encoding="utf-8"))
    # The stopwatch misses the interpreter's own start and end.
    held_up["rest"] += seconds - sum(held_up.values())
    certificate = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    shares = [line["sim_steps"] / line["computed_steps"] for line in lines]
    return {
        "seconds": seconds,
        "passed": certificate["passed"],
        "generations": lines[-1]["generation"],
        "parts": held_up,
        "steps_per_second": median(line["steps_per_second"] for line in lines),
        "useful_share": {"first": shares[0], "median": median(shares), "last": shares[-1]},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--env", nargs="+", default=["tall_quadruped"])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("more", nargs="*", help="options of train, after --")
    options = parser.parse_args()
    reports: dict[str, dict] = {}
    for env in options.env:
        runs: dict[str, list[dict]] = {kind: [] for kind in KINDS}
        for seed in range(options.seeds):
            with tempfile.TemporaryDirectory() as scratch:
                for kind, entries in runs.items():
                    there = Path(scratch)
                    found = run(env, seed, there / "cache", there / kind, options.more)
                    entries.append({"seed": seed} | found)
                    print(
                        f"{env}, seed {seed} {kind}: {entries[-1]['seconds']:.1f} s, certified: "
                        f"{entries[-1]['passed']}",
                        flush=True,
                    )
                    reports[env] = report(runs)
                    options.json.write_text(json.dumps(reports, indent=2) + "\n", encoding="utf-8")
    if options.picture:
        draw(reports, options.picture)


def report(runs: dict[str, list[dict]]) -> dict:
    """Medians of the runs so far, means of their parts, and the machine's load."""
    medians = {
        f"{kind}_median_s": median(entry["seconds"] for entry in entries)
        for kind, entries in runs.items()
        if entries
    }
    medians |= {
        f"{kind}_parts_s": {
            part: mean(entry["parts"].get(part, 0.0) for entry in entries) for part in PARTS
        }
        for kind, entries in runs.items()
        if entries
    }
    return medians | {"load": os.getloadavg()[0], "runs": runs}


def draw(reports: dict[str, dict], path: Path) -> None:
    """Draw a bar for each creature, cold and warm: the mean seconds of each part."""
    bars = {
        f"{env}, {kind}": of[f"{kind}_parts_s"] for env, of in reports.items() for kind in KINDS
    }
    figure, axes = plt.subplots(figsize=(9, max(0.6 + 0.45 * len(bars), 2.4)), layout="constrained")
    ends = dict.fromkeys(bars, 0.0)
    for part in PARTS:
        widths = [parts[part] for parts in bars.values()]
        axes.barh(list(bars), widths, left=list(ends.values()), label=part)
        ends = {bar: end + width for (bar, end), width in zip(ends.items(), widths, strict=True)}
    axes.invert_yaxis()
    axes.set_xlabel("s, mean of the seeds")
    axes.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main()
