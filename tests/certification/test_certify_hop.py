"""Acceptance criteria of `hop`, and a goal of its own for each simulation."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from certify_made_up import DOG, make_champion, walk

from mjxgait.certification import CertificateConfig, trial_run, trials
from mjxgait.certification.acceptance import acceptance_of, promising
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.evolution.chance import key_of
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome, Trajectory, Watch
from mjxgait.reference.starts import (
    Starts,
    join,
    nominal_starts,
    perturbed_starts,
    pushed_starts,
)
from mjxgait.tasks.hop import config as evolution
from mjxgait.tasks.hop.criteria import HopCriteria
from mjxgait.tasks.hop.task import Hop
from mjxgait.tasks.hop.thresholds import HopThresholds

CONFIG, DEMANDS = CertificateConfig(), HopCriteria()
FRAMES, STEP, GOAL = 4400, 0.005, 1.2


# Made-up paths of 22 s


def to(*places: tuple[float, float], drift: float = 0.0) -> Recording:
    """Path through these points (s, m ahead), without physics.

    drift: m to the left at the goal, in proportion to the distance ahead.
    """
    times, ways = zip(*places, strict=True)
    made = walk()
    forward = np.interp(np.arange(FRAMES) * STEP, times, ways)
    path = np.stack([forward, drift * forward / GOAL, np.full(FRAMES, 0.4)], 1)
    return dataclasses.replace(made, trunk_pos=path, goal=GOAL)


def good() -> Recording:
    return to((0, 0), (3, 1.21))


def changed(at: float, **values: object) -> Recording:
    """The good path with other values in one frame."""
    made = good()
    arrays = {name: np.array(getattr(made, name)) for name in values}
    for name, array in arrays.items():
        array[round(at / STEP)] = values[name]
    return dataclasses.replace(made, **arrays)


def failures(whole: Recording, halved: Recording | None = None) -> set[int]:
    evaluation = DEMANDS.undisturbed(whole, halved or good(), CONFIG)
    assert [c.number for c in evaluation] == [1, 2, 6, 8, 9]
    return {c.number for c in evaluation if not c.passed}


def test_arriving_and_staying_passes():
    assert failures(good()) == set()


@pytest.mark.parametrize(
    "way",
    [
        to((0, 0), (3, 0.93 * GOAL)),
        to((0, 0), (3, 1.07 * GOAL)),
        to((0, 0), (22, 2 * GOAL)),
        to((0, 0), (3, GOAL), (21, GOAL), (21.5, 0.9 * GOAL)),
        to((0, 0), (3, GOAL), (18, GOAL), (18.1, 0.9 * GOAL), (18.2, GOAL)),
        to((0, 0), (18, 0), (18.5, GOAL)),
        to((0, 0)),
        to((0, 0), (3, GOAL), drift=0.07 * GOAL),
        to((0, 0), (3, GOAL), drift=-0.07 * GOAL),
    ],
    ids=[
        "short",
        "far",
        "passes by",
        "leaves",
        "is away for a moment",
        "late",
        "stands",
        "left of it",
        "right of it",
    ],
)
def test_criterion_2_arrives_and_stays(way: Recording):
    assert failures(way) == {2}
    assert failures(good(), halved=way) == {6}


@pytest.mark.parametrize("name_and_value", [{"touch": True}, {"trunk_up": 0.1}])
@pytest.mark.parametrize("at", [0.5, 20.0])
def test_criterion_1_holds_from_the_first_moment(at: float, name_and_value: dict):
    assert failures(changed(at, **name_and_value)) == {1}
    assert failures(good(), halved=changed(at, **name_and_value)) == {6}


def test_height_is_not_limited():
    assert failures(changed(1.0, trunk_pos=[0.4, 0.0, 2.0])) == set()


def test_criteria_8_and_9_hold_from_the_first_moment():
    assert failures(changed(0.5, torque=31.0)) == {8}
    assert failures(changed(0.5, joint_vel=21.0)) == {8}
    assert failures(changed(0.5, overlap=0.03 * DOG.hip_height)) == {9}


def test_a_diverged_recording_fails_its_criteria():
    names = ("trunk_pos", "trunk_up", "torque", "overlap", "joint_vel")
    made = good()
    late = np.arange(FRAMES) > 3000
    broken = {n: np.where(late[:, None], np.nan, np.c_[getattr(made, n)]) for n in names}
    broken["trunk_up"] = broken["trunk_up"][:, 0]
    assert failures(dataclasses.replace(made, **broken)) == {1, 2, 8, 9}


def test_the_report_has_the_remaining_distance_and_the_arrival_time():
    report = DEMANDS.report(to((0, 0), (3, 1.2), (10, 1.2), (11, 1.1), (12, 1.21)), CONFIG)
    # Within 0.06 m again at 1.14 m, on its way back from 1.1 to 1.21 m.
    assert report["arrival"] == pytest.approx(11 + 0.04 / 0.11, abs=0.01)
    assert report["left"] == pytest.approx(0.01)
    beside = DEMANDS.report(to((0, 0), (3, 1.2), drift=0.5), CONFIG)
    assert (beside["left"], beside["arrival"]) == (pytest.approx(0.5), None)
    assert DEMANDS.report(to((0, 0), (3, 1.0)), CONFIG)["arrival"] is None


# Disturbed


def became(ways: list[Recording], fell: list[float]) -> Outcome:
    path, aside = (np.stack([way.trunk_pos[:, axis] for way in ways]) for axis in (0, 1))
    nothing = np.zeros((0, FRAMES))
    film = Trajectory(STEP, *[nothing] * 5)
    clear = np.full(len(ways), np.inf)
    return Outcome(np.array(fell), np.zeros((len(ways), 2)), path, clear, film, aside=aside)


def test_disturbed_trials_succeed_if_they_stay_up_and_at_their_goal(tiny: Creature):
    ways = [good(), good(), good(), to((0, 0), (3, 0.4)), to((0, 0), (20, 1.2))]
    ways.append(to((0, 0), (3, 1.2), drift=0.2))
    starts = nominal_starts(tiny, 6)
    starts.goal[:] = [1.2, 1.2, 1.3, 0.4, 1.2, 1.2]
    outcome = became(ways, [np.inf, 21.0, np.inf, np.inf, np.inf, np.inf])
    arrived = [True, False, False, True, False, False]
    assert DEMANDS.succeeded(outcome, starts, CONFIG).tolist() == arrived


def test_nine_of_ten_must_succeed_and_pushes_do_not_count():
    assert [c.number for c in DEMANDS.disturbed(58 / 64, 0.0, CONFIG)] == [4]
    assert all(c.passed for c in DEMANDS.disturbed(58 / 64, 0.0, CONFIG))
    assert not any(c.passed for c in DEMANDS.disturbed(57 / 64, 1.0, CONFIG))


def test_the_trial_run_lasts_as_long_as_the_examination_without_pushes(
    tiny: Creature, monkeypatch: pytest.MonkeyPatch
):
    tried: list[tuple[int, float]] = []

    def simulated(creature: Creature, champion: Champion, starts: Starts, seconds: float, **_: Any):
        tried.append((len(starts), seconds))
        assert not starts.push.any()
        return became([to((0, 0), (16, goal)) for goal in starts.goal], [np.inf] * len(starts))

    monkeypatch.setattr(trials, "simulate", simulated)
    hopper = dataclasses.replace(make_champion(tiny), task="hop")
    assert trial_run(tiny, hopper, 6) == 1.0
    assert tried == [(6, CONFIG.seconds)]


@pytest.mark.parametrize(
    ("failing", "wanted", "ended", "margin"),
    [
        (0, 0.0, None, 1.0),
        (6, 0.0, None, 0.0625),  # 58 of 64 succeed
        (12, 0.0, 7, -1 / 64 / 0.1 + 0.0625),  # 57 of 64 at best
        (7, -np.inf, None, -1 / 64 / 0.1 + 0.0625),
        (6, 0.25, 5, 0.21875),  # passes, but not with this margin
    ],
)
def test_the_trial_run_ends_if_the_wanted_margin_is_out_of_reach(
    tiny: Creature,
    monkeypatch: pytest.MonkeyPatch,
    failing: int,
    wanted: float,
    ended: int | None,
    margin: float,
):
    """Simulations fall one by one; the deciding fall ends them all."""
    told: list[int] = []

    def simulated(
        creature: Creature,
        champion: Champion,
        starts: Starts,
        seconds: float,
        watch: Watch,
        **_: Any,
    ):
        for fallen in range(failing + 1):
            if watch.tell(np.arange(64) < fallen):
                told.append(fallen)
                break
        fell = np.where(np.arange(64) < failing, 1.0, np.inf)
        return became([to((0, 0), (16, goal)) for goal in starts.goal], fell)

    monkeypatch.setattr(trials, "simulate", simulated)
    hopper = dataclasses.replace(make_champion(tiny), task="hop")
    assert trial_run(tiny, hopper, 64, wanted=wanted) == pytest.approx(margin)
    assert told == ([] if ended is None else [ended])
    share = 1 - failing / 64
    error = (share * (1 - share) / 64) ** 0.5
    if ended is None:
        cautious = trial_run(tiny, hopper, 64, wanted=-10.0, caution=2.0)
        assert cautious == pytest.approx(margin - 2 * error / 0.1)


@pytest.mark.parametrize("task", ["hop", "limbo"])
def test_at_the_end_all_but_the_successful_are_lost(tiny: Creature, task: str):
    """None is lost while it can still succeed."""
    acceptance = acceptance_of(task)
    beside = to((0, 0), (3, GOAL), drift=0.5)
    ways = [good(), good(), to((0, 0), (3, 1.0)), to((0, 0), (19, 0), (20, GOAL)), beside, good()]
    starts = nominal_starts(tiny, 6)
    starts.goal[:] = GOAL
    clearance = np.array([*[0.02] * 5, -0.01 if task == "limbo" else np.inf])
    fell = np.array([np.inf, 21.0, *[np.inf] * 4])
    outcome = dataclasses.replace(became(ways, list(fell)), clearance=clearance)
    lost = acceptance.lost(outcome, starts, FRAMES, CONFIG)
    assert (~lost).tolist() == acceptance.succeeded(outcome, starts, CONFIG).tolist()
    assert lost.tolist() == [False, True, True, True, True, task == "limbo"]
    # A hopper that stands still can succeed until it must have arrived.
    before = round((CONFIG.seconds - acceptance.wanted(CONFIG).stay) / STEP)
    assert not acceptance.lost(outcome, starts, before, CONFIG)[[2, 3, 4]].any()
    assert acceptance.lost(outcome, starts, before + 1, CONFIG)[[2, 3, 4]].all()


def test_simulations_end_when_the_losses_decide_the_result(tiny: Creature):
    """Stepping ends soon after the decision, with any number of threads.

    Recorded simulations would otherwise continue after their fall.
    """
    flat = make_champion(tiny, np.tile([1.0, 1.4], (2, 4)))
    starts = nominal_starts(tiny, 4)
    step = tiny.model.opt.timestep

    def seen(watch: Watch | None, threads: int = 2) -> tuple[np.ndarray, float]:
        outcome = simulate(tiny, flat, starts, 3.0, record=4, threads=threads, watch=watch)
        return outcome.fell, step * float(np.isfinite(outcome.trajectory.qpos[..., 0]).sum(1).max())

    fell, whole = seen(None)
    assert np.isfinite(fell).all()
    assert whole == pytest.approx(3.0)
    patient = Watch(4, lambda lost: False)
    assert seen(patient)[1] == whole
    assert patient.lost.all()
    assert not patient.over
    for threads in (1, 2):
        hasty = Watch(4, lambda lost: bool(lost.sum() >= 2))
        assert seen(hasty, threads)[1] == pytest.approx(fell.max(), abs=20 * step)
        assert hasty.over


def test_a_walk_succeeds_by_staying_up(tiny: Creature):
    walking, outcome = acceptance_of("walk"), became([to((0, 0))] * 2, [np.inf, 3.0])
    starts = nominal_starts(tiny, 2)
    assert walking.succeeded(outcome, starts, CONFIG).tolist() == [True, False]
    assert walking.aimed(starts, CONFIG) is starts
    assert walking.fall(CONFIG) == CONFIG.upright
    assert [c.number for c in walking.disturbed(1.0, 1.0, CONFIG)] == [4, 5]


@pytest.mark.parametrize(
    ("off", "seconds", "worth"),
    [
        ([0.01, 0.049], [6, 6], True),
        ([0.01, 0.06], [6, 6], False),
        ([0.01, 0.01], [6, 5], False),
        ([0.01] * 6 + [0.2] * 4, [6] * 10, True),
        ([0.01] * 5 + [0.2] * 5, [6] * 10, False),
    ],
)
def test_which_metrics_are_worth_an_examination(
    tiny: Creature, off: list, seconds: list, worth: bool
):
    outcome = {"off": np.array(off), "seconds": np.array(seconds, float)}
    assert promising(DEMANDS, outcome, 6.0, tiny) is worth


# Goals


def goals(creature: Creature, draw: trials.Draw) -> np.ndarray:
    starts = nominal_starts(creature, 64)
    return DEMANDS.aimed(starts, CONFIG, draw.generator(trials.AIMS)).goal


def test_the_goals_of_the_examination_are_new(tiny: Creature, trotter: Champion):
    """Neither evolution nor the draw that chooses champions has had them."""
    task = Hop(tiny, STEP, 1000, tiny.settings.termination)
    evolved = task.trials(key_of(0), tiny, RolloutConfig(starts=64)).goal[1:]
    mine = goals(tiny, trials.own_draw(trotter, CONFIG))
    assert len(set(mine.tolist())) == 64
    np.testing.assert_array_equal(mine, goals(tiny, trials.own_draw(trotter, CONFIG)))
    for known in (evolved, goals(tiny, trials.common_draw(CONFIG)), [CONFIG.hop.nominal]):
        assert not np.isin(mine.astype(np.float32), np.float32(known)).any()
    low, high = CONFIG.hop.goals
    assert low <= mine.min() < low + 0.2
    assert high - 0.2 < mine.max() <= high


def test_drawing_goals_changes_no_other_field_of_the_starts(tiny: Creature):
    starts = perturbed_starts(tiny, 8, np.random.default_rng(0))
    aimed = DEMANDS.aimed(starts, CONFIG, np.random.default_rng(1))
    for field in dataclasses.fields(starts):
        same = np.array_equal(getattr(aimed, field.name), getattr(starts, field.name))
        assert same is (field.name != "goal")


def test_an_existing_goal_is_kept(tiny: Creature):
    starts = nominal_starts(tiny, 3)
    starts.goal[1] = 0.7
    assert DEMANDS.aimed(starts, CONFIG).goal.tolist() == [1.2, 0.7, 1.2]


def test_certificate_and_evolution_use_the_same_goals():
    acceptance = HopThresholds()
    assert (acceptance.goals, acceptance.nominal) == (evolution.GOALS, evolution.NOMINAL_GOAL)
    assert acceptance.near == evolution.NEAR


class Pointer:
    """Reference controller that shows the distance to the goal in its joint commands."""

    reads, command, every = ("goal_distance", "forward"), "pose", 1

    def __init__(self, creature: Creature, champion: Champion, step: float) -> None:
        self.stand = creature.joints.stand

    def init(self, count: int) -> Mapping[str, np.ndarray]:
        return {}

    def phase(self, memory: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.zeros(0)

    def act(self, memory: Mapping, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Mapping]:
        command = np.tile(self.stand, (len(senses["forward"]), 1))
        command[:, 0] = 0.1 * senses["goal_distance"]
        command[:, 1] = senses["forward"]
        return command, memory


@pytest.fixture
def pointer(tiny: Creature, monkeypatch: pytest.MonkeyPatch) -> Champion:
    monkeypatch.setattr("mjxgait.reference.stepping.reference_of", Pointer)
    monkeypatch.setattr(Pointer, "phase", lambda self, memory: np.nan)
    return dataclasses.replace(make_champion(tiny), task="hop")


def test_every_simulation_observes_its_own_goal(tiny: Creature, pointer: Champion):
    starts = nominal_starts(tiny, 3)
    starts.goal[:2] = [0.5, 1.9]
    film = simulate(tiny, pointer, starts, 0.5, record=3).trajectory
    left, forward = 10 * film.target[..., 0], film.target[..., 1]
    np.testing.assert_allclose(left + forward, np.tile([[0.5], [1.9], [1.2]], 100), atol=1e-12)
    assert np.abs(forward).max() > 1e-4


def test_simulations_with_different_goals_are_not_merged(tiny: Creature, pointer: Champion):
    """Only equal simulations are simulated once until their push."""
    rng = np.random.default_rng(5)
    pushed = join(pushed_starts(tiny, 2, rng, 0.3, (0.3, 0.4)), nominal_starts(tiny, 1))
    pushed.goal[:] = [1.2, 2.0, 1.2]
    together = simulate(tiny, pointer, pushed, 0.5, threads=1)
    for row in range(3):
        alone = simulate(tiny, pointer, pushed.rows(slice(row, row + 1)), 0.5)
        np.testing.assert_array_equal(together.path[row], alone.path[0])


def test_the_path_equals_the_recording_and_ends_with_a_fall(tiny: Creature, trotter: Champion):
    starts = pushed_starts(tiny, 4, np.random.default_rng(5), 0.3, (0.2, 0.6))
    together = simulate(tiny, trotter, starts, 1.0, threads=1)
    film = simulate(tiny, trotter, starts, 1.0, record=4)
    np.testing.assert_array_equal(together.path[:, :-1], film.trajectory.qpos[:, 1:, 0])
    np.testing.assert_array_equal(together.aside[:, :-1], film.trajectory.qpos[:, 1:, 1])
    assert np.abs(together.aside).max() > 1e-3
    thrown = pushed_starts(tiny, 1, np.random.default_rng(0), 6.0, (0.1, 0.1))
    fallen = simulate(tiny, trotter, thrown, 1.0)
    down = round(float(fallen.fell[0]) / STEP)
    assert np.isfinite(fallen.path[0, :down]).all()
    assert np.isnan(fallen.path[0, down:]).all()
