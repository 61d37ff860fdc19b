"""Scheduling with lost, late and newly joined workers; workers and clock are made up."""

import random
from typing import Any

import pytest

from mjxgait.distributed.scheduler import (
    FATAL,
    LATE,
    Report,
    Scheduler,
    Worker,
)
from mjxgait.errors import UserError


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


class Toys:
    """A backend with the seconds per job of each worker; a worker may be lost instead of done.

    A job is a number, its result the number's square. Waiting moves the clock to the next event.
    """

    def __init__(self, clock: Clock, seconds: list[float], fate: Any = lambda worker: None) -> None:
        self.clock, self.seconds, self.fate = clock, seconds, fate
        self.coming = [Worker(i, f"node {i}") for i in range(len(seconds))]
        self.at_work: dict[Worker, tuple[float, int]] = {}
        self.begun: list[tuple[int, int]] = []

    def arrivals(self) -> list[Worker]:
        coming, self.coming = self.coming, []
        return coming

    def start(self, worker: Worker, recipe: Any, job: Any) -> None:
        assert worker not in self.at_work
        self.begun.append((worker.number, job))
        self.at_work[worker] = self.clock.now + self.seconds[worker.number], job

    def wait(self, seconds: float) -> list[Report]:
        ends = [end for end, _ in self.at_work.values()]
        self.clock.now = min([self.clock.now + seconds, *ends])
        assert self.clock.now < 5000, "this is waited for in vain"
        done = [worker for worker, (end, _) in self.at_work.items() if end <= self.clock.now]
        return [self.report(worker, self.at_work.pop(worker)[1]) for worker in done]

    def report(self, worker: Worker, job: int) -> Report:
        fate = self.fate(worker)
        if isinstance(fate, Exception):
            return Report(worker, error=fate)
        return Report(worker, lost=fate) if fate else Report(worker, job**2)


def crew_of(seconds: list[float], **others: Any) -> tuple[Scheduler, Toys, list[str]]:
    clock, said = Clock(), []
    toys = Toys(clock, seconds, **others)
    return Scheduler(toys, said.append, clock=clock), toys, said


def work(*numbers: int) -> list[Any]:
    return [(None, number) for number in numbers]


def test_results_come_in_the_order_of_the_jobs():
    scheduler, toys, _ = crew_of([3.0, 1.0])
    assert scheduler.all(work(1, 2, 3, 4, 5)) == [1, 4, 9, 16, 25]
    assert len(toys.begun) == 5
    assert scheduler.done == {"node 0": 1, "node 1": 4}


def test_a_lost_workers_job_is_done_by_another():
    lost = iter(["killed"])
    scheduler, toys, said = crew_of([1.0, 1.0], fate=lambda worker: next(lost, None))
    assert scheduler.all(work(1, 2, 3)) == [1, 4, 9]
    assert len(toys.begun) == 4
    assert said == ["node 1: a worker is lost (killed); its work is done again"]


def test_a_job_that_loses_every_worker_ends_with_one_sentence():
    scheduler, toys, _ = crew_of([1.0] * (FATAL + 3), fate=lambda worker: "out of memory")
    with pytest.raises(UserError, match=f"has cost {FATAL} workers.*out of memory.*smaller"):
        scheduler.all(work(7))
    assert len(toys.begun) == FATAL


def test_a_stalled_worker_causes_only_a_bounded_delay():
    """The bound in docs/guide/cluster.md: `LATE` medians and the time of another worker."""
    scheduler, toys, _ = crew_of([1.0, 1e9])
    assert scheduler.all(work(*range(8))) == [n**2 for n in range(8)]
    assert [number for number, _ in toys.begun].count(1) == 1
    assert toys.clock.now <= 7 + LATE + 1.0 + 1.0


def test_a_late_job_is_given_to_one_other_worker_only():
    scheduler, toys, _ = crew_of([1.0, 1.0, 1.0, 50.0])
    scheduler.all(work(*range(10)))
    slow = [job for number, job in toys.begun if number == 3]
    assert [job for _, job in toys.begun].count(slow[0]) == 2


def test_only_the_first_result_of_a_job_counts():
    scheduler, _toys, _ = crew_of([1.0, 20.0])
    assert scheduler.all(work(*range(8))) == [n**2 for n in range(8)]
    assert scheduler.all(work(*range(40))) == [n**2 for n in range(40)]
    assert sum(scheduler.done.values()) == 48


def test_a_worker_that_joins_later_gets_jobs():
    scheduler, toys, _ = crew_of([1.0, 1.0])
    later = [toys.coming.pop()]
    toys.report = lambda worker, job: (
        toys.coming.extend(later),
        later.clear(),
        Report(worker, job),
    )[-1]
    scheduler.all(work(*range(6)))
    assert {number for number, _ in toys.begun} == {0, 1}


def test_an_error_of_a_job_is_raised_and_not_retried():
    scheduler, toys, _ = crew_of([1.0], fate=lambda worker: UserError("no such creature"))
    with pytest.raises(UserError, match="no such creature"):
        scheduler.all(work(1))
    assert len(toys.begun) == 1


def test_continued_jobs_come_before_new_ones():
    scheduler, _toys, _ = crew_of([1.0])
    for number in (1, 2):
        scheduler.submit(number, lambda number=number: (None, number))
    assert scheduler.next(lambda: False) == (1, 1)
    scheduler.submit(1, lambda: (None, 10), first=True)
    assert [scheduler.next(lambda: False) for _ in range(2)] == [(1, 100), (2, 4)]


def test_a_job_is_created_only_when_a_worker_is_idle():
    scheduler, _toys, _ = crew_of([1.0])
    made = []
    for number in range(3):
        scheduler.submit(number, lambda number=number: (made.append(number), number))
    scheduler.next(lambda: False)
    assert made == [0]


def test_the_scheduler_stops_on_request():
    scheduler, _, _ = crew_of([1.0])
    assert scheduler.all(work(1), stopped=lambda: True) is None


def test_missing_workers_are_reported_once():
    scheduler, toys, said = crew_of([])
    scheduler.submit(0, lambda: (None, 0))
    assert scheduler.next(lambda: toys.clock.now > 500) is None
    assert said == ["no worker is connected; waiting for machines to join"]


@pytest.mark.parametrize("seed", range(4))
def test_every_result_comes_exactly_once_despite_lost_workers(seed: int):
    """600 jobs on 30 workers of all speeds; every ninth job loses its worker."""
    chance, hired = random.Random(seed), []
    seconds = [chance.choice([1.0, 1.0, 2.0, 30.0]) for _ in range(30)]

    def fate(worker: Worker) -> str | None:
        if chance.random() > 0.11:
            return None
        hired.append(Worker(worker.number + 30, worker.node))
        seconds.extend([0.0] * (worker.number + 31 - len(seconds)))
        seconds[worker.number + 30] = 1.0
        toys.coming.append(hired[-1])
        return "killed"

    scheduler, toys, _ = crew_of(seconds, fate=fate)
    assert scheduler.all(work(*range(600))) == [n**2 for n in range(600)]
    assert len(hired) > 20
    assert scheduler.open == 0
