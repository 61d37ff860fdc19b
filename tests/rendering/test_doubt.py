"""Pictures and exports without a certificate say so, and why."""

import dataclasses
import json
import shutil
from pathlib import Path

import pytest
from helpers import made_up_certificate, said_by
from rendering.made_up import falling

from mjxgait.champion import write_champion
from mjxgait.rendering.walk import doubt
from mjxgait.training.folder import CERTIFICATE, CHAMPION


@pytest.fixture
def run(stool_run: Path, tmp_path: Path) -> Path:
    return shutil.copytree(stool_run, tmp_path / "run")


def certificate(walk, *failed: tuple[int, str], **others: object) -> str:
    return json.dumps(made_up_certificate(walk.champion.fingerprint, *failed) | others)


def test_a_certified_champion_gets_no_warning(run: Path, stool_walk):
    (run / CERTIFICATE).write_text(certificate(stool_walk))
    assert doubt(run, stool_walk) == ""


def test_failed_criteria_are_named(run: Path, stool_walk):
    (run / CERTIFICATE).write_text(certificate(stool_walk, (7, "slip")))
    assert doubt(run, stool_walk) == "Not certified: it fails criterion 7 slip"
    (run / CERTIFICATE).write_text(certificate(stool_walk, (1, "stays up"), (7, "slip")))
    fell = dataclasses.replace(stool_walk, fell=1.44)
    assert doubt(run, fell) == (
        "Not certified: it falls after 1.4 s; it fails criteria 1 stays up, 7 slip"
    )


def test_a_missing_or_invalid_certificate_is_reported(run: Path, stool_walk):
    said = doubt(run, stool_walk)
    assert said == (f"Not certified: it has not been examined, which mjxgait certify {run} does")
    (run / CERTIFICATE).write_text(certificate(stool_walk, champion="another"))
    assert doubt(run, stool_walk).startswith("Not certified: the certificate is outdated: it was")
    (run / CERTIFICATE).write_text("[]")
    assert "not a certificate" in doubt(run, stool_walk)


@pytest.mark.parametrize(
    "arguments",
    [
        ("export", "--out", "walk.bvh"),
        ("share", "--out", "walk.html"),
        ("render", "--out", "walk.png", "--size", "64", "64"),
    ],
    ids=["export", "share", "render"],
)
def test_export_share_and_render_warn_once(
    run: Path, arguments: tuple[str, ...], tmp_path: Path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    command, *options = arguments
    said = said_by(capsys, command, run, *options, code=0)
    assert said.count("Not certified: it has not been examined") == 1


def test_a_race_names_each_uncertified_run(run: Path, stool, tmp_path: Path, capsys):
    other = shutil.copytree(run, tmp_path / "other")
    write_champion(falling(stool), stool, other / CHAMPION)
    size = ("--out", tmp_path / "race.png", "--seconds", "1", "--size", "64", "64")
    said = said_by(capsys, "render", run, other, *size, code=0)
    assert "run: Not certified: it has not been examined" in said
    assert "other: Not certified: it " in said
    assert said.count("Not certified") == 2
