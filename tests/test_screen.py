"""What a run says at its end."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from mjxgait.certify import Certificate, CertificateConfig
from mjxgait.certify.criteria import Criterion, Measure
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


def test_a_verdict_without_numbers_is_a_sentence():
    """Of a motion that strides nowhere most measures have no value, and the worst margin is -inf."""
    out = io.StringIO()
    screen = Screen(Console(file=out, width=300))
    periodic = Criterion(3, "periodic", (Measure("variation", float("nan"), "<=", 0.1, 0.1),))
    report = {"summary": "none, 0.00 m/s", "overlap": None, "obstacle": "never left its place"}
    config = CertificateConfig()
    screen.certificate(Certificate("stool", "", "walk", "", (periodic,), report, config, 1.0))
    told = out.getvalue()
    assert "Not certified: it never left its place" in told
    assert "nan" not in told
    assert "inf" not in told


def test_a_run_that_has_ended_tells_what_to_do_next(tmp_path: Path):
    out = io.StringIO()
    screen = Screen(Console(file=out, width=300))
    run = tmp_path / "a run"
    screen.next_steps(run, certified=True)
    told = out.getvalue()
    for command in ("render", "share", "export"):
        assert f"mjxgait {command} '{run}'" in told
    assert "inspect" not in told
    screen.next_steps(run, certified=False)
    assert f"mjxgait inspect '{run}'" in out.getvalue()


def test_the_words_of_a_line_are_explained_once():
    out = io.StringIO()
    screen = Screen(Console(file=out, width=300))
    line = {"best": 1.0, "mean": 0.5, "episodes": 8, "failures": 2, "forced": False}
    for generation in range(2):
        screen.generation(
            line | {"generation": generation, "wall_s": 1.0, "steps_per_second": 9}, 3
        )
    told = out.getvalue()
    assert told.count("alive: the share of the episodes that end without a fall") == 1
    assert told.count("alive  75%") == 2
