"""Train creatures over seeds, each in its own process, and print a table of results in C MuJoCo.

    python benchmarks/every_creature.py --env tall_quadruped short_quadruped --seeds 0 1 2 3 4 \\
        --config default --out runs/every

An existing run is not repeated. Options after `--` go to `train`, such as
`-- --cluster HOST:PORT`. Columns: whether the champion is certified ("outdated" when the
certificate belongs to another champion, or names none) and the margin of its worst criterion; the
criteria that fail; speed over the certificate's 20 s; body lengths per second from the nominal
start over evolution's own episode, in the simulation that evolved it and in C MuJoCo; share of 64
perturbed starts, unused in evolution, that are up and forward after an episode and after 22 s;
generations; wall time of the whole command, with start-up, compilation and examination.
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from mjxgait.certification import (
    distance,
    outdated,
    read_certificate,
    survival,
    verdict_of,
)
from mjxgait.processes import python_command
from mjxgait.training.folder import CERTIFICATE, METRICS, open_champion, open_run
from mjxgait.training.logs import read_metrics

HEADER = (
    "creature",
    "seed",
    "certified",
    "margin",
    "fails",
    "speed",
    "evolved",
    "in C",
    "up, episode",
    "up, 22 s",
    "gait",
    "gens",
    "wall",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--env", nargs="+", default=["tall_quadruped", "short_quadruped", "crab", "duck", "alien"]
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2, 3, 4])
    parser.add_argument("--config", default=None)
    parser.add_argument(
        "--candidates", type=int, default=12, help="how many of the best are looked at in the end"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/every"))
    parser.add_argument("more", nargs="*", help="options of train, after --")
    options = parser.parse_args()
    more = ["--examination.candidates", str(options.candidates), *options.more]
    if options.config:
        more += ["--config", options.config]
    print(*HEADER, sep=" | ")
    for name in options.env:
        for seed in options.seeds:
            folder = options.out / f"{Path(name).name}-{seed}"
            wall = train(folder, name, seed, more)
            print(*row(folder, seed, wall), sep=" | ", flush=True)


def train(folder: Path, name: str, seed: int, more: list[str]) -> float:
    """Wall time of the run in s; for an existing one, the time noted beside it. more: options."""
    note = folder.with_suffix(".wall")
    if not note.exists():
        given = ["--env", name, "--seed", str(seed), "--out", str(folder), "--no-plots"]
        command = python_command("mjxgait", "train", *given)
        began = time.perf_counter()
        subprocess.run([*command, *more], check=True, stdout=subprocess.DEVNULL)
        note.write_text(str(time.perf_counter() - began))
    return float(note.read_text())


def row(folder: Path, seed: int, wall: float) -> list[str]:
    """Return a row from the run folder and two more simulations in C MuJoCo."""
    (creature, champion), (_, config) = open_champion(folder), open_run(folder)
    certificate = read_certificate(folder / CERTIFICATE) or sys.exit(
        f"{folder}: no certificate; delete it, and it is made again"
    )
    seconds, evolved = config.rollout.seconds, champion.origin["nominal"]["forward"]
    examined = distance(creature, champion, seconds)
    starts = next(c for c in certificate["criteria"] if c["number"] == 4)["measures"][0]["value"]
    margin, verdict = certificate["margin"], verdict_of(certificate)
    old = outdated(certificate, champion, creature)
    return [
        creature.name,
        str(seed),
        "outdated" if old else "yes" if verdict.certified else "no",
        "none" if margin is None else f"{margin:.2f}",
        " ".join(map(str, verdict.numbers)) or "-",
        f"{certificate['report']['speed_body_lengths'] or 0:.2f}",
        f"{evolved / creature.frame.body_length / seconds:.2f}",
        f"{examined / creature.frame.body_length / seconds:.2f} ({examined / evolved - 1:+.0%})",
        f"{survival(creature, champion, seconds=seconds, seed=1):.0%}",
        f"{starts:.0%}",
        str(certificate["report"]["gait"]),
        str(read_metrics(folder / METRICS)[-1]["generation"]),
        f"{wall:.0f} s",
    ]


if __name__ == "__main__":
    main()
