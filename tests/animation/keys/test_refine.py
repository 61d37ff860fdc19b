"""A refined cycle stays near the drawn one, in an ordinary run that reports the changes."""

import dataclasses
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from animation.keys.made import swings, write
from helpers import STOOL, made_up_certificate, made_up_evaluate, short_examination, small_config
from PIL import Image
from rendering.made_up import treading

import mjxgait
from mjxgait.animation.keys import Brought, bring, refine
from mjxgait.animation.keys.cycle import EditedWalk
from mjxgait.animation.keys.refine import (
    KEYS,
    Original,
    _feet_in_words,
    begin,
    departure,
    departure_of,
    read_original,
    refining,
)
from mjxgait.champion import read_champion, write_champion
from mjxgait.cli import main
from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.key_poses.config import TUNING, gene_names
from mjxgait.controllers.key_poses.controller import PoseTracker
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.plugins.fit import check_fit
from mjxgait.rendering.walk import record_walk
from mjxgait.training import stages
from mjxgait.training.folder import CERTIFICATE, CHAMPION, open_run

SETTINGS = """
[rollout]
seconds = 0.4
starts = 2
lanes = 4
[examination]
candidates = 0
"""


@pytest.fixture(scope="module")
def brought(stool: Creature, tmp_path_factory) -> Brought:
    file = write(tmp_path_factory.mktemp("keys"), "csv", stool, swings(stool))
    return bring(stool, file, tolerance=np.radians(4.0))


@pytest.mark.parametrize(("keep", "within"), [(1.0, 0.0), (0.5, 15.0), (0.0, 30.0)])
def test_poses_stay_within_the_range_set_by_keep(stool, brought, keep: float, within: float):
    config = refining(stool, small_config(), brought, keep).controller
    low, high = PoseTracker(stool, 0.005).bounds(config)
    drawn = brought.fit.key_poses
    assert config.key_poses == len(drawn)
    for edge in (low.key_poses, high.key_poses):
        assert np.degrees(np.abs(edge - drawn)).max() <= within + 1e-3
    assert (low.key_poses >= stool.joints.pose_low - 1e-6).all()
    assert (high.key_poses <= stool.joints.pose_high + 1e-6).all()
    slower = config.tuning.period[1] / brought.cycle.period
    assert slower == pytest.approx(1.0 + 0.3 * (1.0 - keep))
    positions = len(brought.fit.key_poses) * (1 + brought.cycle.mirrored) * config.interpolation
    assert positions * stool.model.opt.timestep >= config.tuning.period[1], "the target never waits"


def test_the_first_individual_is_the_drawn_cycle(stool, brought):
    config = refining(stool, small_config(), brought, 0.5).controller
    variation = PoseTracker(stool, 0.005).variation(config, EvolutionConfig())
    made = variation.create(key_of(0), 4)
    assert made.key_poses[0] == pytest.approx(brought.fit.key_poses, abs=1e-5)
    assert np.abs(made.key_poses[1] - brought.fit.key_poses).max() > 0.01


def test_a_walk_with_known_genes_starts_close_to_them(stool, brought):
    """It has walked already; a cycle that was never simulated needs a wider search."""
    own = EditedWalk(brought.fit, brought.cycle, 0.0, "error", dict.fromkeys(TUNING, 0.0))
    usual, close = (
        refining(stool, small_config(), each, 0.5).evolution.initial_spread
        for each in (brought, dataclasses.replace(brought, own=own))
    )
    assert usual == EvolutionConfig().initial_spread
    assert close == 0.2
    still_closer = small_config(evolution={"initial_spread": 0.1})
    known = dataclasses.replace(brought, own=own)
    assert refining(stool, still_closer, known, 0.5).evolution.initial_spread == 0.1


def test_a_known_walk_of_a_body_that_steps_keeps_its_steps(stool, brought):
    genes = dict.fromkeys(gene_names(True), 0.2)
    own = EditedWalk(brought.fit, brought.cycle, 0.0, "error", genes)
    config = refining(stool, small_config(), dataclasses.replace(brought, own=own), 0.9).controller
    assert config.stepping.step == pytest.approx((0.1, 0.3))
    assert config.stepping.turn == pytest.approx((0.16, 0.24))
    assert config.tuning.steer[0] <= 0.2 <= config.tuning.steer[1]


def test_settings_of_another_creature_are_refused(shipped, stool, brought):
    config = refining(stool, small_config(), brought, 0.5)
    if shipped.settings.creature.grows:
        pytest.skip("it has no poses")
    with pytest.raises(UserError, match=r"controller\.around has"):
        check_fit(shipped, config)


@pytest.mark.parametrize("keep", [-0.1, 1.5])
def test_keep_lies_between_0_and_1(stool, brought, keep: float):
    with pytest.raises(UserError, match="between 0 and 1"):
        refining(stool, small_config(), brought, keep)


def test_a_changed_reach_of_a_foot_is_described_in_words(stool: Creature):
    drawn = swings(stool)
    done = drawn.copy()
    done[:, 1] -= 0.3
    told = _feet_in_words(stool, drawn, done)
    assert told
    assert all(stool.feet.names[1] in sentence for sentence in told)
    assert any("cm further forward" in sentence for sentence in told)
    assert any("cm less far back" in sentence for sentence in told)
    assert _feet_in_words(stool, drawn, drawn) == []


def test_the_departure_of_a_walk_is_measured(stool: Creature):
    """For the drawn walk, and for one with a joint five degrees off."""
    champion = treading(stool, degrees=12.0)
    near = np.ravel(champion.genome["key_poses"])
    drawn = dataclasses.replace(champion.settings, around=tuple(map(float, near)))
    walk = record_walk(stool, dataclasses.replace(champion, settings=drawn), 4.0)
    first, last = walk.steady_strides(1)
    motion = walk.qpos[first:last, stool.joints.qpos_adr]
    period = len(motion) * walk.time_step
    found = departure(Original("x", motion, period, 0.0), walk)
    assert (found.poses, found.period) == (0.0, pytest.approx(1.0, abs=0.02))
    assert found.moved < 0.1
    bent = dataclasses.replace(
        drawn, around=tuple(near + np.radians(5.0) * (np.arange(len(near)) % 4 == 1))
    )
    walk = record_walk(stool, dataclasses.replace(champion, settings=bent), 4.0)
    found = departure(Original("x", motion, 2.0 * period, 0.0), walk)
    assert found.poses == pytest.approx(2.5)
    assert "a cycle takes 50% shorter" in found.words


def said(capsys: pytest.CaptureFixture, *arguments: object, code: int) -> str:
    with pytest.raises(SystemExit) as ended:
        main(["refine", *map(str, arguments)])
    text = capsys.readouterr()
    assert ended.value.code == code, text.err
    return text.out + text.err


def test_a_file_becomes_a_run_that_can_be_resumed(
    tmp_path: Path, capsys, stool: Creature, monkeypatch
):
    """Generations simulate nothing, examinations last 3 s; `test_library` simulates a run."""
    monkeypatch.setattr(stages, "evaluate", made_up_evaluate)
    monkeypatch.setattr("mjxgait.certification.certificate.CertificateConfig", short_examination)
    (tmp_path / "small.toml").write_text(SETTINGS)
    file, run = write(tmp_path, "bvh", stool, swings(stool)), tmp_path / "run"
    given = ("--env", STOOL, "--keys", file, "--config", tmp_path / "small.toml", "--keep", 0.8)
    assert "key poses:" in said(capsys, *given, "--only-show", "--out", run, code=0)
    assert not run.exists()
    size = ("--population", 6, "--generations", 2)
    told = said(capsys, *given, *size, "--out", run, code=0)
    assert "front_left <- front_left" in told
    assert "From walk.bvh: key poses" in told
    assert "mjxgait export" in told
    creature, config = open_run(run)
    drawn = np.reshape(config.controller.around, (config.controller.key_poses, -1))
    champion = read_champion(run / CHAMPION, creature)
    assert np.degrees(np.abs(champion.genome["key_poses"] - drawn)).max() <= 6.0 + 1e-3
    assert "From walk.bvh" in said(capsys, "--resume", run, code=0)
    settings = tomllib.loads(SETTINGS)
    sizes = {"population": 6, "generations": 2, "settings": settings, "quiet": True}
    again = mjxgait.refine(STOOL, file, keep=0.8, out=tmp_path / "again", **sizes)
    assert again.champion.fingerprint == champion.fingerprint
    assert again.departure.poses == departure_of(run).poses
    assert capsys.readouterr().out == ""
    assert "holds another run" in said(capsys, *given, "--out", run, code=2)
    (run / KEYS).write_text(json.dumps({"source": "x"}))
    with pytest.raises(UserError, match="damaged"):
        read_original(run, creature)
    (run / KEYS).unlink()
    assert "was not made by `mjxgait refine`" in said(capsys, "--resume", run, code=2)


def test_the_search_range_does_not_change_the_fingerprint(stool: Creature):
    """Otherwise champions from before these settings would lose their certificates."""
    champion = treading(stool)
    before = {
        k: v
        for k, v in dataclasses.asdict(champion.settings).items()
        if k not in ("around", "within")
    }
    near = dataclasses.replace(champion.settings, around=(0.1, 0.2), within=3.0)
    others = [dataclasses.replace(champion, settings=settings) for settings in (before, near)]
    assert {other.fingerprint for other in others} == {champion.fingerprint}


def ended(run: Path, creature: Creature, share: float, passed: bool) -> None:
    """Write champion and certificate, as a run does."""
    settings = open_run(run)[1].controller
    near = dataclasses.replace(treading(creature), settings=settings)
    drawn = np.reshape(settings.around, (settings.key_poses, -1))
    poses = drawn + np.radians(0.5 * settings.within)
    near = dataclasses.replace(near, genome={**near.genome, "key_poses": poses})
    write_champion(near, creature, run / CHAMPION)
    measure = {"name": "share that stays up", "value": share, "sense": ">="}
    measure |= {"threshold": 0.0 if passed else 1.5, "passed": passed}
    criterion = {"number": 4, "passed": passed, "measures": [measure]}
    document = made_up_certificate(near.fingerprint, passed=passed, criteria=[criterion])
    (run / CERTIFICATE).write_text(json.dumps(document))


def test_runs_with_several_keep_values_make_one_picture(
    tmp_path: Path, capsys, stool, brought, monkeypatch
):
    out = tmp_path / "all"
    for keep in (0.0, 1.0):
        config = refining(stool, small_config(), brought, keep)
        begin(refine.folder_of(out, keep), stool, config, Path("x.csv"), brought)
    monkeypatch.setattr(refine, "LOOP_SECONDS", 2.0)
    faithful, free = refine.runs_in(out)
    with pytest.raises(UserError, match="has no certificate yet"):
        refine.draw(out)
    ended(faithful, stool, 0.25, passed=False)
    ended(free, stool, 0.75, passed=True)
    found = {run: refine.look(run) for run in refine.runs_in(out)}
    told = [(one.keep, one.departs, one.stays, one.certified) for one in found.values()]
    assert told[0] == (1.0, 0.0, 0.25, False)
    assert told[1] == (0.0, pytest.approx(15.0, abs=0.01), 0.75, True)
    monkeypatch.setattr(refine, "look", found.get)
    assert "Side by side" in said(capsys, "--resume", out, code=0)
    picture = np.asarray(Image.open(out / "front.png"))
    assert picture.std() > 10


def test_several_runs_need_an_empty_folder(tmp_path: Path, capsys, stool: Creature):
    file = write(tmp_path, "csv", stool, swings(stool))
    given = ("--env", STOOL, "--keys", file, "--tolerance", 9, "--out", tmp_path)
    before = {*tmp_path.iterdir()}
    assert "holds something already" in said(capsys, *given, "--keep", 1, 0.5, code=2)
    empty = (*given[:-1], tmp_path / "new", "--keep", 1, 1)
    assert "once" in said(capsys, *empty, code=2)
    assert {*tmp_path.iterdir()} == before
