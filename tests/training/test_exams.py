"""The log of a run's examination attempts."""

from pathlib import Path

import pytest

from mjxgait.training.exams import Exams


@pytest.fixture
def exams(tmp_path: Path) -> Exams:
    book = Exams(tmp_path / "exams.jsonl")
    book.add("first", 10, passed=False)
    book.add("second", 20, passed=True)
    return book


def test_attempts_are_counted_in_the_order_of_generations(exams):
    assert exams.attempt("first", 10) == 1
    assert exams.attempt("second", 20) == 2
    assert exams.attempt("new", 25) == 3
    # From a checkpoint before the second attempt: later lines do not count yet.
    assert exams.attempt("new", 15) == 2
    assert [exams.taken(g) for g in (5, 10, 20, 99)] == [0, 1, 2, 2]


def test_the_same_champion_again_is_no_further_attempt(exams):
    exams.add("first", 10, passed=False)
    assert exams.taken(99) == 2


def test_only_failed_champions_are_known_as_failed(exams):
    assert [exams.failed(name, 30) for name in ("first", "second", "new")] == [True, False, False]


def test_a_run_that_goes_back_ignores_later_attempts(exams):
    assert [exams.failed("first", g) for g in (9, 10)] == [False, True]


def test_whether_any_failed_is_known_by_generation(exams):
    """Also of a run that goes back, and of an earlier checkout: its lines have another key."""
    assert [exams.any_failed(g) for g in (9, 10, 99)] == [False, True, True]
    exams.path.write_text('{"generation": 3, "champion": "old", "passed": false, "margin": 0.1}\n')
    assert exams.any_failed(3)


def test_a_run_without_the_file_has_no_attempts(tmp_path):
    assert Exams(tmp_path / "none.jsonl").attempt("new", 3) == 1


def test_a_line_cut_off_by_a_kill_is_rewritten(exams):
    text = exams.path.read_text()
    exams.path.write_text(text[:-20])
    assert exams.taken(99) == 1
    exams.add("second", 20, passed=True)
    assert exams.path.read_text() == text
