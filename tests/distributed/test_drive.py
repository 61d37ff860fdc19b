"""The host loop of runs whose generations are jobs."""

from types import SimpleNamespace
from typing import Any

import pytest

from mjxgait.distributed.drive import drive
from mjxgait.distributed.scheduler import LocalBackend, Scheduler


class Counted:
    """A group that counts to `last`, with several jobs for each step."""

    def __init__(self, name: str, log: list[str], last: int, jobs: int = 1) -> None:
        self.name, self.log, self.last, self.jobs = name, log, last, jobs
        self.at = 0
        self.closed = 0

    @property
    def ended(self) -> bool:
        return self.at == self.last

    def job(self, number: int) -> tuple[Any, Any]:
        self.log.append(f"{self.name}{self.at}.{number}")
        return None, SimpleNamespace(do=lambda programs, recipe, at=self.at: (at, number))

    def keep(self, done: list[Any]) -> None:
        assert done == [(self.at, number) for number in range(self.jobs)]
        self.at += 1

    def close(self) -> None:
        self.closed += 1


def driven(*groups: Counted, jobs: int = 99) -> bool:
    left = iter(range(jobs))
    return drive(groups, Scheduler(LocalBackend()), lambda: next(left, None) is None)


def test_a_group_that_has_begun_comes_before_the_others():
    log: list[str] = []
    assert driven(Counted("a", log, 2), Counted("b", log, 1))
    assert log == ["a0.0", "a1.0", "b0.0"]


def test_a_group_goes_on_when_all_its_jobs_are_done():
    log: list[str] = []
    assert driven(Counted("a", log, 2, jobs=3))
    assert log == ["a0.0", "a0.1", "a0.2", "a1.0", "a1.1", "a1.2"]


@pytest.mark.parametrize(("jobs", "ends"), [(0, False), (3, False), (99, True)])
def test_every_group_is_closed_once(jobs: int, ends: bool):
    groups = [Counted("a", [], 2), Counted("b", [], 1, jobs=2), Counted("c", [], 0)]
    assert driven(*groups, jobs=jobs) == ends
    assert [group.closed for group in groups] == [1, 1, 1]
    assert all(group.ended for group in groups) == ends


def test_an_error_while_results_are_stored_closes_all_groups():
    first, second = Counted("a", [], 1), Counted("b", [], 1)
    first.keep = lambda done: 1 / 0
    with pytest.raises(ZeroDivisionError):
        driven(first, second)
    assert [first.closed, second.closed] == [1, 1]
