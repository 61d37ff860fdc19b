"""Tables on the screen, and their numbers."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table


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


def print_columns(title: str, rows: Mapping[str, list[Any]], console: Console) -> None:
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


def title(individual: Mapping[str, Any]) -> str:
    """Return an individual's title."""
    return "champion" if individual["rank"] == 1 else f"individual {individual['rank']}"
