"""Hands work out to whoever is idle and collects it: lost work is given to somebody else, late work to somebody as well.

Nothing here knows what the work is or where the hands are.
"""

import dataclasses
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterable
from functools import partial
from statistics import median
from typing import Any, Protocol

from mjxgait.distributed.jobs import Job
from mjxgait.distributed.recipe import Recipe
from mjxgait.errors import UserError

LATE = 2.0
"""Work that takes so many times as long as the median is given to somebody else too, once nothing
else waits: whoever is first counts. So nobody waits for one that stands still for longer than this
and the time that the other takes.
"""
FEW, MANY = 3, 64
"""How much must have been done before anything is called late, and what is remembered of it."""
FATAL = 5
"""Workers that one piece of work may cost."""
TICK = 0.2
"""Seconds between two looks at who is late and whether to stop."""
ALONE = 60.0
"""Seconds without anybody after which it is said."""

Make = Callable[[], tuple[Recipe, Job]]
"""Work, made when somebody is there to do it."""


@dataclasses.dataclass(frozen=True)
class Worker:
    """Somebody who does one thing at a time. node: name of the machine."""

    number: int
    node: str


@dataclasses.dataclass(frozen=True)
class Report:
    """What became of a worker's work: its value, or why the worker is lost, or an error of the work itself."""

    worker: Worker
    value: Any = None
    lost: str | None = None
    error: Exception | None = None


class Hands(Protocol):
    """Workers, wherever they are."""

    def arrivals(self) -> list[Worker]:
        """Who has come since the last call."""
        ...

    def start(self, worker: Worker, recipe: Recipe, job: Job) -> None:
        """Has an idle worker begin."""
        ...

    def wait(self, seconds: float) -> list[Report]:
        """What has happened, as soon as there is something, or nothing after so long."""
        ...


@dataclasses.dataclass(eq=False)
class _Task:
    key: Hashable
    make: Make
    work: tuple[Recipe, Job] | None = None
    losses: int = 0
    workers: int = 0
    """That are at it."""


@dataclasses.dataclass(frozen=True)
class _Turn:
    task: _Task
    began: float


def _as_it_is(piece: tuple[Recipe, Job]) -> tuple[Recipe, Job]:
    return piece


def _never() -> bool:
    return False


class Crew:
    """Those at hand. tell: called with what a user should know. watch: called with the crew now and then."""

    def __init__(
        self,
        hands: Hands,
        tell: Callable[[str], object] = lambda said: None,
        watch: Callable[["Crew"], object] = lambda crew: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.hands, self._tell, self._watch, self._clock = hands, tell, watch, clock
        self._waiting: deque[_Task] = deque()
        self._open: dict[Hashable, _Task] = {}
        self._ready: deque[tuple[Hashable, Any]] = deque()
        self._took: deque[float] = deque(maxlen=MANY)
        self._alone_since: float | None = clock()
        self.idle: list[Worker] = []
        self.busy: dict[Worker, _Turn] = {}
        self.done: dict[str, int] = {}
        """Pieces of work that have come back, by node."""

    @property
    def open(self) -> int:
        """Pieces of work that nobody has done yet."""
        return len(self._open)

    def submit(self, key: Hashable, make: Make, first: bool = False) -> None:
        """Has work done under a key that is not in use. first: before all that waits."""
        task = self._open[key] = _Task(key, make)
        (self._waiting.appendleft if first else self._waiting.append)(task)

    def all(
        self, work: Iterable[tuple[Recipe, Job]], stopped: Callable[[], bool] = _never
    ) -> list[Any] | None:
        """The results of all of it, in order; None when told to stop."""
        keys: list[Hashable] = []
        found: dict[Hashable, Any] = {}
        for piece in work:
            keys.append(object())
            self.submit(keys[-1], partial(_as_it_is, piece))
        while len(found) < len(keys):
            if (done := self.next(stopped)) is None:
                return None
            found[done[0]] = done[1]
        return [found[key] for key in keys]

    def next(self, stopped: Callable[[], bool]) -> tuple[Hashable, Any] | None:
        """The next result with its key, in no order; None when told to stop.

        Raises:
          UserError: a piece of work has cost too many workers.
        """
        while not stopped():
            if self._ready:
                return self._ready.popleft()
            self._turn()
        return None

    def _turn(self) -> None:
        self.idle += self.hands.arrivals()
        self._look_around()
        self._hand_out()
        for report in self.hands.wait(TICK):
            self._take(report)
        self._watch(self)

    def _hand_out(self) -> None:
        while self.idle and (task := self._waiting.popleft() if self._waiting else self._late()):
            task.work = task.work or task.make()
            worker = self.idle.pop()
            task.workers += 1
            self.busy[worker] = _Turn(task, self._clock())
            self.hands.start(worker, *task.work)

    def _late(self) -> _Task | None:
        """The oldest work that one worker alone is late with."""
        if len(self._took) < FEW:
            return None
        limit = self._clock() - LATE * median(self._took)
        for turn in self.busy.values():  # in the order in which they began
            if turn.began >= limit:
                return None
            if turn.task.key in self._open and turn.task.workers == 1:
                return turn.task
        return None

    def _take(self, report: Report) -> None:
        turn, worker = self.busy.pop(report.worker), report.worker
        task = turn.task
        task.workers -= 1
        if report.lost is None:
            self.idle.append(worker)
        if self._open.get(task.key) is not task:
            return  # somebody else was first
        if report.error is not None:
            raise report.error
        if report.lost is not None:
            self._lose(task, worker, report.lost)
            return
        del self._open[task.key]
        self._took.append(self._clock() - turn.began)
        self.done[worker.node] = self.done.get(worker.node, 0) + 1
        self._ready.append((task.key, report.value))

    def _lose(self, task: _Task, worker: Worker, why: str) -> None:
        self._tell(f"{worker.node}: a worker is lost ({why}); its work is done again")
        task.losses += 1
        if task.losses >= FATAL:
            raise UserError(
                f"one piece of work has cost {FATAL} workers, the last on {worker.node} ({why}); "
                "it may need more memory than they have: make it smaller, and go on with --resume"
            )
        if not task.workers:
            self._waiting.appendleft(task)

    def _look_around(self) -> None:
        """Says once when nobody has been there for a while."""
        if self.idle or self.busy:
            self._alone_since = self._clock()
        elif self._alone_since is not None and self._clock() - self._alone_since > ALONE:
            self._alone_since = None
            self._tell("nobody is there to work; waiting for machines to join")
