"""`mjxgait view`: a page on this machine that follows a run.

The browser test needs Chromium (apt: chromium) and playwright.
"""

import contextlib
import dataclasses
import http.client
import json
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

import pytest
from rendering.made_up import falling, metrics_line, treading, write_run
from web.browser import check_dark, drawn, wait_until, watched_tab
from web.learning import GENERATION, begun, store

from mjxgait.champion import write_champion
from mjxgait.cli.view import following
from mjxgait.errors import UserError
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import CHAMPION, METRICS
from mjxgait.web.field import COUNT
from mjxgait.web.live import (
    HERE,
    SHARE,
    Watcher,
    open_server,
)


@pytest.fixture
def run(stool, tmp_path):
    return write_run(tmp_path / "run", stool, generations=2)


@contextlib.contextmanager
def serving(watcher):
    """The address of the page of a watcher that updates on demand."""
    server = open_server(watcher, 0)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://{HERE}:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.fixture
def site(run):
    """A watcher that updates on demand, and the address of its page."""
    watcher = Watcher(run)
    with serving(watcher) as address:
        yield watcher, address


def improve(run, creature, champion):
    """Replace the champion and extend the log, as a training does."""
    write_champion(champion, creature, run / CHAMPION)
    with (run / METRICS).open("a") as log:
        log.write(json.dumps(metrics_line(2)) + "\n")


def get(address, **headers):
    with urllib.request.urlopen(
        urllib.request.Request(address, headers=headers), timeout=10
    ) as answer:
        return answer.read()


def test_the_page_follows_the_run(site, run, stool):
    watcher, address = site
    watcher.look()
    assert json.loads(get(f"{address}/state.json"))["version"] == 0
    improve(run, stool, treading(stool))
    watcher.look()
    state = json.loads(get(f"{address}/state.json"))
    assert state["version"] == 1
    assert [line["generation"] for line in state["history"]] == [0, 1, 2]
    assert len(json.loads(get(f"{address}/scene.json"))["members"]) == 1
    watcher.look()
    assert json.loads(get(f"{address}/state.json"))["version"] == 1


def test_a_champion_that_falls_is_shown_falling(tmp_path):
    from mjxgait.config.layers import find_creature
    from mjxgait.creature import load_creature

    creature = load_creature(find_creature("tall_quadruped"))
    watcher = Watcher(write_run(tmp_path / "run", creature, falling(creature)))
    watcher.look()
    assert "falls after" in watcher.state()["what"]
    assert watcher.shown.scene


def test_a_longer_update_is_followed_by_a_longer_pause(run, stool, monkeypatch):
    """Updates take a small share of a core, even on a slow machine."""
    improve(run, stool, treading(stool))
    # The second run is known to be in training, the first by its lock.
    for trains, lock in ((False, "process 7 on another"), (True, None)):
        began_and_ended, watcher = iter([100.0, 103.0]), Watcher(run, trains)
        with monkeypatch.context() as patch:
            patch.setattr("mjxgait.web.live.running", lambda run, lock=lock: lock)
            patch.setattr("mjxgait.web.live.time.process_time", began_and_ended.__next__)
            assert 3.0 / (3.0 + watcher.look()) == pytest.approx(SHARE)
    assert SHARE <= 0.05


def test_the_page_is_dark_where_the_user_wants_that(browser, site, run, stool):
    watcher, address = site
    improve(run, stool, treading(stool))
    watcher.look()
    tab, wrong, _ = watched_tab(browser, address, color_scheme="dark")
    check_dark(tab)
    assert wrong == []
    tab.close()


def test_a_run_that_is_not_trained_is_shown_at_once(tmp_path):
    experiment = begun(tmp_path / "run", "key poses")
    store(tmp_path / "run", experiment)
    watcher = Watcher(tmp_path / "run")
    assert watcher.look() == 0.0
    assert watcher.shown.version == 1
    assert not watcher.field.idle


def test_only_a_new_champion_is_simulated(run, stool, monkeypatch):
    seen = []

    def counted(creature, champion, seconds):
        seen.append(champion)
        return record_walk(creature, champion, seconds)

    monkeypatch.setattr("mjxgait.web.field.record_walk", counted)
    watcher = Watcher(run)
    for champions, degrees in ((1, 4.0), (2, 5.0), (2, 5.0)):
        improve(run, stool, treading(stool, degrees))
        for _ in range(3):
            watcher.look()
        assert len(seen) == watcher.shown.version == champions


def test_the_line_names_the_latest_generation_of_the_same_champion(run, stool):
    watcher, champion = Watcher(run), treading(stool)
    for generation in (7, 8):
        origin = champion.origin | {"generation": generation}
        improve(run, stool, dataclasses.replace(champion, origin=origin))
        watcher.look()
        assert f"generation {generation}, fitness 1.00" in watcher.state()["what"]
    assert watcher.shown.version == 1


def test_only_this_machine_can_reach_the_page(site):
    _, address = site
    with pytest.raises(urllib.error.HTTPError, match="403"):
        get(f"{address}/state.json", Host="evil.example")
    for path in ("/../config.toml", "/config.toml", "/scene.json"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            get(address + path)


def patiently(address: str) -> bytes:
    """Content of an address; a closed connection counts for a moment longer than it is open."""
    for _ in range(50):
        with contextlib.suppress(http.client.RemoteDisconnected):
            return get(address)
        time.sleep(0.1)
    return get(address)


def test_idle_connections_are_limited_and_closed(run, monkeypatch):
    monkeypatch.setattr("mjxgait.web.live.CONNECTIONS", 2)
    monkeypatch.setattr("mjxgait.web.live._Handler.timeout", 0.5)
    server = open_server(Watcher(run), 0)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    place = (HERE, server.server_port)
    idle = [socket.create_connection(place, 10) for _ in range(2)]
    one_more = socket.create_connection(place, 10)
    assert one_more.recv(1) == b""
    assert [connection.recv(1) for connection in idle] == [b"", b""]
    assert patiently(f"http://{HERE}:{server.server_port}/state.json")
    for connection in (*idle, one_more):
        connection.close()
    server.shutdown()
    server.server_close()


def test_a_port_in_use_is_reported(site, run):
    _, address = site
    with pytest.raises(UserError, match="cannot be used"):
        open_server(Watcher(run), int(address.rsplit(":", 1)[1]))


@pytest.mark.thorough("the page that follows a training is the same command, and is ended too")
def test_the_command_prints_its_address_and_ends(run):
    viewer = subprocess.Popen(
        [sys.executable, "-m", "mjxgait", "view", str(run)], stdout=subprocess.PIPE, text=True
    )
    try:
        said = viewer.stdout.readline()
        assert said.startswith(f"http://{HERE}:")
        assert json.loads(get(said.split()[0] + "/state.json"))["name"] == "stool"
    finally:
        viewer.send_signal(2)
        assert viewer.wait(timeout=10) == 130 or os.name == "nt"
        viewer.stdout.close()


def test_a_training_can_be_followed(run, capfd):
    with following(run):
        end = time.monotonic() + 120
        said = ""
        while "http" not in said and time.monotonic() < end:
            time.sleep(0.1)
            said += capfd.readouterr().out
        address = said.split()[0]
        assert get(address)
    with pytest.raises(urllib.error.URLError):
        get(address)


def test_the_page_shows_the_best_side_by_side_and_the_curve_grows(browser, tmp_path):
    experiment = begun(tmp_path / "run", "key poses")
    store(tmp_path / "run", experiment)
    watcher = Watcher(tmp_path / "run")
    watcher.look()
    with serving(watcher) as address:
        tab, wrong, asked = watched_tab(browser, address)
        drawn(tab)
        assert "generation" in tab.inner_text("#what")
        assert tab.evaluate("school.members.length") == 1
        before = tab.inner_html("#curve")
        while not watcher.field.idle:
            watcher.look()
        store(tmp_path / "run", experiment, GENERATION + 5)
        wait_until(tab, f"school.members.length === {COUNT}")
        wait_until(tab, "document.querySelectorAll('.stage').length === 1")
        place = "school.members[8].nodes[1].position.toArray().join()"
        wait_until(tab, f"{place} !== '{tab.evaluate(place)}'")
        assert tab.locator(".label").count() == COUNT
        drawn(tab)
        tab.evaluate("school.show(school.members[1])")
        assert "number 2" in tab.inner_text(".card")
        wait_until(tab, f"document.getElementById('curve').innerHTML !== `{before}`")
        assert wrong == []
        assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []
        tab.close()
