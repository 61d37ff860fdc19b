"""Scheduler: dispatches jobs to idle workers, retries lost jobs, and duplicates late ones.

It depends neither on what the jobs do nor on where the workers are.
"""

import dataclasses
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterable
from functools import partial
from statistics import median
from typing import Any, Protocol, TypeVar

from typing_extensions import override

from mjxgait.distributed.jobs import Job, Programs, Recipe
from mjxgait.errors import UserError
from mjxgait.output import Tell, silent

Result = TypeVar("Result")

LATE = 2.0
"""Times the median duration after which a job is given to a second worker too, once no other job
waits; the first result counts. A stalled worker thus delays a run by no more than this and the
second worker's time.
"""
FEW, MANY = 3, 64
"""Jobs done before any can be late, and durations remembered."""
FATAL = 5
"""Workers that one job may cost."""
TICK = 0.2
"""Seconds between two checks for late jobs and for a stop request."""
ALONE = 60.0
"""Seconds without workers after which a message says so."""

Make = Callable[[], tuple[Recipe, Job]]
"""Makes a job when a worker is there to do it."""


@dataclasses.dataclass(frozen=True)
class Worker:
    """A worker that does one job at a time. node: name of its machine."""

    number: int
    node: str


@dataclasses.dataclass(frozen=True)
class Report:
    """Result of a worker's job: its value, why the worker is lost, or the job's own error."""

    worker: Worker
    value: Any = None
    lost: str | None = None
    error: Exception | None = None


class Backend(Protocol):
    """Backend: provides workers and runs jobs on them."""

    def arrivals(self) -> list[Worker]:
        """Return the workers that joined since the last call."""
        ...

    def start(self, worker: Worker, recipe: Recipe, job: Job) -> None:
        """Start a job on an idle worker."""
        ...

    def wait(self, seconds: float) -> list[Report]:
        """Return the reports as soon as there are any, or none after `seconds`."""
        ...


@dataclasses.dataclass(eq=False)
class _Task:
    key: Hashable
    make: Make
    work: tuple[Recipe, Job] | None = None
    losses: int = 0
    workers: int = 0
    """Workers now at the job."""


@dataclasses.dataclass(frozen=True)
class _Turn:
    task: _Task
    began: float


def _as_it_is(piece: tuple[Recipe, Job]) -> tuple[Recipe, Job]:
    return piece


def _never() -> bool:
    return False


class Scheduler:
    """Available workers and their jobs.

    tell: called with messages for the user. watch: called with the scheduler now and then.
    """

    def __init__(
        self,
        backend: Backend,
        tell: Tell = silent,
        watch: Callable[["Scheduler"], object] = lambda scheduler: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.backend, self._tell, self._watch, self._clock = backend, tell, watch, clock
        self._waiting: deque[_Task] = deque()
        self._open: dict[Hashable, _Task] = {}
        self._ready: deque[tuple[Hashable, object]] = deque()
        self._took: deque[float] = deque(maxlen=MANY)
        self._alone_since: float | None = clock()
        self.idle: list[Worker] = []
        self.busy: dict[Worker, _Turn] = {}
        self.done: dict[str, int] = {}
        """Jobs done, by node."""

    @property
    def open(self) -> int:
        """Number of jobs not yet done."""
        return len(self._open)

    def submit(self, key: Hashable, make: Make, first: bool = False) -> None:
        """Queue a job under a key that is not in use. first: ahead of all waiting jobs."""
        task = self._open[key] = _Task(key, make)
        (self._waiting.appendleft if first else self._waiting.append)(task)

    def all(
        self, work: Iterable[tuple[Recipe, Job[Result]]], stopped: Callable[[], bool] = _never
    ) -> list[Result] | None:
        """Return the results of all jobs, in order; None when stopped."""
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
        """Return the next result with its key, in no order; None when stopped.

        Raises:
          UserError: a job has cost too many workers.
        """
        while not stopped():
            if self._ready:
                return self._ready.popleft()
            self._turn()
        return None

    def _turn(self) -> None:
        self.idle += self.backend.arrivals()
        self._look_around()
        self._hand_out()
        for report in self.backend.wait(TICK):
            self._take(report)
        self._watch(self)

    def _hand_out(self) -> None:
        while self.idle and (task := self._waiting.popleft() if self._waiting else self._late()):
            task.work = task.work or task.make()
            worker = self.idle.pop()
            task.workers += 1
            self.busy[worker] = _Turn(task, self._clock())
            self.backend.start(worker, *task.work)

    def _late(self) -> _Task | None:
        """Return the oldest late job that has one worker only."""
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
            return  # another worker was first
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
        """Report once that there has been no worker for a while."""
        if self.idle or self.busy:
            self._alone_since = self._clock()
        elif self._alone_since is not None and self._clock() - self._alone_since > ALONE:
            self._alone_since = None
            self._tell("no worker is connected; waiting for machines to join")


class LocalBackend(Backend):
    """Implementation of `Backend`. programs: those that this process has already compiled."""

    def __init__(self, programs: Programs | None = None) -> None:
        self._programs = programs or Programs()
        self._coming = [Worker(0, "here")]
        self._work: tuple[Worker, Recipe, Job] | None = None

    @override
    def arrivals(self) -> list[Worker]:
        coming, self._coming = self._coming, []
        return coming

    @override
    def start(self, worker: Worker, recipe: Recipe, job: Job) -> None:
        self._work = worker, recipe, job

    def wait(self, seconds: float) -> list[Report]:
        """An error of the job is raised unchanged."""
        if self._work is None:
            return []
        (worker, recipe, job), self._work = self._work, None
        return [Report(worker, job.do(self._programs, recipe))]
