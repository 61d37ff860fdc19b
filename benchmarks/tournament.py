"""Contests between champions of the task `compete`, each against each, in C MuJoCo.

    python benchmarks/tournament.py runs/contest-0 runs/contest-1
    python benchmarks/tournament.py runs/contest-0 --generations 0 20 40 60

With `--generations` the best of these checkpoints meet, too. Prints each one's share of the cube
(docs/reference/compete.md) against each of the others, without disturbances, and the mean.
"""

import argparse
import dataclasses
from pathlib import Path

import numpy as np

from mjxgait.certification import CertificateConfig
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.inspect.snapshot import read_snapshot
from mjxgait.reference.starts import nominal_starts
from mjxgait.tasks.modular.compete_criteria import nearness
from mjxgait.training.folder import open_champion, open_run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--generations", nargs="*", type=int, default=[])
    options = parser.parse_args()
    creature, _ = open_run(options.runs[0])
    known: dict[str, Champion] = {}
    for run in options.runs:
        for generation in options.generations:
            known[f"{run.name}, {generation}"] = read_snapshot(run, generation).champion(1)
        known[run.name] = open_champion(run)[1]
    print("", *range(1, len(known) + 1), "mean", sep=" | ")
    for number, (name, one) in enumerate(known.items(), start=1):
        shares = [
            np.nan if other is one else share(creature, one, other) for other in known.values()
        ]
        shown = ["" if np.isnan(found) else f"{found:.2f}" for found in shares]
        print(f"{number}: {name}", *shown, f"{np.nanmean(shares):.2f}", sep=" | ", flush=True)


def share(creature: Creature, one: Champion, other: Champion) -> float:
    """Return the share of the cube that one has against another; NaN if it has no hinge."""
    own, theirs = (
        {name: array for name, array in each.genome.items() if not name.startswith("opponent.")}
        for each in (one, other)
    )
    met = dataclasses.replace(one, genome=own | {f"opponent.{n}": a for n, a in theirs.items()})
    config = CertificateConfig()
    try:
        body = met.embodied(creature)
    except UserError:
        return np.nan
    outcome = simulate(body, met, nominal_starts(body, 1), config.seconds, record=1)
    since = round(config.warmup / outcome.trajectory.time_step)
    return float(nearness(outcome.gaps[0, since:]).mean())


if __name__ == "__main__":
    main()
