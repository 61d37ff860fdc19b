"""Parts of a report: tables, genomes, islands."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Protocol, TypedDict

import numpy as np
import pydantic
from numpy.typing import ArrayLike
from rich.console import Console
from rich.table import Table
from typing_extensions import override

from mjxgait.config.tables import STORED, Index, Number
from mjxgait.inspect.snapshot import Snapshot, shared
from mjxgait.kinds import known_controller
from mjxgait.training.folder import ISLANDS, METRICS, MIGRATIONS
from mjxgait.training.logs import Line, read_metrics, read_records
from mjxgait.training.stored import is_number

Facts = Mapping[str, Any]
"""Values of a report by name, ready for JSON; each kind of genome has names of its own."""


def show(value: float | None, sign: bool = False) -> str:
    """Return a number as text for a table."""
    if value is None:
        return "none"
    text = f"{value:+.2f}" if sign else f"{value:.3f}"
    return "0" if float(text) == 0 else text


def titled_table(title: str, console: Console) -> Table:
    """Print a heading and return the empty table to print below it."""
    console.print(f"\n{title}", style="bold")
    return Table(box=None, pad_edge=False)


def print_pairs(rows: Mapping[str, str], console: Console) -> None:
    """Print names and values in two columns."""
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows.items():
        table.add_row(name, value)
    console.print(table)


def print_columns(title: str, rows: Mapping[str, Sequence[object]], console: Console) -> None:
    """Print the values of A and B side by side."""
    if not rows:
        console.print(f"\n{title}: no difference")
        return
    table = titled_table(title, console)
    for name in ("", "A", "B"):
        table.add_column(name)
    for key, (x, y) in rows.items():
        table.add_row(key.replace("_", " ") if title == "fitness" else key, str(x), str(y))
    console.print(table)


def print_shared(found: Facts, console: Console) -> None:
    """Print the number of genomes that are in both populations of a difference."""
    if found["same_individuals"] is None:
        console.print("\nThe genomes differ in shape, so they cannot be compared in full.")
    else:
        console.print(f"\n{found['same_individuals']} genomes are in both populations.")


def title(individual: Facts) -> str:
    """Return an individual's title."""
    return "champion" if individual["rank"] == 1 else f"individual {individual['rank']}"


class GenomeView(Protocol):
    """One kind of genome, as values for `--json` and as tables for the screen."""

    def facts(self, snapshot: Snapshot, i: int) -> dict[str, object]:
        """Return the genome of the individual in place `i`."""
        ...

    def spread(self, snapshot: Snapshot) -> dict[str, object]:
        """Return the standard deviation of the genomes' values over the population."""
        ...

    def difference(self, a: Snapshot, b: Snapshot) -> dict[str, object]:
        """Return the difference of two populations and their champions; has `same_individuals`."""
        ...

    def show(self, individual: Facts, spread: Facts | None, console: Console) -> None:
        """Print an individual's genome, and the spread of the population."""
        ...

    def show_difference(self, found: Facts, console: Console) -> None:
        """Print a difference."""
        ...


class PlainView(GenomeView):
    """Report of named arrays, for every kind without its own report."""

    @override
    def facts(self, snapshot: Snapshot, i: int) -> dict[str, object]:
        return {"genome": {name: array[i].tolist() for name, array in snapshot.genomes.items()}}

    @override
    def spread(self, snapshot: Snapshot) -> dict[str, object]:
        spread = {name: array.std(axis=0).tolist() for name, array in snapshot.genomes.items()}
        return {"genome_spread": spread}

    def difference(self, a: Snapshot, b: Snapshot) -> dict[str, object]:
        """Difference of the arrays that have the same shape in both."""
        mine, other = a.genomes, b.genomes
        alike = [n for n in mine if n in other and mine[n].shape[1:] == other[n].shape[1:]]
        return {
            "same_individuals": shared(a, b) if len(alike) == len(mine) == len(other) else None,
            "champion_moved": {name: (other[name][0] - mine[name][0]).tolist() for name in alike},
        }

    @override
    def show(self, individual: Facts, spread: Facts | None, console: Console) -> None:
        _print_arrays(f"{title(individual)}: genome", individual["genome"], console)
        if spread:
            _print_arrays("spread over the population", spread["genome_spread"], console)

    @override
    def show_difference(self, found: Facts, console: Console) -> None:
        print_shared(found, console)
        _print_arrays("champion: from A to B", found["champion_moved"], console)


def view_of(controller: str) -> GenomeView:
    """Return the report for a controller's genomes; plain arrays if its kind has none."""
    kind = known_controller(controller)
    view: GenomeView = kind.part("report")() if kind and kind.report else PlainView()
    return view


def _print_arrays(heading: str, arrays: Mapping[str, ArrayLike], console: Console) -> None:
    table = titled_table(heading, console)
    table.add_column("array")
    table.add_column("values", overflow="fold")
    for name, values in arrays.items():
        table.add_row(name, " ".join(f"{value:.4g}" for value in np.ravel(values)))
    console.print(table)


@dataclasses.dataclass(frozen=True)
class _Exchange:
    """Schema of a line of `migrations.jsonl`: migrants to an island, best first."""

    __pydantic_config__ = STORED
    generation: int
    to: Index
    sender: Annotated[Index, pydantic.Field(alias="from")]
    fitness: Annotated[list[Number], pydantic.Field(min_length=1)]


IslandRow = TypedDict(
    "IslandRow",
    {
        "island": int,
        "best": float | None,
        "mean": float | None,
        "arrived": int,
        "ahead": int,
        "from": list[int],
    },
)
"""An island in numbers; see `island_facts`."""


def island_facts(run: Path, last: int) -> list[IslandRow]:
    """Return a row per island up to a generation; none if the run has one population.

    arrived: number of migrants. ahead: number of exchanges with a migrant above the island's best.
    """
    exchanges = [
        line for line in read_records(run / MIGRATIONS, _Exchange) if line["generation"] < last
    ]
    known = [folder for folder in (run / ISLANDS).glob("*/") if is_number(folder.name)]
    folders = sorted(known, key=lambda folder: int(folder.name))
    return [row for folder in folders if (row := _row(folder, exchanges, last))]


def print_islands(rows: Sequence[IslandRow], console: Console) -> None:
    """Print the islands as a table."""
    if not rows:
        return
    table = titled_table("islands; how many migrants came to each, and from where", console)
    for heading in ("island", "best", "mean", "arrived", "ahead", "from"):
        table.add_column(heading, justify="left" if heading == "from" else "right")
    for row in rows:
        where = ", ".join(map(str, row["from"])) or "-"
        values = (show(row["best"]), show(row["mean"]), str(row["arrived"]), str(row["ahead"]))
        table.add_row(str(row["island"]), *values, where)
    console.print(table)


def _row(folder: Path, exchanges: Sequence[Line], last: int) -> IslandRow | None:
    lines = [line for line in read_metrics(folder / METRICS) if line["generation"] <= last]
    if not lines:
        return None
    island = int(folder.name)
    come = [line for line in exchanges if line["to"] == island]
    best = {line["generation"]: line["best"] for line in lines}
    return {
        "island": island,
        "best": lines[-1]["best"],
        "mean": lines[-1]["mean"],
        "arrived": sum(len(line["fitness"]) for line in come),
        "ahead": sum(_above(line["fitness"][0], best.get(line["generation"])) for line in come),
        "from": sorted({line["from"] for line in come}),
    }


def _above(arrived: float, own: float | None) -> bool:
    return own is None or arrived > own
