"""Reports on genomes that grow bodies."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import Console
from typing_extensions import override

from mjxgait.controllers.sims_brain.reference_body import Part, grow
from mjxgait.inspect.sections import GenomeView, print_shared, title, titled_table
from mjxgait.inspect.snapshot import Snapshot, shared

COLUMNS = ("part", "node", "on part", "joint", "size (cm)", "swing (deg)", "strength (N·m)")


class GraphView(GenomeView):
    """Grown parts; see `GenomeView`."""

    def facts(self, snapshot: Snapshot, i: int) -> dict[str, object]:
        """Implementation of `GenomeView`. size: m. swing: deg to either side. strength: N·m."""
        return {"parts": [_part(part) for part in _grown(snapshot, i)]}

    def spread(self, snapshot: Snapshot) -> dict[str, object]:
        """The number of parts, over the population."""
        counts = [len(_grown(snapshot, i)) for i in range(len(snapshot.genomes["graph.half"]))]
        return {"parts": {"mean": float(np.mean(counts)), "most": max(counts)}}

    def difference(self, a: Snapshot, b: Snapshot) -> dict[str, object]:
        """Both champions' parts."""
        alike = all(
            name in b.genomes and array.shape[1:] == b.genomes[name].shape[1:]
            for name, array in a.genomes.items()
        )
        return {
            "same_individuals": shared(a, b) if alike else None,
            "champion_parts": [[_part(part) for part in _grown(one, 0)] for one in (a, b)],
        }

    @override
    def show(
        self, individual: Mapping[str, Any], spread: Mapping[str, Any] | None, console: Console
    ) -> None:
        _print_parts(f"{title(individual)}: the body that grows", individual["parts"], console)
        if spread:
            counts = spread["parts"]
            console.print(
                f"the population's bodies have {counts['mean']:.1f} parts in the mean, "
                f"{counts['most']} at most"
            )

    @override
    def show_difference(self, found: Mapping[str, Any], console: Console) -> None:
        print_shared(found, console)
        for name, parts in zip("AB", found["champion_parts"], strict=True):
            _print_parts(f"champion of {name}", parts, console)


def _grown(snapshot: Snapshot, i: int) -> list[Part]:
    settings: Any = snapshot.config.controller
    genome = {name: array[i] for name, array in snapshot.genomes.items()}
    return grow(genome, settings.parts, settings.links)


def _part(part: Part) -> dict[str, object]:
    return {
        "node": part.node,
        "parent": part.parent,
        "joint": part.joint,
        "mirrored": part.mirrored,
        "size": (2 * part.half).tolist(),
        "swing": np.degrees(part.swing[: len(part.hinges)]).tolist(),
        "strength": part.strength,
    }


def _print_parts(heading: str, parts: list[dict[str, Any]], console: Console) -> None:
    table = titled_table(heading, console)
    for column in COLUMNS:
        table.add_column(column)
    for number, part in enumerate(parts):
        table.add_row(
            str(number),
            f"{part['node']}{' mirrored' if part['mirrored'] else ''}",
            str(part["parent"]) if number else "",
            part["joint"] if number else "",
            " x ".join(f"{100 * size:.0f}" for size in part["size"]),
            " ".join(f"{angle:.0f}" for angle in part["swing"]),
            f"{part['strength']:.1f}" if part["swing"] else "",
        )
    console.print(table)
