"""State of each island of a run, and their exchanges."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import pydantic
from rich.console import Console

from mjxgait.config.tables import STORED, Index, Number
from mjxgait.inspect.tables import show, titled_table
from mjxgait.training.folder import (
    ISLANDS,
    METRICS,
    MIGRATIONS,
    read_metrics,
    read_records,
)
from mjxgait.training.stored import is_number


@dataclasses.dataclass(frozen=True)
class _Exchange:
    """Schema of a line of `migrations.jsonl`: migrants to an island, best first."""

    __pydantic_config__ = STORED
    generation: int
    to: Index
    sender: Annotated[Index, pydantic.Field(alias="from")]
    fitness: Annotated[list[Number], pydantic.Field(min_length=1)]


def island_facts(run: Path, last: int) -> list[dict[str, Any]]:
    """Return a row per island up to a generation; none if the run has one population.

    arrived: number of migrants. ahead: number of exchanges with a migrant above the island's best.
    """
    told = [line for line in read_records(run / MIGRATIONS, _Exchange) if line["generation"] < last]
    known = [folder for folder in (run / ISLANDS).glob("*/") if is_number(folder.name)]
    folders = sorted(known, key=lambda folder: int(folder.name))
    return [row for folder in folders if (row := _row(folder, told, last))]


def print_islands(rows: Sequence[Mapping[str, Any]], console: Console) -> None:
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


def _row(folder: Path, told: Sequence[Mapping[str, Any]], last: int) -> dict[str, Any] | None:
    lines = [line for line in read_metrics(folder / METRICS) if line["generation"] <= last]
    if not lines:
        return None
    island = int(folder.name)
    come = [line for line in told if line["to"] == island]
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
