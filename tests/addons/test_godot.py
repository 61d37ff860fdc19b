"""The add-on for Godot, in Godot 4: a character is driven, and where it goes is measured.

Needs a Godot: a program in MJXGAIT_GODOT or called `godot4` or `godot`, or in MJXGAIT_GODOT_WEB the
folder of a web build (`index.js`, `index.wasm`), which Chromium runs.
"""

import configparser
import contextlib
import functools
import http.server
import json
import os
import shutil
import subprocess
import threading
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from addons.made_up_repertoire import TURN, write_repertoire
from web.browser import launch

import mjxgait

HERE = Path(__file__).parent
ADDON = HERE.parents[1] / "addons" / "godot" / "mjxgait"
SECONDS = 240
"""Time for one game; software draws it."""


def test_the_version_is_the_programs():
    plugin = configparser.ConfigParser()
    plugin.read(ADDON / "plugin.cfg")
    assert plugin["plugin"]["version"].strip('"') == mjxgait.__version__
    assert (ADDON / plugin["plugin"]["script"].strip('"')).exists()


@pytest.mark.parametrize("script", sorted([*ADDON.glob("*.gd"), HERE / "godot" / "game.gd"]))
def test_scripts_are_of_the_language(script: Path):
    """Without a Godot, a parser of its language at least finds what no Godot would read."""
    parser = pytest.importorskip("gdtoolkit.parser", reason="needs the Python package gdtoolkit")
    parser.parser.parse(script.read_text())


def project(folder: Path, turns: bool) -> dict:
    """Write a project with the add-on and a repertoire; return the repertoire's table."""
    shutil.copytree(HERE / "godot", folder, dirs_exist_ok=True)
    shutil.copytree(ADDON, folder / "addons" / "mjxgait")
    return write_repertoire(folder, turns)


def played(folder: Path) -> dict:
    """What a game printed."""
    program = os.environ.get("MJXGAIT_GODOT") or shutil.which("godot4") or shutil.which("godot")
    if program:
        lines = by_program(program, folder)
    elif web := os.environ.get("MJXGAIT_GODOT_WEB"):
        lines = in_browser(Path(web), folder)
    else:
        pytest.skip("needs Godot 4: name a program in MJXGAIT_GODOT, or a web build (see above)")
    told = [line for line in lines if line.startswith("told ")]
    assert told, lines
    return json.loads(told[0].removeprefix("told "))


def by_program(program: str, folder: Path) -> list[str]:
    given = [program, "--headless", "--path", str(folder)]
    done = subprocess.run(given, capture_output=True, text=True, timeout=SECONDS)
    return (done.stdout + done.stderr).splitlines()


def in_browser(web: Path, folder: Path) -> list[str]:
    """What a web build prints that plays the project as a ZIP file."""
    playwright = pytest.importorskip("playwright.sync_api")
    site = folder.with_name(f"{folder.name}-site")
    site.mkdir()
    with zipfile.ZipFile(site / "game.zip", "w") as packed:
        for path in folder.rglob("*"):
            packed.write(path, path.relative_to(folder))
    shutil.copy(HERE / "godot" / "page.html", site)
    for path in web.glob("index*.*"):
        (site / path.name).symlink_to(path)
    with served(site) as address, playwright.sync_playwright() as play:
        chromium = launch(play)
        tab = chromium.new_page(viewport={"width": 640, "height": 400})
        tab.goto(f"{address}/page.html")
        until, printed, shown = time.monotonic() + SECONDS, [], False
        while time.monotonic() < until and not any(p.startswith("told ") for p in printed):
            tab.wait_for_timeout(200)
            printed = tab.evaluate("window.printed")
            if "picture" in printed and not shown:
                tab.screenshot(path=folder / "picture.png")
                shown = True
        chromium.close()
    return printed


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *words: object) -> None:
        pass


@contextlib.contextmanager
def served(folder: Path) -> Iterator[str]:
    handler = functools.partial(Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.slow
def test_a_character_goes_where_it_is_driven(tmp_path: Path):
    """At the speed and turn asked for; feet slide no more than the walk's own; it can stand."""
    clips = {clip["name"]: clip for clip in project(tmp_path / "game", turns=True)["clips"]}
    told = played(tmp_path / "game")
    assert told["error"] == ""
    ahead, curve, sharp, still = told["parts"]
    fast, slow = clips["fast_0"], clips["slow_0"]
    assert all(part["on_floor"] for part in told["parts"])
    assert ahead["speed"] == pytest.approx(0.9 * fast["speed"], rel=0.05)
    assert ahead["ahead"] > 0, "it looks where it goes"
    assert ahead["pace"] == pytest.approx(0.9 / fast["duration"], rel=1e-3)
    # Half stand and half slow walk: half as long strides at the slow walk's pace.
    assert curve["reached"] == pytest.approx([5.0, 0.5 * slow["speed"]], rel=1e-3)
    assert curve["pace"] == pytest.approx(1 / slow["duration"], rel=1e-3)
    assert curve["turn"] == pytest.approx(5.0, rel=0.1)
    assert sharp["turn"] == pytest.approx(-TURN, rel=0.1), "no more than its walks"
    # The lowest bone slides by 0.30 of the way in the walk itself, by more where it blends with a
    # stand.
    assert max(ahead["slid"], sharp["slid"]) < 0.35
    assert curve["slid"] < 0.5
    assert min(part["bone_turned"] for part in (ahead, curve, sharp)) > 0.05
    # One step per foot and cycle, though clips are blended.
    feet = {fall["foot"] for fall in fast["contacts"]}
    assert {*ahead["steps"]} == feet
    assert max(ahead["steps"].values()) <= 2.0 * ahead["pace"] + 2
    assert (still["speed"], still["pace"]) == (0.0, 1.0)
    assert still["bone_turned"] < 1e-3


@pytest.mark.slow
def test_walks_that_all_lead_straight_on_are_enough(tmp_path: Path):
    clips = {clip["name"]: clip for clip in project(tmp_path / "game", turns=False)["clips"]}
    ahead, slow, sharp, _ = played(tmp_path / "game")["parts"]
    assert ahead["speed"] == pytest.approx(0.9 * clips["fast_0"]["speed"], rel=0.05)
    assert slow["reached"] == pytest.approx([0.0, 0.5 * clips["slow_0"]["speed"]], abs=1e-3)
    assert sharp["turn"] == pytest.approx(0.0, abs=0.1)
    assert min(part["bone_turned"] for part in (ahead, slow)) > 0.05
