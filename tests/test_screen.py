"""What a run says at its end."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from mjxgait.runs.screen import Screen


@pytest.mark.parametrize(
    ("best", "forward", "said"),
    [
        (1.5, 3.25, ("1.500 in generation 4", "forward 3.25 per episode")),
        (None, None, ("nobody could be judged",)),
    ],
    ids=["judged", "nobody judged"],
)
def test_the_report_tells_the_best_or_that_there_is_none(
    tmp_path: Path, best: float | None, forward: float | None, said: tuple[str, ...]
):
    out = io.StringIO()
    last = {"best": best, "generation": 4, "outcome_forward": forward}
    screen = Screen(Console(file=out, width=300))
    screen.report(tmp_path, "done", last, 1.0, interrupted=False)
    assert all(words in out.getvalue() for words in said)
