"""Host loop of runs whose generations are jobs: hand out, store the results, go on."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol, cast

from mjxgait.distributed.jobs import Advanced, Job, Recipe
from mjxgait.distributed.scheduler import Scheduler


class Group(Protocol):
    """Runs that advance together, from one stop to the next."""

    @property
    def jobs(self) -> int:
        """Number of jobs that lead to the next stop."""
        ...

    @property
    def ended(self) -> bool:
        """Whether there is no further stop."""
        ...

    def job(self, number: int) -> tuple[Recipe, Job[Advanced]]:
        """Return a job, made when a worker is there to do it."""
        ...

    def keep(self, done: Sequence[Advanced]) -> None:
        """Store the results of all jobs, in their order."""
        ...

    def close(self) -> None:
        """Wait until everything is on disk."""
        ...


def drive(groups: Sequence[Group], scheduler: Scheduler, stopped: Callable[[], bool]) -> bool:
    """Advance all groups to their ends; return whether they got there. All are closed.

    A group that has begun comes before those that have not, so that few are open at a time.
    """
    done: list[dict[int, Advanced]] = [{} for _ in groups]

    def submit(at: int, first: bool) -> None:
        numbers = range(groups[at].jobs)
        for number in reversed(numbers) if first else numbers:
            scheduler.submit((at, number), partial(groups[at].job, number), first)

    def go_on(at: int, first: bool) -> None:
        if not groups[at].ended:
            submit(at, first)
        else:
            left.remove(at)
            groups[at].close()

    left = set(range(len(groups)))
    try:
        for at in range(len(groups)):
            go_on(at, first=False)
        while left and (found := scheduler.next(stopped)):
            (at, number), advanced = cast(tuple[tuple[int, int], Advanced], found)
            done[at][number] = advanced
            if len(done[at]) == groups[at].jobs:
                groups[at].keep([done[at].pop(n) for n in range(groups[at].jobs)])
                go_on(at, first=True)
    finally:
        for at in left:
            groups[at].close()
    return not left
