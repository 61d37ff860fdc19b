"""`mjxgait share --physics`: one file that simulates the champion in a browser.

The tests need MuJoCo's WebAssembly build (npm), Chromium (apt: chromium) and the Python package
playwright.
"""

import dataclasses
import json
import time
from pathlib import Path

import pytest
from helpers import said_by
from rendering.made_up import falling, treading, write_run
from web.brains import with_a_brain
from web.browser import PHONE, canvas, drawn, new_tab, wait_until, watched_tab
from web.engine import engine_folder

from mjxgait.creature.ground.spec import parse_ground
from mjxgait.errors import UserError
from mjxgait.experiments.repertoire.grid import GRID
from mjxgait.training.folder import open_champion
from mjxgait.web.facts import facts_of
from mjxgait.web.physics import build_physics_page
from mjxgait.web.wasm import engine_from

WALK = Path(__file__).parents[2] / "docs" / "data" / "walk"
STARTED = "document.getElementById('walk').dataset.time > 0"


@pytest.fixture(scope="module")
def page(stool, tmp_path_factory):
    """The page of a creature that treads on the spot."""
    text = build_physics_page(stool, facts_of(stool, treading(stool)), engine_from(engine_folder()))
    file = tmp_path_factory.mktemp("physics") / "walk.html"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def opened(browser, page):
    """The running page, its errors and its requests."""
    tab, wrong, asked = watched_tab(browser, page.as_uri())
    wait_until(tab, STARTED)
    return tab, wrong, asked


@pytest.fixture
def tab(opened):
    """The page with the creature standing, and all sliders as evolved."""
    tab, _, _ = opened
    tab.click("text=As evolved")
    # The click has scrolled down to the button.
    tab.evaluate("scrollTo(0, 0)")
    if shown(tab)["paused"]:
        tab.keyboard.press(" ")
    tab.keyboard.press("r")
    wait_until(tab, "walk.dataset.lies === 'false'")
    return tab


def shown(tab):
    """State of the page, as it writes it with each picture."""
    found = tab.evaluate("Object.assign({}, document.getElementById('walk').dataset)")
    return {name: json.loads(value) for name, value in found.items()}


def test_the_creature_moves_in_real_time_and_asks_for_nothing(opened):
    tab, wrong, asked = opened
    before = shown(tab)["time"]
    wait_until(tab, f"walk.dataset.time > {before + 0.5}")
    drawn(tab)
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_space_pauses_and_r_starts_again(tab):
    wait_until(tab, "walk.dataset.time > 0.3")
    tab.keyboard.press(" ")
    wait_until(tab, "walk.dataset.paused === 'true'")
    stopped = shown(tab)["time"]
    tab.wait_for_timeout(300)
    assert shown(tab)["time"] == stopped
    assert tab.inner_text("#pause") == "Go on"
    tab.keyboard.press("r")
    wait_until(tab, "walk.dataset.time === '0'")


def test_it_says_that_the_creature_fell(tab):
    for _ in range(6):
        tab.keyboard.press("ArrowLeft")
    wait_until(tab, "walk.dataset.lies === 'true'")
    assert "It fell." in tab.inner_text("#said")
    tab.click("text=Stand up again")
    wait_until(tab, "walk.dataset.lies === 'false'")
    assert tab.inner_text("#said") == ""


def test_the_pointer_pulls_the_creature_but_not_the_floor(tab):
    box = tab.locator("#walk").bounding_box()
    seat = box["x"] + box["width"] / 2, box["y"] + 0.49 * box["height"]
    orbit = tab.evaluate("walk.getCameraOrbit().theta")
    tab.mouse.move(*seat)
    tab.mouse.down()
    tab.mouse.move(seat[0] + 40, seat[1] - 60, steps=3)
    wait_until(tab, "walk.dataset.pulled === 'true'")
    assert tab.evaluate("document.querySelector('line.string').style.visibility") == "visible"
    tab.mouse.up()
    wait_until(tab, "walk.dataset.pulled === 'false'")
    assert tab.evaluate("walk.getCameraOrbit().theta") == pytest.approx(orbit)
    tab.mouse.move(box["x"] + 20, box["y"] + 20)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 120, box["y"] + 20, steps=3)
    tab.mouse.up()
    assert shown(tab)["pulled"] is False
    wait_until(tab, f"Math.abs(walk.getCameraOrbit().theta - {orbit}) > 0.1")


def test_a_slope_makes_it_slide(tab):
    for slider, value in (("uphill", 20), ("friction", 0.05)):
        tab.evaluate(f"{slider}.value = {value}; {slider}.dispatchEvent(new Event('input'))")
    wait_until(tab, "walk.dataset.ahead < -0.3")
    assert tab.inner_text('output[for="uphill"]') == "20°"


def slide(tab, slider, value):
    tab.evaluate(f"{slider}.value = {value}; {slider}.dispatchEvent(new Event('input'))")


def test_the_floor_gets_rough_and_level_again(tab):
    # A slow viewer would draw on a part of its canvas only.
    tab.evaluate("customElements.get('model-viewer').minimumRenderScale = 1")
    drawn(tab)
    until(lambda: filled(canvas(tab)) < 0.25)
    slide(tab, "rough", 15)
    assert tab.inner_text('output[for="rough"]') == "15 %"
    # Rough ground is a surface, the level floor a few tiles.
    until(lambda: filled(canvas(tab)) > 0.45)
    before = shown(tab)["time"]
    wait_until(tab, f"walk.dataset.time > {before + 0.3}")
    assert shown(tab)["lies"] is False
    tab.click("text=As evolved")
    assert tab.inner_text('output[for="rough"]') == "0 %"
    until(lambda: filled(canvas(tab)) < 0.25)


def filled(picture):
    """Share of a canvas on which something is drawn."""
    return (picture[..., 3] > 0).mean()


def until(holds, seconds=30):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"did not come true in {seconds} s"
        time.sleep(0.2)


def test_a_slower_cycle_walks_slower(browser, tmp_path):
    """The walk of the documentation, at the speed that it evolved and at half of it."""
    creature, champion = open_champion(WALK)
    engine, file = engine_from(engine_folder()), tmp_path / "walk.html"
    page = build_physics_page(creature, facts_of(creature, champion), engine)
    file.write_text(page, encoding="utf-8")
    tab, wrong, _ = watched_tab(browser, file.as_uri())
    wait_until(tab, STARTED)
    ways = []
    for pace in (1, 0.5):
        slide(tab, "pace", pace)
        tab.keyboard.press("r")
        wait_until(tab, "walk.dataset.time < 1")
        wait_until(tab, "walk.dataset.time >= 2.0")
        now = shown(tab)
        ways.append(now["ahead"] / now["time"])
    assert ways[0] > 0.5
    assert 0.1 < ways[1] / ways[0] < 0.8
    assert wrong == []
    tab.close()


def test_it_fits_a_phone_and_answers_a_finger(browser, page, tab):
    # An animated page takes more than a core; a paused one takes none.
    tab.keyboard.press(" ")
    tab = new_tab(browser, 390, 844, **PHONE)
    tab.goto(page.as_uri())
    wait_until(tab, STARTED)
    drag(tab)
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    assert "pinch" in tab.inner_text("body")
    assert "scroll" not in tab.inner_text("body")
    tab.tap("text=Pause")
    wait_until(tab, "walk.dataset.paused === 'true'")
    tab.close()


def drag(tab):
    """Pull the seat of the stool up by a finger, and let it go."""
    tab.locator("#walk").scroll_into_view_if_needed()
    box, finger = tab.locator("#walk").bounding_box(), tab.context.new_cdp_session(tab)
    x, y = box["x"] + box["width"] / 2, box["y"] + 0.49 * box["height"]
    orbit, way = tab.evaluate("walk.getCameraOrbit().theta"), [(0, 0), (15, -30), (30, -60)]
    for n, (right, down) in enumerate(way):
        kind, place = "touchMove" if n else "touchStart", {"x": x + right, "y": y + down}
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [place]})
    wait_until(tab, "walk.dataset.pulled === 'true'")
    assert tab.evaluate("document.querySelector('line.string').style.visibility") == "visible"
    finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    wait_until(tab, "walk.dataset.pulled === 'false'")
    assert tab.evaluate("walk.getCameraOrbit().theta") == pytest.approx(orbit)


def test_a_swimmer_has_a_light_and_no_floor(browser, tmp_path):
    body, champion = with_a_brain("follow")
    engine, file = engine_from(engine_folder()), tmp_path / "swimmer.html"
    file.write_text(build_physics_page(body, facts_of(body, champion), engine), encoding="utf-8")
    tab, wrong, _ = watched_tab(browser, file.as_uri())
    wait_until(tab, STARTED)
    assert not tab.is_visible("#uphill")
    assert not tab.is_visible("#rough")
    assert tab.is_visible("#mass")
    light = "['cx', 'cy'].map(k => document.querySelector('circle.light').getAttribute(k)).join()"
    before, apart = tab.evaluate(light), shown(tab)["apart"]
    assert apart > 5.0
    # It has no front: what is counted is how far it is from its start.
    assert shown(tab)["ahead"] >= 0.0
    tab.keyboard.press("l")
    wait_until(tab, f"{light} !== '{before}'")
    assert shown(tab)["apart"] == pytest.approx(apart, abs=0.5)
    assert wrong == []
    tab.close()


def test_a_controller_or_ground_that_a_page_cannot_run_is_refused(stool):
    champion = treading(stool)
    other = dataclasses.replace(champion, controller="sims")
    with pytest.raises(UserError, match=r'networks and brains, not the controller "sims"'):
        facts_of(stool, other)
    with pytest.raises(UserError, match=r'those of "travel" move on'):
        facts_of(stool, dataclasses.replace(champion, task="travel"))
    hilly = dataclasses.replace(stool, terrain=parse_ground("bumps:0.05"))
    with pytest.raises(UserError, match="bumps"):
        facts_of(hilly, champion)


def test_the_command_writes_the_page_of_a_run(stool, tmp_path, capsys):
    run, out = write_run(tmp_path / "run", stool, falling(stool)), tmp_path / "walk.html"
    given = ("share", run, "--physics", "--out", out)
    said = said_by(capsys, *given, "--wasm", engine_folder(), code=0)
    assert "Not certified: it falls after" in said
    text = out.read_text(encoding="utf-8")
    assert "Not certified: it falls after" in text
    assert "Apache License" in text
    assert len(text) < 6_000_000
    assert "no such file" in said_by(capsys, *given, "--wasm", tmp_path, code=2)


def test_contradicting_options_are_refused(stool, tmp_path, capsys):
    run, out = write_run(tmp_path / "run", stool, treading(stool)), tmp_path / "walk.html"
    assert "add --physics" in said_by(capsys, "share", run, "--out", out, "--wasm", run, code=2)
    (run / GRID).write_text("{}")
    said = said_by(capsys, "share", run, "--out", out, "--physics", code=2)
    assert "Name one of its runs" in said
    assert not out.exists()
