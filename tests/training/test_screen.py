"""What a run prints as it progresses and at its end."""

import io
from pathlib import Path
from types import SimpleNamespace

import pytest
from helpers import small_config
from rich.console import Console

from mjxgait.certification import Certificate, CertificateConfig
from mjxgait.certification.advice import ADVICE, advice
from mjxgait.certification.criteria import Criterion, Measure
from mjxgait.output import duration
from mjxgait.training.screen import Screen


@pytest.mark.parametrize(
    ("best", "forward", "said"),
    [
        (1.5, 3.25, ("1.500 in generation 4", "forward 3.25 per episode")),
        (None, None, ("no individual had a finite fitness",)),
    ],
    ids=["judged", "nobody judged"],
)
def test_the_report_names_the_best_or_says_that_there_is_none(
    tmp_path: Path, best: float | None, forward: float | None, said: tuple[str, ...]
):
    out = io.StringIO()
    last = {"best": best, "generation": 4, "outcome_forward": forward}
    screen = Screen(Console(file=out, width=300))
    screen.report(tmp_path, "done", last, 1.0, interrupted=False)
    assert all(words in out.getvalue() for words in said)


def test_a_result_without_numbers_is_a_sentence():
    """Without strides most measures have no value, and the worst margin is -inf."""
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


def test_a_finished_run_prints_the_next_commands(tmp_path: Path):
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


def test_the_terms_of_a_progress_line_are_explained_once():
    out = io.StringIO()
    screen = Screen(Console(file=out, width=300))
    line = {"best": 1.0, "mean": 0.5, "episodes": 8, "failures": 2, "forced": False}
    for generation in range(2):
        shown = line | {"generation": generation, "wall_s": 1.0, "steps_per_second": 9}
        screen.generation(shown, small_config())
    told = out.getvalue()
    assert told.count("alive: the share of the episodes that end without a fall") == 1
    assert told.count("alive  75%") == 2


def time_left(**tables: dict) -> list[str]:
    """The printed lines on the time left after generation 0, which took 1.5 s."""
    out = io.StringIO()
    line = {"generation": 0, "wall_s": 1.5, "steps_per_second": 9, "episodes": 8, "failures": 2}
    scores = {"best": 1.0, "mean": 0.5, "forced": False}
    Screen(Console(file=out, width=300)).generation(line | scores, small_config(**tables))
    return [text for text in out.getvalue().splitlines() if "left" in text]


def test_the_time_left_is_a_bound_where_a_run_may_end_sooner():
    patient = {"forced": {"patience": 0}, "generations": 60}
    said, line = time_left(evolution=patient, examination={"every": 5})
    assert "time left: up to generation 60; the run ends sooner once a look at its best" in said
    assert line.endswith("at most 90 s left")
    (line,) = time_left(evolution=patient, examination={"every": 0})
    assert line.endswith("steps/s  90 s left")
    reached, _ = time_left(evolution=patient | {"target": 3.5}, examination={"candidates": 0})
    assert reached.endswith("ends sooner at a fitness of 3.5")
    tried, _ = time_left(examination={"every": 0})
    assert tried.endswith("ends sooner when forced evolution no longer pays")


def test_the_time_left_includes_time_between_generations(monkeypatch: pytest.MonkeyPatch):
    """Examinations take time that no generation's log contains."""
    clock = iter((100.0, 100.0, 109.0))
    stopped = SimpleNamespace(perf_counter=lambda: next(clock))
    monkeypatch.setattr("mjxgait.training.screen.time", stopped)
    out = io.StringIO()
    screen = Screen(Console(file=out, width=300))
    line = {"best": 1.0, "mean": 0.5, "episodes": 8, "failures": 2, "forced": False}
    for generation in range(3):
        shown = line | {"generation": generation, "wall_s": 0.5, "steps_per_second": 9}
        screen.generation(shown, small_config(evolution={"generations": 12}))
    assert "at most 45 s left" in out.getvalue().splitlines()[-1]


def test_durations_have_a_suitable_unit():
    assert [duration(s) for s in (0.4, 119, 150, 7100, 9000)] == [
        "0 s",
        "119 s",
        "2 min",
        "118 min",
        "2.5 h",
    ]


def test_what_stood_in_the_way_follows_the_verdict():
    out = io.StringIO()
    criterion = Criterion(8, "physics", (Measure("body speed / sqrt(g h)", 3.8, "<=", 3.0, 1.0),))
    said = advice([criterion], "walk", {})
    report = {"summary": "trot, 0.80 m/s", "overlap": None, ADVICE: said}
    config = CertificateConfig()
    screen = Screen(Console(file=out, width=300))
    screen.certificate(Certificate("stool", "", "walk", "", (criterion,), report, config, 1.0))
    assert out.getvalue().splitlines()[-2:] == said
