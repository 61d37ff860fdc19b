"""`--physics mjx` trains with MJX, in every command that simulates."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from animation.keys.made import swings, write
from helpers import STOOL, said_by, short_examination

from mjxgait.api.repertoires import RepertoireRequest, planned
from mjxgait.cli.refine import refine_command
from mjxgait.cli.train import train_command
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.experiments.ablation.plan import make_plan, read_study
from mjxgait.training.folder import open_run

SMALL = [
    "--population",
    "6",
    "--generations",
    "2",
    "--rollout.seconds",
    "0.4",
    "--rollout.starts",
    "2",
    "--rollout.promote",
    "1",
    "--rollout.lanes",
    "4",
    "--examination.candidates",
    "1",
    "--examination.draws",
    "2",
    "--no-plots",
]


@pytest.fixture
def own_step_is_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make any use of lane-major physics fail."""

    def absent(*_: object, **__: object) -> None:
        raise AssertionError("this program's own step, not MJX")

    monkeypatch.setattr("mjxgait.physics.lane_major_plant", absent)


def test_a_run_with_mjx_ends_with_a_certificate(
    own_step_is_absent: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """With 3 s of certification instead of 22 s, and a population that cannot walk yet."""
    monkeypatch.setattr("mjxgait.certification.certificate.CertificateConfig", short_examination)
    run = tmp_path / "run"
    assert train_command(["--env", str(STOOL), *SMALL, "--physics", "mjx", "--out", str(run)]) == 0
    assert open_run(run)[1].rollout.physics == "mjx"
    champion, certificate = (
        json.loads((run / f"{name}.json").read_text()) for name in ("champion", "certificate")
    )
    assert certificate["creature_digest"] == champion["creature_digest"]
    assert [c["number"] for c in certificate["criteria"]] == list(range(1, 10))
    assert np.isfinite(champion["fitness"])


def test_every_command_that_simulates_accepts_mjx(stool: Creature, tmp_path: Path):
    """Runs of a repertoire use it, and runs of a study whatever its variants set."""
    options = RepertoireRequest(
        str(STOOL), speeds=("0.1",), turns=(), out=tmp_path / "set", physics="mjx"
    )
    assert {config.rollout.physics for config in planned(options).configs.values()} == {"mjx"}
    file = tmp_path / "study.toml"
    file.write_text(
        'question = "?"\n[[variant]]\nname = "own"\nconfig = "wilson"\n'
        '[[variant]]\nname = "other"\nsettings = { rollout = { physics = "auto", seconds = 5.0 } }\n'
    )
    plan = make_plan(read_study(file, {"physics": "mjx"}), stool, "test")
    assert {run.config.rollout.physics for run in plan.runs} == {"mjx"}
    plan = make_plan(read_study(file, {}), stool, "test")
    assert {run.config.rollout.physics for run in plan.runs} == {"auto"}


def test_refining_a_cycle_accepts_mjx(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stool: Creature
):
    file = write(tmp_path, "csv", stool, swings(stool))

    def only_written(
        folder: Path, creature: Creature, config: Config, write: Callable[[], object], quiet: bool
    ) -> int:
        write()
        return 0

    monkeypatch.setattr("mjxgait.cli.refine._run", only_written)
    run = tmp_path / "run"
    given = ["--env", str(STOOL), "--keys", str(file), "--tolerance", "4"]
    given += ["--physics", "mjx", "--out", str(run)]
    assert refine_command(given) == 0
    assert open_run(run)[1].rollout.physics == "mjx"


def test_growing_bodies_reject_mjx(tmp_path: Path, capsys: pytest.CaptureFixture):
    """They have no model for MJX to read."""
    run = tmp_path / "run"
    said = said_by(capsys, "train", "--env", "blocks", "--physics", "mjx", "--out", run, code=2)
    assert "rollout.physics" in said
    assert not (run / "champion.json").exists()
