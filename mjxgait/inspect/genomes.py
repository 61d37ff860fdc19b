"""Report of a genome, for each kind of controller."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from rich.console import Console

from mjxgait.inspect.snapshot import Snapshot, shared
from mjxgait.inspect.tables import title, titled_table
from mjxgait.kinds import known_controller


class GenomeView(Protocol):
    """One kind of genome, as values for `--json` and as tables for the screen."""

    def facts(self, snapshot: Snapshot, i: int) -> dict[str, Any]:
        """Return the genome of the individual in place `i`."""
        ...

    def spread(self, snapshot: Snapshot) -> dict[str, Any]:
        """Return the standard deviation of the genomes' values over the population."""
        ...

    def difference(self, a: Snapshot, b: Snapshot) -> dict[str, Any]:
        """Return the difference of two populations and their champions; has `same_individuals`."""
        ...

    def show(
        self, individual: Mapping[str, Any], spread: Mapping[str, Any] | None, console: Console
    ) -> None:
        """Print an individual's genome, and the spread of the population."""
        ...

    def show_difference(self, found: Mapping[str, Any], console: Console) -> None:
        """Print a difference."""
        ...


class PlainView:
    """Report of named arrays, for every kind without its own report."""

    def facts(self, snapshot: Snapshot, i: int) -> dict[str, Any]:
        """See `GenomeView`."""
        return {"genome": {name: array[i].tolist() for name, array in snapshot.genomes.items()}}

    def spread(self, snapshot: Snapshot) -> dict[str, Any]:
        """See `GenomeView`."""
        spread = {name: array.std(axis=0).tolist() for name, array in snapshot.genomes.items()}
        return {"genome_spread": spread}

    def difference(self, a: Snapshot, b: Snapshot) -> dict[str, Any]:
        """See `GenomeView`: of the arrays that have the same shape in both."""
        mine, other = a.genomes, b.genomes
        alike = [n for n in mine if n in other and mine[n].shape[1:] == other[n].shape[1:]]
        return {
            "same_individuals": shared(a, b) if len(alike) == len(mine) == len(other) else None,
            "champion_moved": {name: (other[name][0] - mine[name][0]).tolist() for name in alike},
        }

    def show(
        self, individual: Mapping[str, Any], spread: Mapping[str, Any] | None, console: Console
    ) -> None:
        """See `GenomeView`."""
        _print_arrays(f"{title(individual)}: genome", individual["genome"], console)
        if spread:
            _print_arrays("spread over the population", spread["genome_spread"], console)

    def show_difference(self, found: Mapping[str, Any], console: Console) -> None:
        """See `GenomeView`."""
        if found["same_individuals"] is None:
            console.print("\nThe genomes differ in shape, so they cannot be compared in full.")
        else:
            console.print(f"\n{found['same_individuals']} genomes are in both populations.")
        _print_arrays("champion: from A to B", found["champion_moved"], console)


def view_of(controller: str) -> GenomeView:
    """Return the report for a controller's genomes; plain arrays if its kind has none."""
    kind = known_controller(controller)
    view: GenomeView = kind.part("report")() if kind and kind.report else PlainView()
    return view


def _print_arrays(heading: str, arrays: Mapping[str, Any], console: Console) -> None:
    table = titled_table(heading, console)
    table.add_column("array")
    table.add_column("values", overflow="fold")
    for name, values in arrays.items():
        table.add_row(name, " ".join(f"{value:.4g}" for value in np.ravel(values)))
    console.print(table)
