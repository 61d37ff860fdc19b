"""`mjxgait share`: one file that plays on double click, without network requests.

The browser tests need Chromium (apt: chromium) and the Python package playwright.
"""

import json
import re

import numpy as np
import pytest
from helpers import made_up_certificate
from rendering.made_up import treading, write_run
from web.browser import (
    PHONE,
    canvas,
    check_dark,
    drawn,
    is_blank,
    new_tab,
    wait_until,
    watched_tab,
)

from mjxgait.certification import Certificate, CertificateConfig, Criterion, Measure
from mjxgait.certification.stress import Stress, StressConfig, Trial
from mjxgait.cli import main
from mjxgait.config.tables import build
from mjxgait.errors import UserError
from mjxgait.training.folder import CERTIFICATE, STRESS
from mjxgait.web.certificate import certificate_summary, certificate_table

CERTIFIED = made_up_certificate("") | {
    "passed": False,
    "criteria": [
        {
            "number": 7,
            "name": "gait",
            "passed": False,
            "measures": [
                {
                    "name": "slip <or> slide",
                    "value": None,
                    "sense": "<=",
                    "threshold": 0.15,
                    "passed": False,
                }
            ],
        }
    ],
}


def share(run, out):
    with pytest.raises(SystemExit) as ended:
        main(["share", str(run), "--out", str(out)])
    return ended.value.code


@pytest.fixture(scope="module")
def page(stool, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    run = write_run(folder / "run", stool, treading(stool, degrees=12.0))
    assert share(run, folder / "walk.html") == 0
    return folder / "walk.html"


@pytest.fixture(scope="module")
def opened(browser, page):
    """The loaded page, its errors and its requests."""
    return watched_tab(browser, page.as_uri())


def test_the_canvas_shows_a_creature_that_moves(opened):
    tab, _, _ = opened
    first = drawn(tab)
    assert len(tab.evaluate("walk.availableAnimations")) == 1
    for _ in range(20):
        tab.wait_for_timeout(130)
        if np.abs(canvas(tab) - first).mean() > 0.1:
            return
    pytest.fail("the creature stands still")


def test_the_page_has_no_errors_and_no_network_requests(opened):
    _, wrong, asked = opened
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_playback_can_be_paused_and_slowed(opened):
    tab, _, _ = opened
    tab.click("text=half")
    assert tab.evaluate("walk.timeScale") == 0.5
    tab.click("#play")
    assert tab.evaluate("walk.paused")
    assert tab.inner_text("#play") == "Play"


def test_a_moment_can_be_chosen_and_stepped(opened):
    tab, _, _ = opened
    tab.evaluate("time.value = 5; time.dispatchEvent(new Event('input'))")
    frame = tab.evaluate("walk.duration / time.max")
    assert tab.evaluate("walk.paused")
    assert tab.evaluate("walk.currentTime") == pytest.approx(5 * frame)
    tab.click('[aria-label="one frame on"]')
    assert tab.evaluate("walk.currentTime") == pytest.approx(6 * frame)
    for _ in range(2):
        tab.click('[aria-label="one frame back"]')
    assert tab.evaluate("walk.currentTime") == pytest.approx(4 * frame)


def test_a_page_without_examination_says_so_at_the_top(opened):
    tab, _, _ = opened
    said = tab.locator(".verdict")
    assert "Not certified: it has not been examined." in said.inner_text()
    walk = tab.locator("#stage").bounding_box()
    assert said.bounding_box()["y"] < walk["y"]


def test_keys_pause_and_step(opened):
    tab, _, _ = opened
    tab.evaluate("time.value = 5; time.dispatchEvent(new Event('input')); document.body.focus()")
    orbit = tab.evaluate("walk.getCameraOrbit().theta")
    tab.click("text=half")
    tab.keyboard.press("ArrowRight")
    tab.keyboard.press("ArrowRight")
    tab.keyboard.press("ArrowLeft")
    assert tab.evaluate("time.value") == "6"
    assert tab.evaluate("walk.getCameraOrbit().theta") == orbit
    tab.keyboard.press(" ")
    assert not tab.evaluate("walk.paused")
    tab.keyboard.press(" ")
    assert tab.evaluate("walk.paused")


def test_the_animation_can_be_saved(opened):
    tab, _, _ = opened
    with tab.expect_download() as started:
        tab.click("text=save the GLB")
    assert started.value.suggested_filename == "stool.glb"
    with open(started.value.path(), "rb") as file:
        assert file.read(4) == b"glTF"


def test_the_camera_has_preset_views(opened):
    tab, _, _ = opened
    assert pressed(tab) == ["corner"]
    for place, turned, down in (("top", -90, 8), ("side", -90, 86), ("front", 0, 84)):
        tab.click(f'.view:has-text("{place}")')
        tab.evaluate("walk.jumpCameraToGoal()")
        tab.wait_for_timeout(200)
        shown = tab.evaluate("walk.getCameraOrbit()")
        turns = np.degrees([shown["theta"], shown["phi"]])
        assert turns == pytest.approx([turned, down], abs=0.1)
        # The viewer would stand back to show the whole floor.
        assert f"{shown['radius']:.3f}m" == tab.evaluate("walk.cameraOrbit").split()[2]
        assert tab.evaluate("walk.getFieldOfView()") == pytest.approx(30.0)
        assert pressed(tab) == [place]
    box = tab.locator("#walk").bounding_box()
    tab.mouse.move(box["x"] + 50, box["y"] + 50)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 90, box["y"] + 50, steps=5)
    tab.mouse.up()
    wait_until(tab, "!document.querySelector('.view[aria-pressed=true]')")


def pressed(tab):
    return tab.locator('.view[aria-pressed="true"]').all_inner_texts()


def test_the_page_fits_a_phone_and_speaks_of_fingers(browser, page, opened):
    tab = new_tab(browser, 390, 844, **PHONE)
    tab.goto(page.as_uri())
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    assert "pinch" in tab.inner_text("body")
    assert "scroll" not in tab.inner_text("body")
    tab.close()
    # A window as narrow, without a touch screen.
    tab, _, _ = opened
    wide = tab.viewport_size
    tab.set_viewport_size({"width": 390, "height": 844})
    assert "scroll" in tab.inner_text("body")
    assert "pinch" not in tab.inner_text("body")
    tab.set_viewport_size(wide)


def test_the_page_is_dark_where_the_user_wants_that(browser, page):
    tab, wrong, _ = watched_tab(browser, page.as_uri(), color_scheme="dark")
    check_dark(tab)
    assert wrong == []
    tab.close()


def test_the_walk_and_its_buttons_fill_the_screen(opened):
    tab, _, _ = opened
    before = tab.locator("#walk").bounding_box()
    tab.click("#full")
    wait_until(tab, "document.fullscreenElement?.id === 'stage'")
    wait_until(tab, f"document.getElementById('walk').clientHeight > {before['height'] + 20}")
    assert tab.is_visible("#play")
    assert not tab.evaluate("document.fullscreenElement.contains(document.querySelector('h2'))")
    tab.click("#full")
    wait_until(tab, "!document.fullscreenElement")


def test_a_blank_canvas_is_noticed(browser, page, tmp_path):
    """The test of the canvas can fail."""
    text = page.read_text(encoding="utf-8")
    start = text.index("base64,", text.index("data:model/gltf-binary")) + len("base64,")
    end = text.index('"', start)
    (tmp_path / "broken.html").write_text(text[:start] + text[end:], encoding="utf-8")
    tab = new_tab(browser, 900, 700)
    tab.goto((tmp_path / "broken.html").as_uri())
    with pytest.raises(AssertionError, match="blank"):
        drawn(tab, seconds=1.5)
    assert not tab.evaluate("document.getElementById('walk').loaded")
    assert is_blank(canvas(tab))
    tab.close()


def test_the_page_has_no_external_references(page):
    text = page.read_text(encoding="utf-8")
    own = text[: text.index('<script type="module">')]
    assert "default-src 'none'" in own
    for reference in ('src="http', 'href="http', "@import", 'src="//', "url(http"):
        assert reference not in own
    assert "sourceMappingURL" not in text
    assert len(text) < 4_000_000


def test_only_a_certificate_of_this_champion_is_shown(stool, tmp_path):
    champion = treading(stool)
    run = write_run(tmp_path / "run", stool, champion)
    assert "Not examined" in certificate_table(run, stool, champion)
    (run / CERTIFICATE).write_text(json.dumps(CERTIFIED | {"champion": champion.fingerprint}))
    assert "Not all criteria pass." in certificate_table(run, stool, champion)
    assert "slip &lt;or&gt; slide" in certificate_table(run, stool, champion)
    told = {"report": CERTIFIED["report"] | {"advice": ["It <slides>.", "Train longer."]}}
    text = json.dumps(CERTIFIED | told | {"champion": champion.fingerprint})
    (run / CERTIFICATE).write_text(text)
    assert "<p>It &lt;slides&gt;. Train longer.</p>" in certificate_table(run, stool, champion)
    assert "outdated" in certificate_table(run, stool, treading(stool, degrees=3.0))
    (run / CERTIFICATE).write_text(json.dumps(CERTIFIED))
    assert "outdated" in certificate_table(run, stool, champion)
    passing = made_up_certificate(champion.fingerprint)
    (run / CERTIFICATE).write_text(json.dumps(passing))
    assert "<p>All criteria pass.</p>" in certificate_table(run, stool, champion)
    assert "inspect RUN --verify" in certificate_table(run, stool, champion)
    (run / CERTIFICATE).write_text(json.dumps(passing | {"passed": False}))
    assert "the file contradicts itself" in certificate_table(run, stool, champion)
    lax = build(CertificateConfig, {"progress": {"drift": 5.0}}, "lax")
    lenient = made_up_certificate(champion.fingerprint, config=lax)
    (run / CERTIFICATE).write_text(json.dumps(lenient))
    rules = "by other rules: progress.drift = 5.0 instead of 0.25"
    assert f"Not certified. All criteria pass, but {rules}." in certificate_table(
        run, stool, champion
    )
    (run / CERTIFICATE).write_text("[]")
    with pytest.raises(UserError, match="not a certificate"):
        certificate_table(run, stool, champion)


def test_the_verdict_and_the_tightest_measures_come_first(stool, tmp_path):
    champion = treading(stool)
    run = write_run(tmp_path / "run", stool, champion)
    falls = certificate_summary(run, stool, champion, 1.42)
    assert "<b>Not certified: it falls after 1.4 s; it has not been examined.</b>" in falls
    assert "Examine it with <code>mjxgait certify RUN</code>." in falls
    (run / CERTIFICATE).write_text(json.dumps(CERTIFIED))
    old = certificate_summary(run, stool, champion)
    assert "<b>Not certified: the certificate is outdated: it was given to another champion" in old
    assert "Examine it again with <code>mjxgait certify RUN</code>." in old
    early = {key: value for key, value in CERTIFIED.items() if key != "champion"}
    (run / CERTIFICATE).write_text(json.dumps(early))
    assert "as those of earlier versions.</b>" in certificate_summary(run, stool, champion)
    (run / CERTIFICATE).write_text(json.dumps(CERTIFIED | {"champion": champion.fingerprint}))
    short = certificate_summary(run, stool, champion)
    assert "Not all criteria pass." in short
    assert "slip &lt;or&gt; slide none (≤ 0.15)" in short
    names = [(3, "third"), (1, "first"), (4, "fourth"), (9, "last"), (2, "second")]
    measures = tuple(Measure(name, 1.0 + place, ">=", 1.0, 10.0) for place, name in names)
    told, settings = {"ground": "flat", "summary": ""}, CertificateConfig()
    criteria = (Criterion(7, "gait", measures),)
    made = Certificate("stool", "", "walk", champion.fingerprint, criteria, told, settings, 1.0)
    (run / CERTIFICATE).write_text(json.dumps(made.document()))
    short = certificate_summary(run, stool, champion)
    assert "<b>All criteria pass.</b> Margin 0.10." in short
    assert re.search(r"Tightest: first 2 .*; second 3 .*; third 4 ", short)
    assert "fourth" not in short


def test_stress_results_are_shown_beside_the_certificate(stool, tmp_path):
    champion = treading(stool)
    run = write_run(tmp_path / "run", stool, champion)
    (run / CERTIFICATE).write_text(json.dumps(CERTIFIED | {"champion": champion.fingerprint}))
    assert "anywhere" not in certificate_table(run, stool, champion)
    trials = (Trial("bumps of 5%", 0.95, True), Trial("friction 0.4", 0.25, False))
    found = Stress(champion.fingerprint, trials, StressConfig())
    (run / STRESS).write_text(json.dumps(found.document()))
    table = certificate_table(run, stool, champion)
    assert "It does not walk anywhere: friction 0.4 25%." in table
    assert re.search(r"friction 0.4.*25%.*fails", table)
    (run / STRESS).write_text("{}")
    with pytest.raises(UserError, match="mjxgait stress"):
        certificate_table(run, stool, champion)


def test_invalid_input_is_reported(stool, stool_run, tmp_path, capsys):
    assert share(stool_run, tmp_path / "walk.pdf") == 2
    assert share(stool_run, tmp_path / "missing" / "walk.html") == 2
    assert share(tmp_path, tmp_path / "walk.html") == 2
    assert share(write_run(tmp_path / "run", stool), tmp_path / "walk.html") == 2
    assert "no champion yet" in capsys.readouterr().err
