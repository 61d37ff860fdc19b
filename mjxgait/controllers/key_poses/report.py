"""Reports on genomes of key poses. Angles in degrees."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from rich.console import Console
from typing_extensions import override

from mjxgait.controllers.key_poses.config import gene_names
from mjxgait.inspect.sections import GenomeView, print_columns, title, titled_table
from mjxgait.inspect.snapshot import Snapshot, shared


class PoseView(GenomeView):
    """Key poses by joint, tuning by name; see `GenomeView`."""

    @override
    def facts(self, snapshot: Snapshot, i: int) -> dict[str, object]:
        creature, genomes = snapshot.creature, snapshot.genomes
        ranges = zip(
            creature.joints.names, creature.joints.pose_low, creature.joints.pose_high, strict=True
        )
        return {
            "tuning": _by_gene(snapshot, genomes["tuning"][i]),
            "key_poses_deg": [
                _by_joint(snapshot, np.degrees(pose)) for pose in genomes["key_poses"][i]
            ],
            "range_deg": {
                name: [math.degrees(low), math.degrees(high)] for name, low, high in ranges
            },
        }

    def spread(self, snapshot: Snapshot) -> dict[str, object]:
        """The mean over the key poses, per joint."""
        poses, tuning = snapshot.genomes["key_poses"], snapshot.genomes["tuning"]
        spread = np.degrees(poses.std(axis=0).mean(axis=0))
        room = np.degrees(snapshot.creature.joints.pose_high - snapshot.creature.joints.pose_low)
        return {
            "spread_deg": _by_joint(snapshot, spread),
            "spread_of_range": _by_joint(snapshot, spread / np.maximum(room, 1e-9)),
            "tuning_spread": _by_gene(snapshot, tuning.std(axis=0)),
        }

    def difference(self, a: Snapshot, b: Snapshot) -> dict[str, object]:
        """Key poses are compared only if the joints are the same."""
        mine, other = a.genomes, b.genomes
        comparable = (
            a.creature.joints.names == b.creature.joints.names
            and mine["key_poses"].shape[1:] == other["key_poses"].shape[1:]
        )
        # Bodies that step under a fall have more genes.
        pairs = zip(_genes(a), mine["tuning"][0], other["tuning"][0], strict=False)
        return {
            "same_individuals": shared(a, b) if comparable else None,
            "champion_moved_deg": _moved(a, b) if comparable else None,
            "champion_tuning": {name: [float(x), float(y)] for name, x, y in pairs},
        }

    @override
    def show(
        self, individual: Mapping[str, Any], spread: Mapping[str, Any] | None, console: Console
    ) -> None:
        poses = individual["key_poses_deg"]
        table = titled_table(f"{title(individual)}: key poses in degrees", console)
        headings = [f"pose {k + 1}" for k in range(len(poses))]
        for heading in ("joint", "may lie in", *headings, *(["spread", "of range"] * bool(spread))):
            table.add_column(heading, justify="left" if heading == "joint" else "right")
        for joint, (low, high) in individual["range_deg"].items():
            apart = (
                [f"{spread['spread_deg'][joint]:.1f}", f"{spread['spread_of_range'][joint]:.0%}"]
                if spread
                else []
            )
            table.add_row(
                joint, f"{low:.0f} .. {high:.0f}", *(f"{pose[joint]:.1f}" for pose in poses), *apart
            )
        console.print(table)
        tuning = (f"{name} {value:.3g}" for name, value in individual["tuning"].items())
        console.print("tuning: " + ", ".join(tuning))

    @override
    def show_difference(self, found: Mapping[str, Any], console: Console) -> None:
        moved = found["champion_moved_deg"]
        if moved is None:
            console.print(
                "\nThe joints or the number of key poses differ, so the poses cannot be compared."
            )
            return
        console.print(f"\n{found['same_individuals']} genomes are in both populations.")
        table = titled_table("champion: from A to B, in degrees", console)
        for name in ("joint", *(f"pose {k + 1}" for k in range(len(next(iter(moved.values())))))):
            table.add_column(name, justify="left" if name == "joint" else "right")
        for joint, values in moved.items():
            table.add_row(joint, *(f"{value:+.1f}" if round(value, 1) else "0" for value in values))
        console.print(table)
        pairs = found["champion_tuning"].items()
        changed = {name: [f"{x:.3g}", f"{y:.3g}"] for name, (x, y) in pairs if x != y}
        print_columns("champion's tuning", changed, console)


def _moved(a: Snapshot, b: Snapshot) -> dict[str, list[float]]:
    change = np.degrees(b.genomes["key_poses"][0] - a.genomes["key_poses"][0])
    columns = zip(a.creature.joints.names, change.T, strict=True)
    return {name: [float(value) for value in column] for name, column in columns}


def _by_joint(snapshot: Snapshot, values: Iterable[float]) -> dict[str, float]:
    return dict(zip(snapshot.creature.joints.names, map(float, values), strict=True))


def _genes(snapshot: Snapshot) -> tuple[str, ...]:
    return gene_names(snapshot.creature.corrections.steps)


def _by_gene(snapshot: Snapshot, values: np.ndarray) -> dict[str, float]:
    return dict(zip(_genes(snapshot), map(float, values), strict=True))
