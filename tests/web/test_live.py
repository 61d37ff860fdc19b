"""`mjxgait view`: a page on this machine that follows a run.

The browser test needs Chromium (apt: chromium) and playwright.
"""

import contextlib
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
from web.browser import drawn, wait_until, watched_tab

from mjxgait.champion import write_champion
from mjxgait.cli.view import following
from mjxgait.errors import UserError
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import CHAMPION, METRICS
from mjxgait.web.live import (
    HERE,
    SHARE,
    Watcher,
    open_server,
)


@pytest.fixture
def run(stool, tmp_path):
    return write_run(tmp_path / "run", stool, generations=2)


@pytest.fixture
def site(run):
    """A watcher that updates on demand, and the address of its page."""
    watcher = Watcher(run)
    server = open_server(watcher, 0)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield watcher, f"http://{HERE}:{server.server_port}"
    server.shutdown()
    server.server_close()


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
    assert get(f"{address}/walk.glb")[:4] == b"glTF"
    watcher.look()
    assert json.loads(get(f"{address}/state.json"))["version"] == 1


def test_a_champion_that_falls_is_shown_falling(tmp_path):
    from mjxgait.config.layers import find_creature
    from mjxgait.creature import load_creature

    creature = load_creature(find_creature("tall_quadruped"))
    watcher = Watcher(write_run(tmp_path / "run", creature, falling(creature)))
    watcher.look()
    assert "falls after" in watcher.shown.what
    assert watcher.shown.glb


def test_a_longer_update_is_followed_by_a_longer_pause(run, stool, monkeypatch):
    """Updates take a small share of a core, even on a slow machine."""
    watcher = Watcher(run)
    improve(run, stool, treading(stool))
    began_and_ended = iter([100.0, 103.0])
    monkeypatch.setattr("mjxgait.web.live.time.process_time", lambda: next(began_and_ended))
    assert 3.0 / (3.0 + watcher.look()) == pytest.approx(SHARE)
    assert SHARE <= 0.05


def test_only_a_new_champion_is_simulated(run, stool, monkeypatch):
    seen = []

    def counted(creature, champion, seconds):
        seen.append(champion)
        return record_walk(creature, champion, seconds)

    monkeypatch.setattr("mjxgait.web.live.record_walk", counted)
    watcher = Watcher(run)
    for champions in (1, 2):
        improve(run, stool, treading(stool))
        for _ in range(3):
            watcher.look()
        assert len(seen) == champions


def test_only_this_machine_can_reach_the_page(site):
    _, address = site
    with pytest.raises(urllib.error.HTTPError, match="403"):
        get(f"{address}/state.json", Host="evil.example")
    for path in ("/../config.toml", "/config.toml", "/walk.glb"):
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
    with pytest.raises(UserError, match="taken by another program"):
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


def test_the_page_shows_the_champion_and_the_curve_grows(browser, site, run, stool):
    watcher, address = site
    improve(run, stool, treading(stool, degrees=12.0))
    watcher.look()
    tab, wrong, asked = watched_tab(browser, address)
    drawn(tab)
    assert "generation" in tab.inner_text("#what")
    before = tab.inner_html("#curve")
    improve(run, stool, treading(stool, degrees=8.0))
    watcher.look()
    wait_until(
        tab,
        "document.getElementById('walk').src.includes('version=2') && "
        "document.getElementById('walk').loaded",
    )
    assert tab.inner_html("#curve") != before
    drawn(tab)
    assert wrong == []
    assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []
    tab.close()
