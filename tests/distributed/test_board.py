"""The dashboard of a cluster's machines."""

import io

import pytest
from rich.console import Console

from mjxgait.distributed.evolve import Dashboard, table
from mjxgait.distributed.scheduler import LocalBackend, Scheduler, Worker


@pytest.fixture
def scheduler() -> Scheduler:
    """Two workers on one machine, one busy; an idle one on another; a third machine has left."""
    made = Scheduler(LocalBackend())
    one, other, third = Worker(0, "10.0.0.5"), Worker(1, "10.0.0.5"), Worker(2, "10.0.0.7")
    made.submit("work", lambda: (None, None))
    made.busy = {one: None}
    made.idle = [other, third]
    made.done = {"10.0.0.5": 12, "10.0.0.6": 3}
    return made


def shown(scheduler: Scheduler, terminal: bool) -> str:
    out = io.StringIO()
    console = Console(file=out, force_terminal=terminal, width=80, highlight=False)
    with Dashboard(console) as board:
        board.tell("10.0.0.6 has left")
        board.watch(scheduler)
    return out.getvalue()


def test_a_row_per_machine(scheduler: Scheduler):
    out = io.StringIO()
    Console(file=out, width=80).print(table(scheduler))
    head, *rows, caption = [line.split() for line in out.getvalue().splitlines()]
    assert head == ["machine", "workers", "at", "work", "done"]
    assert rows == [
        ["10.0.0.5", "2", "1", "12"],
        ["10.0.0.6", "0", "0", "3"],
        ["10.0.0.7", "1", "0", "0"],
    ]
    assert " ".join(caption) == "pieces of work left: 1"


def test_the_dashboard_is_a_table_in_a_terminal_and_lines_elsewhere(scheduler: Scheduler):
    assert "cluster: 10.0.0.6 has left" in shown(scheduler, terminal=True)
    assert "at work" in shown(scheduler, terminal=True)
    assert shown(scheduler, terminal=False) == "cluster: 10.0.0.6 has left\n"
