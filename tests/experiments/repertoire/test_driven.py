"""`mjxgait share` of a repertoire: a page to drive the creature, which names what it shows.

The browser tests need Chromium (apt: chromium) and the Python package playwright.
"""

import shutil
from pathlib import Path

import pytest
from experiments.repertoire.made_up import begin, examine
from helpers import said_by
from web.browser import drawn, wait_until, watched_tab

from mjxgait.experiments.repertoire.clips import write_driven
from mjxgait.training.folder import CERTIFICATE


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two of the six walks are certified: 0.2 m/s straight, and 0.2 m/s turning left."""
    made = begin(tmp_path_factory.mktemp("driven") / "set")
    examine(*made)
    return made[0]


@pytest.fixture(scope="module")
def opened(browser, folder: Path, tmp_path_factory: pytest.TempPathFactory):
    page = tmp_path_factory.mktemp("page") / "drive.html"
    write_driven(folder, page)
    tab, wrong, asked = watched_tab(browser, page.as_uri())
    wait_until(tab, "walk.dataset.used")
    return tab, wrong, asked


def of(tab, name: str) -> float:
    return float(tab.evaluate(f"walk.dataset.{name}"))


def test_it_stands_until_a_key_is_pressed(opened):
    tab, wrong, asked = opened
    drawn(tab)
    assert (of(tab, "speed"), of(tab, "turn")) == (0, 0)
    assert "the standing pose" in tab.inner_text("#now")
    assert "2 walks of 6" in tab.inner_text(".lead")
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_up_walks_ahead_and_left_turns_left(opened):
    tab, wrong, _ = opened
    tab.keyboard.down("ArrowUp")
    wait_until(tab, "walk.dataset.z > 0.02 && walk.dataset.used == 1")
    tab.keyboard.up("ArrowUp")
    assert "a certified walk" in tab.inner_text("#now")
    assert abs(of(tab, "x")) < 0.1 * of(tab, "z")
    tab.keyboard.down("ArrowLeft")
    wait_until(tab, "walk.dataset.used == 2")
    assert "animation: a blend of 2 clips" in tab.inner_text("#now")
    wait_until(tab, "walk.dataset.turn * 180 / Math.PI > 9")
    wait_until(tab, "walk.dataset.yaw > 0.1")
    tab.keyboard.up("ArrowLeft")
    assert wrong == []


def test_a_repertoire_without_certified_walks_is_refused(folder: Path, tmp_path: Path, capsys):
    empty = tmp_path / "set"
    shutil.copytree(folder, empty)
    for certificate in empty.glob(f"*/{CERTIFICATE}"):
        certificate.unlink()
    said = said_by(capsys, "share", empty, "--out", tmp_path / "page.html", code=2)
    assert "none of its walks is certified" in said
