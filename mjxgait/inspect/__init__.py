"""Content of a checkpoint, read without compiling or simulating anything (docs/guide/seeing.md)."""

from mjxgait.inspect.facts import facts, individual_facts
from mjxgait.inspect.runs import (
    just_begun,
    list_runs,
    print_just_begun,
    print_runs,
    runs_in,
)
from mjxgait.inspect.snapshot import Snapshot, read_snapshot
from mjxgait.inspect.text import differences, print_differences, print_facts, print_individual

__all__ = [
    "Snapshot",
    "differences",
    "facts",
    "individual_facts",
    "just_begun",
    "list_runs",
    "print_differences",
    "print_facts",
    "print_individual",
    "print_just_begun",
    "print_runs",
    "read_snapshot",
    "runs_in",
]
