"""Logs for trackers: what TensorBoard reads of them is `metrics.jsonl`, also after a resume."""

import json
import struct
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from helpers import STOOL, said_by

from mjxgait.extras import install_command
from mjxgait.training.logs import Line, append_lines, truncate_metrics
from mjxgait.training.trackers import TensorBoard, WandB, scalars


def line(generation: int, best: float | None) -> Line:
    rest = {"term_alive": 0.5, "outcome_forward": 2.0, "steps_per_second": 1000, "mothers": [1]}
    return {"generation": generation, "best": best, "mean": 0.1, "forced": False} | rest


def log(folder: Path, tracker: TensorBoard | WandB, generations: range, best: float) -> None:
    """As a run does it: first its own log, then the tracker."""
    for generation in generations:
        append_lines(folder / "metrics.jsonl", [line(generation, best + generation)])
        tracker.write(line(generation, best + generation))


def seen(folder: Path) -> dict[int, dict[str, float]]:
    """What TensorBoard shows: files by name; a start of a session voids its step and later ones."""
    from tensorboardX.proto.event_pb2 import Event, SessionLog

    shown: dict[int, dict[str, float]] = {}
    for file in sorted((folder / "tensorboard").iterdir()):
        data = file.read_bytes()
        while data:
            size = struct.unpack("<Q", data[:8])[0]
            event = Event.FromString(data[12 : 12 + size])
            data = data[16 + size :]
            if event.session_log.status == SessionLog.START:
                shown = {step: values for step, values in shown.items() if step < event.step}
            for value in event.summary.value:
                values = shown.setdefault(event.step, {})
                assert value.tag not in values, "a step is there twice"
                values[value.tag] = value.simple_value
    return shown


def stored(folder: Path) -> dict[int, float]:
    lines = map(json.loads, (folder / "metrics.jsonl").read_text().splitlines())
    return {one["generation"]: one["best"] for one in lines}


def test_scalars_have_groups_and_lists_are_left_out():
    assert scalars(line(3, None)) == {
        "fitness/mean": 0.1,
        "run/forced": 0.0,
        "term/alive": 0.5,
        "outcome/forward": 2.0,
        "run/steps_per_second": 1000.0,
    }


def test_tensorboard_shows_each_generation_once_after_resumes(tmp_path: Path):
    """Of a run that was killed, resumed from generation 2, and shortened by its examination."""
    pytest.importorskip("tensorboardX")
    append_lines(tmp_path / "metrics.jsonl", [line(0, 9.0)])  # before it was tracked
    killed = TensorBoard(tmp_path)
    log(tmp_path, killed, range(1, 5), 10.0)
    killed._file.close()
    truncate_metrics(tmp_path / "metrics.jsonl", 2)
    resumed = TensorBoard(tmp_path)
    log(tmp_path, resumed, range(3, 8), 20.0)
    truncate_metrics(tmp_path / "metrics.jsonl", 5)
    resumed.close()
    shown = {generation: values["fitness/best"] for generation, values in seen(tmp_path).items()}
    assert shown == stored(tmp_path) == {0: 9, 1: 11, 2: 12, 3: 23, 4: 24, 5: 25}


def test_a_run_that_logs_nothing_leaves_nothing(tmp_path: Path):
    pytest.importorskip("tensorboardX")
    TensorBoard(tmp_path).close()
    assert not list(tmp_path.iterdir())


def test_wandb_has_the_log_of_the_run_when_it_stops(tmp_path: Path, monkeypatch):
    given, logged = {}, []
    run = SimpleNamespace(
        log=lambda values, step: logged.append((step, values["fitness/best"])),
        finish=lambda: logged.append("end"),
    )
    package = SimpleNamespace(init=lambda **options: given.update(options) or run)
    monkeypatch.setitem(sys.modules, "wandb", package)
    (tmp_path / "config.toml").write_text("seed = 3")
    WandB(tmp_path).close()
    assert not logged
    tracker = WandB(tmp_path)
    log(tmp_path, tracker, range(4), 1.0)
    truncate_metrics(tmp_path / "metrics.jsonl", 1)
    tracker.close()
    assert logged == [(0, 1.0), (1, 2.0), "end"]
    assert (given["mode"], given["dir"]) == ("offline", str(tmp_path))
    assert given["config"] == {"seed": 3}


def test_train_passes_its_generations_on(tmp_path: Path, monkeypatch, capsys):
    """Twice the same tracker is one; without the option there is none."""
    pytest.importorskip("tensorboardX")

    def evolve(folder: Path, creature: object, config: object, screen, *rest: object) -> bool:
        rest[3]()
        whole = line(0, 1.0) | {"episodes": 1, "failures": 0, "wall_s": 0.1}
        append_lines(folder / "metrics.jsonl", [whole])
        screen.generation(whole, config)
        return False

    monkeypatch.setattr("mjxgait.cli.training.evolve", evolve)
    monkeypatch.setattr("mjxgait.cli.training._draw", lambda *_, **__: True)
    names = ["--log", "tensorboard", "--log", "tensorboard"]
    said_by(capsys, "train", "--env", STOOL, "--out", tmp_path / "x", *names, code=130)
    assert seen(tmp_path / "x")[0]["term/alive"] == 0.5
    said_by(capsys, "train", "--env", STOOL, "--out", tmp_path / "y", code=130)
    assert not (tmp_path / "y" / "tensorboard").exists()


@pytest.mark.parametrize(("name", "package"), [("tensorboard", "tensorboardX"), ("wandb", "wandb")])
def test_a_missing_package_is_one_sentence_before_anything_is_made(
    name: str, package: str, tmp_path: Path, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, package, None)
    folder = tmp_path / "x"
    said = said_by(capsys, "train", "--env", STOOL, "--out", folder, "--log", name, code=2)
    assert f"--log {name} needs an extra: {install_command(name)}" in said
    assert not folder.exists()
