"""The log of a run's examination attempts."""

from pathlib import Path

import numpy as np
import pytest

from mjxgait.training.examination import Exams


@pytest.fixture
def exams(tmp_path: Path) -> Exams:
    book = Exams(tmp_path / "exams.jsonl")
    book.add("first", 10, passed=False, margin=0.1)
    book.add("second", 20, passed=True, margin=0.3)
    return book


def test_attempts_are_counted_in_the_order_of_generations(exams):
    assert exams.attempt("first", 10) == 1
    assert exams.attempt("second", 20) == 2
    assert exams.attempt("new", 25) == 3
    # From a checkpoint before the second attempt: later lines do not count yet.
    assert exams.attempt("new", 15) == 2
    assert [exams.taken(g) for g in (5, 10, 20, 99)] == [0, 1, 2, 2]


def test_the_same_champion_again_is_no_further_attempt(exams):
    exams.add("first", 10, passed=False, margin=0.1)
    assert exams.taken(99) == 2


def test_only_failed_champions_are_known_as_failed(exams):
    assert [exams.failed(name, 30) for name in ("first", "second", "new")] == [True, False, False]


def test_a_run_that_goes_back_ignores_later_attempts(exams):
    assert [exams.failed("first", g) for g in (9, 10)] == [False, True]


def test_the_largest_margin_that_failed_is_known(exams):
    """Also of a run that goes back. Earlier checkouts stored none."""
    exams.add("third", 30, passed=False, margin=0.05)
    exams.add("fourth", 40, passed=False, margin=-np.inf)
    assert [exams.margin_that_failed(g) for g in (9, 10, 99)] == [-np.inf, 0.1, 0.1]
    exams.path.write_text('{"generation": 3, "champion": "old", "passed": false}\n')
    assert exams.margin_that_failed(99) == -np.inf


def test_a_run_without_the_file_has_no_attempts(tmp_path):
    assert Exams(tmp_path / "none.jsonl").attempt("new", 3) == 1


def test_a_line_cut_off_by_a_kill_is_rewritten(exams):
    text = exams.path.read_text()
    exams.path.write_text(text[:-20])
    assert exams.taken(99) == 1
    exams.add("second", 20, passed=True, margin=0.3)
    assert exams.path.read_text() == text
