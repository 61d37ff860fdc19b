"""What differs between two checkpoints."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import Console

from mjxgait.control.poses import TUNING
from mjxgait.inspect.facts import fitness_summary, flat
from mjxgait.inspect.snapshot import Snapshot
from mjxgait.inspect.text import print_pairs, show, titled_table


def differences(a: Snapshot, b: Snapshot) -> dict[str, Any]:
    """Settings, fitness, population and champion of two checkpoints against each other; poses
    only where the joints are the same.
    """
    mine, other = (flat(dataclasses.asdict(s.config)) for s in (a, b))
    same_joints = a.creature.joint_names == b.creature.joint_names
    same_shape = same_joints and a.key_poses.shape[1:] == b.key_poses.shape[1:]
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
        "same_individuals": _shared(a, b) if same_shape else None,
        "champion_moved_deg": _moved(a, b) if same_shape else None,
        "champion_tuning": {
            n: [float(x), float(y)]
            for n, x, y in zip(TUNING, a.tuning[0], b.tuning[0], strict=True)
        },
    }


def print_differences(found: Mapping[str, Any], console: Console) -> None:
    """As tables."""
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
    _print_columns("settings", found["settings"], console)
    _print_columns("versions", found["versions"], console)
    _print_columns(
        "fitness",
        {k: [show(x), show(y)] for k, (x, y) in found["fitness"].items() if k != "broken"},
        console,
    )
    if found["champion_moved_deg"] is None:
        console.print(
            "\nThe joints or the number of key poses differ, so the poses cannot be compared."
        )
        return
    console.print(f"\n{found['same_individuals']} genomes are in both populations.")
    moved = found["champion_moved_deg"]
    poses = len(next(iter(moved.values())))
    table = titled_table("champion: from A to B, in degrees", console)
    for name in ("joint", *(f"pose {k + 1}" for k in range(poses))):
        table.add_column(name, justify="left" if name == "joint" else "right")
    for joint, values in moved.items():
        table.add_row(joint, *(f"{value:+.1f}" if round(value, 1) else "0" for value in values))
    console.print(table)
    changed = {
        name: [f"{x:.3g}", f"{y:.3g}"]
        for name, (x, y) in found["champion_tuning"].items()
        if x != y
    }
    _print_columns("champion's tuning", changed, console)


def _name(snapshot: Snapshot) -> dict[str, Any]:
    return {
        "run": str(snapshot.run),
        "creature": snapshot.creature.name,
        "generation": snapshot.generation,
        "seed": snapshot.config.seed,
    }


def _shared(a: Snapshot, b: Snapshot) -> int:
    """How many genomes are in both populations."""
    mine, other = (
        {
            g.tobytes()
            for g in np.concatenate([s.key_poses.reshape(len(s.fitness), -1), s.tuning], 1)
        }
        for s in (a, b)
    )
    return len(mine & other)


def _moved(a: Snapshot, b: Snapshot) -> dict[str, list[float]]:
    change = np.degrees(b.key_poses[0] - a.key_poses[0])
    return {
        name: [float(value) for value in change[:, j]]
        for j, name in enumerate(a.creature.joint_names)
    }


def _print_columns(title: str, rows: Mapping[str, list[Any]], console: Console) -> None:
    if not rows:
        console.print(f"\n{title}: no difference")
        return
    table = titled_table(title, console)
    for name in ("", "A", "B"):
        table.add_column(name)
    for key, (x, y) in rows.items():
        table.add_row(key.replace("_", " ") if title == "fitness" else key, str(x), str(y))
    console.print(table)
