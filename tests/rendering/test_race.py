"""A race: several walks on one floor, each in its lane, for any creatures and clocks."""

import dataclasses

import numpy as np
import pytest
from rendering.made_up import treading, write_run

from mjxgait.cli import main
from mjxgait.config.layers import find_creature
from mjxgait.creature import load_creature
from mjxgait.rendering.gl import working_backend
from mjxgait.rendering.stage import Participant, Stage
from mjxgait.rendering.video import Runner, champions_of, moving_pictures
from mjxgait.rendering.walk import record_walk


@pytest.fixture(scope="module")
def crab_walk():
    creature = load_creature(find_creature("crab"))
    return record_walk(creature, treading(creature), 1.0)


def moved(walk, ahead: float, left: float):
    """The walk with its end shifted by this many m."""
    qpos, aside = walk.trajectory.qpos.copy(), np.array([-walk.forward[1], walk.forward[0]])
    share = np.linspace(0, 1, qpos.shape[1])[:, None]
    qpos[0, :, :2] += share * (ahead * walk.forward + left * aside)
    return dataclasses.replace(walk, trajectory=dataclasses.replace(walk.trajectory, qpos=qpos))


@pytest.mark.parametrize("way", [(1.0, 0.0), (0.0, 1.0), (-0.6, 0.8)])
def test_all_participants_go_the_same_way(stool_walk, way):
    """The scene's direction replaces a creature's own direction of walking."""
    forward, start = np.array(way), np.array([3.0, -2.0])
    walk = moved(stool_walk, 2.0, 0.5)
    participant = Participant(walk, start, forward)
    own = (walk.trunk_pos[-1] - walk.trunk_pos[0])[:2]
    expected = [own @ walk.forward, own @ [-walk.forward[1], walk.forward[0]]]
    went = participant.trunk(walk.seconds)[:2] - start
    assert [went @ forward, went @ [-forward[1], forward[0]]] == pytest.approx(expected)
    assert participant.trunk(0.0)[:2] == pytest.approx(start)
    pos, rot = participant.poses(0.0)
    assert np.linalg.det(rot) == pytest.approx(np.ones(len(pos)))
    flat = participant.placed(walk.geom_poses(np.array([0]))[0][0])
    np.testing.assert_allclose(pos, flat)


def test_clocks_of_different_creatures_agree(stool_walk):
    """A walk with control steps twice as long is shown at the same moment."""
    slow = dataclasses.replace(
        stool_walk,
        trajectory=dataclasses.replace(stool_walk.trajectory, time_step=2 * stool_walk.time_step),
    )
    stage = Stage([stool_walk, slow], 320, 180)
    first, second = stage.participants
    assert second.frame(1.0) == pytest.approx(first.frame(1.0) / 2, abs=1)
    assert stage.frames == pytest.approx(2 * len(stool_walk.qpos), abs=1)
    assert first.frame(100.0) == len(stool_walk.qpos) - 1


def test_lanes_are_as_wide_as_their_creatures(stool_walk, crab_walk):
    stage = Stage([crab_walk, stool_walk, crab_walk], 320, 180)
    gaps = np.diff(stage.lanes @ stage.left)
    halves = [(one.across + other.across) / 2 for one, other in zip(*pairs(stage), strict=True)]
    assert (gaps > halves).all()
    assert gaps[0] == pytest.approx(gaps[1])
    # No creature is outside the picture.
    for place, participant in enumerate(stage.participants):
        pixels = stage.camera(0).pixels(participant.outline + stage.lanes[place])
        assert (pixels > 0).all()
        assert (pixels < [320, 180]).all()


def pairs(stage: Stage):
    return stage.participants[:-1], stage.participants[1:]


def test_every_participant_is_painted(stool_walk, crab_walk):
    """The picture changes if either is removed."""
    both = Stage([stool_walk, crab_walk], 160, 96)
    whole = np.asarray(both.picture(10), int)
    for keep in (0, 1):
        one = Stage([stool_walk, crab_walk], 160, 96)
        one.participants, one.lanes = [one.participants[keep]], one.lanes[[keep]]
        assert np.abs(np.asarray(one.picture(10), int) - whole).max() > 50


def test_different_creatures_are_painted_without_gl(stool_walk, crab_walk):
    assert Stage([stool_walk, stool_walk], 64, 64).alike
    mixed = Stage([stool_walk, crab_walk], 64, 64)
    assert not mixed.alike
    assert working_backend(mixed) == (None, "it draws several creatures of one kind only")


def test_labels_stay_in_the_picture(stool_walk):
    """Even if the participant is far behind."""
    runners = [Runner(moved(stool_walk, ahead, 0.0), "x") for ahead in (9.0, 0.0)]
    stage = Stage([runner.walk for runner in runners], 320, 180)
    *_, last = moving_pictures(runners, stage, 2)
    bare = stage.picture(round(4.5 / stage.time_step))
    written = np.abs(np.asarray(last, int) - np.asarray(bare, int)).max(2) > 60
    x, _ = stage.behind(round(4.5 / stage.time_step), 1)
    assert x < 0
    assert written[:, 8:40].any()


def test_labels_of_a_race_are_distinct(stool_run, stool, tmp_path):
    crab = load_creature(find_creature("crab"))
    other = write_run(tmp_path / "crab_run", crab, treading(crab))
    again = write_run(tmp_path / "again", stool, treading(stool))
    namesake = write_run(tmp_path / "deeper" / "again", stool, treading(stool))

    def labels(*runs):
        return [runner.label for runner in champions_of(runs, 0.1)]

    assert labels(stool_run, other) == ["stool", "crab"]
    assert labels(stool_run, again) == [stool_run.name, "again"]
    assert labels(again, namesake) == [str(again), str(namesake)]


def test_a_race_of_runs_is_one_command(stool_run, tmp_path, capsys):
    crab = load_creature(find_creature("crab"))
    other = write_run(tmp_path / "crab_run", crab, treading(crab))
    out = tmp_path / "race.webp"
    short = ("--seconds", "0.3", "--fps", "10", "--size", "96", "64")
    with pytest.raises(SystemExit) as ended:
        main(["render", str(stool_run), str(other), "--out", str(out), *short])
    assert ended.value.code == 0, capsys.readouterr()
    assert out.stat().st_size > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "name a run folder"),
        (["a"] * 13, "up to 12"),
        (["a", "b", "--top", "2"], "of one run"),
        (["a", "b"], "a"),
    ],
)
def test_an_impossible_race_is_reported(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["render", *arguments, "--out", "race.webp"])
    assert ended.value.code == 2
    assert words in "".join(capsys.readouterr())
