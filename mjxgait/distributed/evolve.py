"""Run of several populations, or of one on a cluster."""

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.table import Table

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.distributed import islands
from mjxgait.distributed.connect import connected
from mjxgait.distributed.rows import ChunkedEvaluator
from mjxgait.distributed.scheduler import LocalBackend, Scheduler
from mjxgait.errors import UserError
from mjxgait.training import loop
from mjxgait.training.initial import Initial
from mjxgait.training.screen import Screen

A_SECOND = 4
"""Table updates per second; with thousands of workers one takes as long as handing out work."""


@contextlib.contextmanager
def scheduler_at(address: str | None, console: Console | None = None) -> Iterator[Scheduler]:
    """Yield the scheduler of the cluster at an address, shown live; without one this process alone.

    Raises:
      UserError: see `connected`.
    """
    if address is None:
        yield Scheduler(LocalBackend())
        return
    with Dashboard(console) as board, connected(address, board.tell, board.watch) as scheduler:
        yield scheduler


class Dashboard:
    """Live table of what each machine does."""

    def __init__(self, console: Console | None = None) -> None:
        self.console = console or Console(highlight=False, soft_wrap=True, markup=False)
        self._live = Live(console=self.console, transient=True, refresh_per_second=A_SECOND)
        self._shown = 0.0

    def __enter__(self) -> Self:
        if self.console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self._live.stop()

    def tell(self, said: str) -> None:
        """Print a message on its own line."""
        self.console.print(f"cluster: {said}")

    def watch(self, scheduler: Scheduler) -> None:
        """Update the table."""
        if self.console.is_terminal and time.monotonic() - self._shown > 1 / A_SECOND:
            self._shown = time.monotonic()
            self._live.update(table(scheduler))


def table(scheduler: Scheduler) -> Table:
    """Make a row per machine: its workers, how many of them work, and the jobs it has done."""
    busy = Counter(worker.node for worker in scheduler.busy)
    there = busy + Counter(worker.node for worker in scheduler.idle)
    shown = Table("machine", box=None, pad_edge=False)
    for heading in ("workers", "at work", "done"):
        shown.add_column(heading, justify="right")
    for node in sorted(there.keys() | scheduler.done.keys()):
        counts = (there[node], busy[node], scheduler.done.get(node, 0))
        shown.add_row(node, *map(str, counts))
    shown.caption = f"pieces of work left: {scheduler.open}"
    return shown


def evolve(
    folder: Path,
    creature: Creature,
    config: Config,
    screen: Screen,
    resume: bool = False,
    generation: int | None = None,
    cluster: str | None = None,
    begin: Callable[[], object] = lambda: None,
    ancestors: Callable[[], Initial | None] | None = None,
) -> bool:
    """Start or resume islands, or a run on a cluster; return whether it reached its end.

    Args:
      resume, generation, begin, ancestors: see `loop.train`. Islands have no ancestors.
      cluster: address of the cluster that computes it, if not this machine.

    Raises:
      UserError: see `connected`; a single checkpoint was named, and there are islands; or another
        process works on the run.
    """
    several = config.evolution.islands.count > 1
    if several and generation is not None:
        raise UserError(f"{folder}: islands go on from their latest checkpoints, not --generation")
    with scheduler_at(cluster, screen.progress) as scheduler:
        if several:
            return islands.train(folder, creature, config, screen, scheduler, resume, begin)
        evaluator = ChunkedEvaluator(scheduler, creature, config)
        at = resume, generation, evaluator, begin
        return loop.train(folder, creature, config, screen, *at, ancestors=ancestors)
