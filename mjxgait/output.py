"""What a command prints: results, and progress, which is logged too.

Progress goes to the logger "mjxgait" at level INFO, details of the machine at DEBUG. From Python,
`logging.basicConfig(level="INFO")` shows what a run with `quiet=True` does.
"""

import io
import logging
from collections.abc import Callable

from rich.console import Console

LOG = logging.getLogger("mjxgait")

Tell = Callable[[str], object]
"""Receives lines of a report."""


def silent(said: str) -> None:
    """Drop a line of a report."""


class Output:
    """Prints results, and progress unless quiet."""

    def __init__(self, console: Console | None = None, quiet: bool = False) -> None:
        self.console = console or Console(
            highlight=False, soft_wrap=True, markup=False, emoji=False
        )
        self.progress = Console(file=io.StringIO(), quiet=True) if quiet else self.console

    def say(self, text: str) -> None:
        """Print and log a line of progress."""
        LOG.info("%s", text)
        self.progress.print(text)


def duration(seconds: float) -> str:
    """Return a time in s, min or h, as text."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def print_details() -> None:
    """Print the details of level DEBUG to the standard error, with the time of day."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    # Progress is printed already.
    handler.addFilter(lambda record: record.levelno == logging.DEBUG)
    LOG.setLevel(logging.DEBUG)
    LOG.addHandler(handler)
