"""Differences between two checkpoints."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from rich.console import Console

from mjxgait.config.tables import flat
from mjxgait.inspect.facts import fitness_summary
from mjxgait.inspect.genomes import view_of
from mjxgait.inspect.snapshot import Snapshot
from mjxgait.inspect.tables import print_columns, print_pairs, show


def differences(a: Snapshot, b: Snapshot) -> dict[str, Any]:
    """Compare settings, fitness, populations and champions of two checkpoints.

    Genomes are compared only for the same controller, poses only for the same joints.
    """
    mine, other = (flat(dataclasses.asdict(s.config)) for s in (a, b))
    kinds = [s.config.use.controller for s in (a, b)]
    summaries = fitness_summary(a.fitness), fitness_summary(b.fitness)
    return {
        "a": _name(a),
        "b": _name(b),
        "same_body": a.creature.digest == b.creature.digest,
        "settings": {
            key: [mine.get(key), other.get(key)]
            for key in sorted(mine.keys() | other.keys())
            if mine.get(key) != other.get(key)
        },
        "versions": {
            name: [a.versions.get(name), b.versions.get(name)]
            for name in sorted({*a.versions, *b.versions})
            if a.versions.get(name) != b.versions.get(name)
        },
        "fitness": {name: [one[name], two[name]] for one, two in [summaries] for name in one},
        "controllers": kinds,
    } | (view_of(kinds[0]).difference(a, b) if kinds[0] == kinds[1] else {})


def print_differences(found: Mapping[str, Any], console: Console) -> None:
    """Print the differences as tables."""
    a, b = found["a"], found["b"]
    heading = {
        s: f"{side['creature']}, generation {side['generation']} of {side['run']}"
        for s, side in (("A", a), ("B", b))
    }
    print_pairs(
        heading
        | ({} if found["same_body"] else {"body": "not the same: the creature files differ"}),
        console,
    )
    print_columns("settings", found["settings"], console)
    print_columns("versions", found["versions"], console)
    print_columns(
        "fitness",
        {k: [show(x), show(y)] for k, (x, y) in found["fitness"].items() if k != "broken"},
        console,
    )
    mine, other = found["controllers"]
    if mine == other:
        view_of(mine).show_difference(found, console)
    else:
        console.print(f"\nA is moved by {mine}, B by {other}: their genomes cannot be compared.")


def _name(snapshot: Snapshot) -> dict[str, Any]:
    return {
        "run": str(snapshot.run),
        "creature": snapshot.creature.name,
        "generation": snapshot.generation,
        "seed": snapshot.config.seed,
    }
