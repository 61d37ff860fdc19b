"""The scene of `mjxgait view`: the best individuals of a run that learns, one new one at a time."""

import base64
import dataclasses

import numpy as np
import pytest
from animation.test_school import names_in
from rendering.made_up import falling, treading, write_run
from web.learning import GENERATION, KINDS, begun, store

from mjxgait.champion import write_champion
from mjxgait.inspect.snapshot import read_snapshot
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import CHAMPION
from mjxgait.web import field
from mjxgait.web.field import COUNT, Field, distinct, front_of


@pytest.fixture
def short(monkeypatch):
    """Walks of half a second; returns what was simulated."""
    seen = []

    def counted(creature, champion, seconds):
        seen.append(champion.fingerprint)
        return record_walk(creature, champion, 0.5)

    monkeypatch.setattr(field, "record_walk", counted)
    return seen


def filled(shown, most=40):
    """Work until nothing is left to do."""
    changes = [shown.advance() for _ in range(most)]
    assert not changes[-1]
    assert shown.idle
    return sum(changes)


@pytest.mark.parametrize("kind", KINDS)
def test_the_best_of_any_kind_stand_side_by_side(kind, tmp_path, short):
    experiment = begun(tmp_path / "run", kind)
    champion = store(tmp_path / "run", experiment)
    shown = Field(tmp_path / "run", experiment.creature)
    filled(shown)
    front = list(front_of(read_snapshot(tmp_path / "run"), COUNT))
    assert len(front) == COUNT
    found = [one.champion.fingerprint for one in shown.shown]
    assert found[0] == champion.fingerprint
    # A graph of blocks may grow no body that can move.
    order = [one.fingerprint for one in front]
    assert found == [name for name in order if name in found]
    assert len(found) > (1 if kind == "bodies of blocks" else COUNT - 1)
    scene = shown.scene()
    names = set(names_in(base64.b64decode(scene["glb"])))
    assert scene["water"] == (kind == "bodies of blocks")
    for member in scene["members"]:
        assert set(member["parts"]) <= names
        motion = np.frombuffer(base64.b64decode(member["motion"]), "<f4")
        assert np.isfinite(motion).all()
    assert [one["name"] for one in scene["members"]][:2] == ["the best", "number 2"]
    assert f"generation {GENERATION}" in scene["members"][-1]["does"]


def test_a_new_champion_comes_before_the_rest_of_the_population(tmp_path, short):
    experiment = begun(tmp_path / "run", "key poses")
    first = store(tmp_path / "run", experiment)
    shown = Field(tmp_path / "run", experiment.creature)
    assert shown.advance()
    assert [one.champion.fingerprint for one in shown.shown] == [first.fingerprint]
    assert short == [first.fingerprint]
    assert not shown.advance()
    assert len(short) == 2
    # A training that finds champions all the time does not keep the others away.
    while not shown.idle:
        shown.advance()
    assert len(shown.shown) == COUNT
    store(tmp_path / "run", experiment, GENERATION + 5, turned=6)
    for better in range(1, 10):
        poses = first.genome["key_poses"] + 1e-3 * better
        second = dataclasses.replace(first, genome=first.genome | {"key_poses": poses})
        write_champion(second, experiment.creature, tmp_path / "run" / CHAMPION)
        assert shown.advance()
        assert shown.shown[0].champion.fingerprint == second.fingerprint
        shown.advance()
    front = {one.fingerprint for one in front_of(read_snapshot(tmp_path / "run"), COUNT)}
    assert {one.champion.fingerprint for one in shown.shown[1:]} <= front
    assert len(shown.shown) == COUNT
    assert len(short) == len(set(short))


def test_nothing_is_simulated_twice(tmp_path, short):
    experiment = begun(tmp_path / "run", "key poses")
    store(tmp_path / "run", experiment)
    shown = Field(tmp_path / "run", experiment.creature)
    assert filled(shown) == 2
    assert len(short) == len(set(short)) == COUNT
    store(tmp_path / "run", experiment, GENERATION + 5)
    assert filled(shown) == 0
    assert len(short) == COUNT


def test_a_run_without_a_checkpoint_shows_its_champion(stool, tmp_path, short):
    run = write_run(tmp_path / "run", stool)
    shown = Field(run, stool)
    assert not shown.advance()
    write_champion(treading(stool), stool, run / CHAMPION)
    assert filled(shown) == 1
    assert len(shown.shown) == 1


def test_who_falls_is_shown_falling(stool, tmp_path):
    shown = Field(write_run(tmp_path / "run", stool, falling(stool)), stool)
    assert shown.advance()
    assert shown.scene()["members"][0]["strategy"].startswith("falls after 0.")


def test_equal_individuals_are_one(stool):
    one = treading(stool)
    other = falling(stool)
    assert list(distinct([one, one, other, one])) == [one, other]
