"""Success rates: what a line holds, what is refused, and how runs become rows."""

import dataclasses
from pathlib import Path

import pytest

from mjxgait.errors import UserError
from mjxgait.experiments.leaderboard import Entry, add, read_board, table, with_new
from mjxgait.files import DamagedFile

ONE = Entry(
    creature="stool",
    body="b0d1",
    task="walk",
    algorithm="poses",
    machine="2 cores",
    seed=0,
    champion="c0",
    certified=True,
    margin=0.2,
    evaluations=1000,
    seconds=20.0,
    version="0.1.0",
)
FAILED = dataclasses.replace(ONE, seed=1, champion="c1", certified=False, margin=None)
BETTER = dataclasses.replace(ONE, seed=2, champion="c2", margin=0.4, evaluations=3000, seconds=30.0)


def test_runs_are_added_once(tmp_path: Path):
    board = tmp_path / "board.jsonl"
    assert read_board(board) == []
    for entry in (ONE, FAILED, BETTER):
        add(board, entry)
    assert read_board(board) == [ONE, FAILED, BETTER]
    with pytest.raises(UserError, match="has seed 1 of stool walk poses already"):
        add(board, FAILED)
    assert read_board(board) == [ONE, FAILED, BETTER]
    new = dataclasses.replace(ONE, seed=7)
    assert with_new(board, [new]) == [ONE, FAILED, BETTER, new]
    for twice in ([new, FAILED], [new, new]):
        with pytest.raises(UserError, match="already"):
            with_new(board, twice)


def test_a_row_counts_failures_and_has_medians_of_the_certified():
    lamp = dataclasses.replace(FAILED, creature="lamp", algorithm="a|b")
    heading, _, first, second = table([ONE, FAILED, BETTER, lamp]).splitlines()
    assert heading.startswith("| creature | task | algorithm | machine | certified |")
    assert first == "| lamp | walk | a/b | 2 cores | 0 of 1 | 0.00 to 0.79 |  |  |  |"
    assert second == (
        "| stool | walk | poses | 2 cores | 2 of 3 | 0.21 to 0.94 | 0.30 | 2,000 | 25 |"
    )


@pytest.mark.parametrize("line", ['{"creature": 1}', "[1]", "not JSON"])
def test_a_damaged_line_is_named(tmp_path: Path, line: str):
    board = tmp_path / "board.jsonl"
    add(board, ONE)
    board.write_text(board.read_text() + line + "\n")
    with pytest.raises(DamagedFile, match=r"board\.jsonl, line 2"):
        read_board(board)


def test_the_docs_show_the_shipped_board():
    docs = Path(__file__).parents[2] / "docs"
    page = (docs / "research" / "results.md").read_text(encoding="utf-8")
    assert table(read_board(docs / "data" / "leaderboard.jsonl")) in page
