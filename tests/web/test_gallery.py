"""`mjxgait gallery`: all champions move on one page, which asks for no network.

The browser test needs Chromium (apt: chromium) and the Python package playwright.
"""

import base64
import json
import re
import shutil

import numpy as np
import pytest
from animation.test_school import names_in
from helpers import said_by
from rendering.grown import grown_walk, straight
from rendering.made_up import treading, write_run
from web.browser import wait_until, watched_tab

import mjxgait
from mjxgait.config.tables import dump_toml
from mjxgait.errors import UserError
from mjxgait.experiments.multi_seed import SEEDS_FILE, Seeds
from mjxgait.files import write_text
from mjxgait.rendering.gallery import Entry, by_strategy
from mjxgait.training.folder import CHAMPION
from mjxgait.web.gallery import build_gallery


@pytest.fixture(scope="module")
def shown():
    light = (8.0, 3.0, 1.0)
    return by_strategy(
        [
            Entry("seed0", grown_walk("follow", straight(1.0, 0.3, 0.4, 300), light), ""),
            Entry(
                "<b>", grown_walk("swim", straight(2.0, 0.0, 0.4, 300)), "Not certified: </script>"
            ),
            Entry("seed2", grown_walk("roam", straight(2.0, 0.5, 0.0, 300)), ""),
        ]
    )


@pytest.fixture(scope="module")
def page(shown):
    return build_gallery(shown, "a <title>")


@pytest.fixture(scope="module")
def scenes(page):
    return json.loads(re.search(r'id="facts">(.*?)</script>', page, re.DOTALL)[1])["scenes"]


def test_swimmers_have_a_scene_of_their_own(scenes):
    assert [scene["water"] for scene in scenes] == [False, True]
    assert [[one["name"] for one in scene["members"]] for scene in scenes] == [
        ["seed2"],
        ["<b>", "seed0"],
    ]


def test_each_has_its_name_word_speed_and_verdict(scenes, shown):
    members = {one["name"]: one for scene in scenes for one in scene["members"]}
    for one in shown:
        member = members[one.name]
        assert member["strategy"] == one.strategy
        assert member["does"].endswith("m/s")
        assert member["verdict"] == (one.doubt or "Certified")
        assert member["certified"] == one.certified


def test_the_page_holds_all_that_it_moves(scenes):
    for scene in scenes:
        names = set(names_in(base64.b64decode(scene["glb"])))
        for member in scene["members"]:
            assert set(member["parts"]) <= names
            motion = np.frombuffer(base64.b64decode(member["motion"]), "<f4")
            frames = motion.reshape(-1, len(member["parts"]), 7)
            assert len(frames) == round(25 * member["seconds"]) + 1
            np.testing.assert_allclose(np.linalg.norm(frames[..., 3:], axis=2), 1.0, atol=1e-5)
            assert (member["lamp"] is not None) == (member["name"] == "seed0")


def test_names_are_escaped(page):
    assert "<h1>a &lt;title&gt;</h1>" in page
    assert page.count("</script>") == 3
    assert "2 of 3 certified. By strategy: spin 2, crawl 1." in page


def test_the_page_moves_and_tells(browser, page, tmp_path):
    (tmp_path / "gallery.html").write_text(page, encoding="utf-8")
    tab, wrong, asked = watched_tab(browser, (tmp_path / "gallery.html").as_uri())
    wait_until(tab, "schools.every(school => school.members.length)")
    place = "schools[0].members[0].nodes[0].position.toArray().join()"
    wait_until(tab, f"{place} !== '{tab.evaluate(place)}'")
    tab.evaluate("document.getElementById('pause').click()")
    tab.evaluate("schools[1].show(schools[1].members[0])")
    assert "Not certified: </script>" in tab.evaluate("schools[1].card.textContent")
    x, y = tab.evaluate("schools[0].pixel(schools[0].members[0])")
    box = tab.evaluate("schools[0].viewer.getBoundingClientRect().toJSON()")
    assert 0 < x < box["width"]
    assert 0 < y < box["height"]
    tab.mouse.move(box["x"] + x, box["y"] + y)
    wait_until(tab, "schools[0].shown?.name === 'seed2'")
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


@pytest.fixture(scope="module")
def runs(stool, tmp_path_factory):
    """A folder with two runs; one has no champion yet."""
    folder = tmp_path_factory.mktemp("runs")
    write_run(folder / "seed0", stool, treading(stool))
    write_run(folder / "seed1", stool)
    return folder


def test_a_folder_of_runs_is_shown(runs, tmp_path):
    told = []
    out = mjxgait.gallery(
        runs, tmp_path / "all.html", poster=tmp_path / "all.png", tell=told.append
    )
    assert "1 of" not in told[0]
    assert "seed1: has no champion yet" in told[0]
    assert told[-1].startswith("0 of 1 certified: ")
    assert out.stat().st_size > 1e6
    assert (tmp_path / "all.png").stat().st_size > 1e3


REFUSED = {
    "no runs": ([], "name run folders"),
    "no page": (["RUNS"], "name the page to write"),
    "another ending": (["RUNS", "--out", "all.pdf"], "end the name with .html"),
    "a poster of another kind": (
        ["RUNS", "--out", "all.html", "--poster", "all.svg"],
        "end the name with .webp, .png, .jpg",
    ),
    "a still as a video": (
        ["RUNS", "--out", "all.html", "--video", "all.png"],
        "end the name with .webp, .gif, .mp4",
    ),
    "no task": (["RUNS", "--out", "all.html", "--seed", "3"], "--seed: evolves runs"),
    "runs and a task": (["RUNS", "--task", "swim"], "not both"),
    "no folder of runs": ([".", "--out", "all.html"], "neither a run folder nor"),
    "a run without champion": (["RUNS/seed1", "--out", "all.html"], "no run has a champion yet"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_mistake_is_one_sentence_and_writes_nothing(case, runs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given, said = REFUSED[case]
    words = [word.replace("RUNS", str(runs)) for word in given]
    assert said in said_by(capsys, "gallery", *words, code=2)
    assert not list(tmp_path.iterdir())


def test_more_than_a_page_holds_is_refused(runs, tmp_path, monkeypatch):
    monkeypatch.setattr("mjxgait.api.galleries.MAX_CHAMPIONS", 0)
    with pytest.raises(UserError, match="at most 0"):
        mjxgait.gallery(runs / "seed0", tmp_path / "all.html")
    assert (runs / "seed0" / CHAMPION).is_file()


@pytest.mark.parametrize(
    ("option", "value", "has"), [("runs", 3, 2), ("seed", 7, 0), ("task", "hop", "walk")]
)
def test_runs_that_are_there_are_not_made_again_otherwise(
    option, value, has, runs, tmp_path, capsys
):
    study = tmp_path / "study"
    shutil.copytree(runs, study)
    write_text(study / SEEDS_FILE, dump_toml(Seeds((0, 1))))
    given = {"task": "walk", "study": study, option: value}
    words = [word for name, one in given.items() for word in (f"--{name}", one)]
    said = said_by(capsys, "gallery", *words, code=2)
    assert f"holds runs with --{option} {has}; leave --{option} {value} out" in said
