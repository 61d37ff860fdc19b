"""Limbo: intrusion into the bar, its fitness term, and certification."""

import dataclasses
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from helpers import SHORT, STOOL, pose_champion, said_by

from mjxgait.certification import CertificateConfig, record
from mjxgait.certification.acceptance import acceptance_of, promising
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.config.layers import find_creature
from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.geometry import support_extents
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import EvolutionState
from mjxgait.plugins.registry import build_config
from mjxgait.reference.bar import FAR, Clearance
from mjxgait.reference.bar import RADIUS as EXAMINED_RADIUS
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome, Trajectory
from mjxgait.reference.starts import nominal_starts, perturbed_starts
from mjxgait.tasks.hop import config as evolution
from mjxgait.tasks.hop.config import BAR_PLACE, LimboConfig, LimboWeights
from mjxgait.tasks.hop.fitness import signed_weights, terms_under
from mjxgait.tasks.hop.limbo import Limbo, LimboGoal, bar_distance, intrusion
from mjxgait.tasks.hop.thresholds import LimboThresholds
from mjxgait.training.experiment import build_experiment
from mjxgait.training.generation import (
    LEADERS,
    RunParams,
    next_starts,
    with_level_raised,
)
from mjxgait.types import Sensed

CONFIG, DEMANDS = CertificateConfig(), acceptance_of("limbo")
STEP, HORIZON, HEIGHT = 0.005, 1000, 0.35
MORE = pytest.mark.thorough("another height")


@pytest.fixture(scope="module")
def luxo() -> Creature:
    return load_creature(find_creature("luxo"))


@pytest.fixture(scope="module")
def looker(luxo: Creature) -> Clearance:
    return Clearance(luxo)


def posed(
    creature: Creature, ahead: float, up: float = 0.0, joints: object = None
) -> mujoco.MjData:
    """Standing, or with these joint angles, moved ahead of the start and up, in m."""
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.stand_qpos
    data.qpos[[0, 2]] += ahead, up
    if joints is not None:
        data.qpos[creature.joints.qpos_adr] = joints
    mujoco.mj_kinematics(creature.model, data)
    return data


def sensed(creature: Creature, data: mujoco.MjData) -> Sensed:
    """Sensed values of evolution; heights from MuJoCo's kinematics."""
    model, low = creature.model, []
    for g in creature.feet.watched:
        ball, box, round_part = support_extents(model.geom_type[g], model.geom_size[g])
        down = data.geom_xmat[g].reshape(3, 3)[2]
        reach = ball + np.abs(down) @ box + np.linalg.norm(down * round_part)
        low.append(data.geom_xpos[g, 2] - reach)
    still = jnp.zeros(3)
    return Sensed(
        joint_pos=jnp.float32(data.qpos[creature.joints.qpos_adr]),
        joint_vel=jnp.zeros(len(creature.joints.stand)),
        bias=jnp.zeros(creature.nv),
        trunk_pos=jnp.float32(data.xpos[creature.trunk]),
        trunk_rot=jnp.float32(data.xmat[creature.trunk].reshape(3, 3)),
        trunk_vel=still,
        trunk_angvel=still,
        geom_pos=jnp.float32(data.geom_xpos[creature.feet.watched]),
        geom_low=jnp.float32(np.array(low)),
    )


def depth(creature: Creature, data: mujoco.MjData, height: float = HEIGHT) -> float:
    return float(intrusion(creature, sensed(creature, data), height))


def clearance(looker: Clearance, data: mujoco.MjData, height: float = HEIGHT) -> float:
    bar = np.array([[BAR_PLACE, height]])
    return float(looker.of(data.geom_xpos[None], data.geom_xmat[None], bar)[0])


# Evolution


def test_intrusion_is_the_height_above_the_bar(luxo: Creature):
    """The highest point of the lamp is at 0.42 m, ahead of its base."""
    deep = depth(luxo, posed(luxo, BAR_PLACE - 0.1))
    assert 0.42 - HEIGHT <= deep < 0.42 - HEIGHT + 0.03
    assert depth(luxo, posed(luxo, BAR_PLACE - 0.1), height=0.45) == 0.0


def test_a_body_away_from_the_bar_is_clear(luxo: Creature):
    assert depth(luxo, posed(luxo, 0.0)) == 0.0
    assert depth(luxo, posed(luxo, BAR_PLACE + 0.4)) == 0.0


def test_flying_over_the_bar_is_worse(luxo: Creature):
    deep = [depth(luxo, posed(luxo, BAR_PLACE, up)) for up in (0.0, 0.3, 0.6, 1.0)]
    assert min(deep) > 0
    assert all(np.diff(deep) > 0.2)


def poses(creature: Creature, count: int) -> list[mujoco.MjData]:
    """Random poses around the bar, some of them high up."""
    rng = np.random.default_rng(0)
    return [
        posed(
            creature,
            BAR_PLACE + rng.uniform(-0.4, 0.4),
            abs(rng.normal(0.0, 0.05)),
            rng.uniform(creature.joints.pose_low, creature.joints.pose_high),
        )
        for _ in range(count)
    ]


@pytest.mark.parametrize(
    "height", [pytest.param(0.25, marks=MORE), pytest.param(0.3, marks=MORE), 0.35]
)
def test_clear_in_evolution_means_clear_of_all_parts(
    luxo: Creature, looker: Clearance, height: float
):
    """For all parts, including rods and springs between the watched geoms."""
    found = [(depth(luxo, d, height), clearance(looker, d, height)) for d in poses(luxo, 400)]
    deep, clear = np.array(found).T
    assert (deep == 0).sum() > 50
    assert clear[deep == 0].min() > 0


def test_intrusion_is_conservative_by_at_most_35_mm(luxo: Creature):
    """A body 3.5 cm or more below, before or behind the bar is clear."""
    for data in poses(luxo, 200):
        tops = data.geom_xpos[1:, 2] + luxo.model.geom_rbound[1:]
        assert depth(luxo, data, float(tops.max()) + 0.035) == 0
    assert depth(luxo, posed(luxo, BAR_PLACE - 0.15928 - 0.035)) == 0


def test_the_bar_distance_is_sensed(luxo: Creature):
    for ahead in (0.0, 0.2, 1.0):
        value = bar_distance(luxo, sensed(luxo, posed(luxo, ahead)))
        assert float(value) == pytest.approx(BAR_PLACE - ahead, abs=1e-6)


def test_the_deepest_intrusion_costs_fitness(luxo: Creature):
    task = Limbo(luxo, STEP, HORIZON, luxo.settings.termination)
    moments = [sensed(luxo, posed(luxo, ahead)) for ahead in (0.0, 0.5, 1.4)]
    stats, params = task.init(), task.params(LimboConfig(height=HEIGHT))
    goal = LimboGoal(ahead=jnp.float32(1.4), raised=jnp.float32(0.03))
    for moment in moments:
        stats = task.update(stats, moment, jnp.zeros(3), params, goal)
    assert float(stats.bar) == pytest.approx(depth(luxo, posed(luxo, 0.5)))
    # The lowest bar it would have cleared, but never lower than its own.
    needed = float(task.outcome(stats)["bar"])
    assert needed == pytest.approx(HEIGHT + depth(luxo, posed(luxo, 0.5)))
    unhurt = dataclasses.replace(stats, bar=jnp.zeros(()))
    assert float(task.outcome(unhurt)["bar"]) == pytest.approx(HEIGHT)
    # The intrusion counts at the bar's current height.
    deep = (float(stats.bar) - 0.03) / luxo.frame.hip_height
    terms = task.evaluate(stats, LimboConfig())
    assert float(terms["bar"]) == pytest.approx(deep / 0.3, rel=1e-4)
    above = task.evaluate(dataclasses.replace(stats, raised=jnp.float32(0.2)), LimboConfig())
    assert float(above["bar"]) == 0.0
    stats = dataclasses.replace(stats, raised=jnp.float32(0.0))
    terms = task.evaluate(stats, LimboConfig())
    deep = float(stats.bar) / luxo.frame.hip_height
    assert float(terms["bar"]) == pytest.approx(min(deep / 0.3, 1.0), rel=1e-5)
    clear = task.evaluate(dataclasses.replace(stats, bar=jnp.zeros(())), LimboConfig())
    assert float(clear["bar"]) == 0.0
    assert all(float(clear[name]) == float(terms[name]) for name in task.terms if name != "bar")


def test_passing_through_the_bar_beats_staying_before_it(luxo: Creature):
    """Otherwise evolution never learns to pass beneath it. After arrival `missed` costs nothing."""
    task = Limbo(luxo, STEP, HORIZON, luxo.settings.termination)
    weights = signed_weights(LimboConfig(), jnp.int32(1000))
    assert set(weights) == set(task.terms)
    manner = sum(float(w) for name, w in weights.items() if name not in ("distance", "missed"))
    assert manner > float(weights["distance"])


def test_the_bar_comes_down_in_steps_and_stays(stool: Creature):
    """In the compiled program; each of the two experiments follows its own settings."""
    common = {"use": {"task": "limbo"}, "evolution": {"population": 6}}
    rollout = {"seconds": 0.2, "starts": 3, "promote": 1.0, "lanes": 4}
    rows = [
        build_experiment(
            stool, build_config({**common, "fitness": fitness, "rollout": rollout}, "test")
        )
        for fitness in ({"higher": 0.1, "lowering": 10}, {"lowering": 0})
    ]
    state, task = rows[0].init(), rows[0].simulator.task

    assert state.level == 0

    def raised(row: RunParams, level: int) -> np.ndarray:
        return np.asarray(next_starts(task, row, at(state, level=level)).goal.raised)

    for level, expected in ((0, 0.1), (1, 0.09), (5, 0.05), (10, 0.0), (50, 0.0)):
        assert raised(rows[0].row, level) == pytest.approx([expected] * 3, abs=1e-6)
        assert raised(rows[1].row, level) == pytest.approx([0.0] * 3)


def at(state: EvolutionState, **changed: float) -> EvolutionState:
    return dataclasses.replace(state, **{k: jnp.asarray(v) for k, v in changed.items()})


@pytest.mark.parametrize(
    ("missed", "bar", "of", "has_curriculum"),
    [
        ([0.9, 0.2], [0.0, 0.08], LEADERS, True),
        ([0.9, 0.5], [0.0, 0.0], LEADERS, False),
        ([0.0, 0.0], [0.0, 0.12], LEADERS, False),
        ([0.0, 0.0], [0.0, 0.0], LEADERS // 2 + 1, True),
        ([0.0, 0.0], [0.0, 0.0], LEADERS // 2, False),
    ],
)
def test_the_bar_comes_down_when_most_of_the_best_pass(
    stool: Creature, missed: list[float], bar: list[float], of: int, has_curriculum: bool
):
    """Means over the two trials; results from the higher bar are discarded."""
    task = Limbo(stool, STEP, HORIZON, stool.settings.termination)
    terms = np.ones((LEADERS + 3, 2, len(task.terms)), np.float32)
    terms[:of, :, task.terms.index("missed")] = missed
    terms[:of, :, task.terms.index("bar")] = bar
    names = {field.name: None for field in dataclasses.fields(EvolutionState)}
    rounds, fitness = jnp.full(len(terms), 3.0), -jnp.arange(float(len(terms)))
    state = EvolutionState(**names | {"terms": jnp.asarray(terms), "rounds": rounds})
    state = at(dataclasses.replace(state, fitness=fitness), level=4, generation=7)
    state = at(state, quiet=6, barren=2, spell_best=3.0)
    settings = LimboConfig(lowering=5)
    after = with_level_raised(task, settings, state)
    assert int(after.level) == 4 + has_curriculum
    assert bool(after.stale) == has_curriculum
    assert (np.asarray(after.rounds) == (0.0 if has_curriculum else 3.0)).all()
    spells = (int(after.quiet), int(after.barren), float(after.spell_best))
    assert spells == ((-1, 0, -np.inf) if has_curriculum else (6, 2, 3.0))
    without_result = (at(state, generation=-1), at(state, fitness=np.full(len(terms), -np.inf)))
    assert all(
        int(with_level_raised(task, settings, unjudged).level) == 4 for unjudged in without_result
    )
    assert with_level_raised(task, settings, dataclasses.replace(state, level=None)).level is None
    # At the lowest bar the level stays, and results are kept.
    down = with_level_raised(task, LimboConfig(lowering=4), state)
    assert int(down.level) == 4
    assert not bool(down.stale)
    assert (np.asarray(down.rounds) == 3.0).all()


def test_all_goals_lie_beyond_the_bar(luxo: Creature):
    task = Limbo(luxo, STEP, HORIZON, luxo.settings.termination)
    goals = np.asarray(task.trials(key_of(0), luxo, RolloutConfig(starts=100)).goal.ahead)
    assert goals[0] == np.float32(evolution.LIMBO_NOMINAL_GOAL)
    assert goals.min() > BAR_PLACE + luxo.frame.body_length
    with pytest.raises(UserError, match=r"slope:0.1.*flat"):
        task.trials(key_of(0), luxo, RolloutConfig(ground="slope:0.1"))


def test_bar_height_is_a_parameter_of_one_program(stool: Creature):
    tables = [{"fitness": {"height": height}} for height in (0.1, 5.0)]
    common = {"use": {"task": "limbo"}, "evolution": {"population": 6}}
    rollout = {"seconds": 0.2, "starts": 2, "promote": 1.0, "lanes": 4}
    built = [
        build_experiment(stool, build_config({**common, **table, "rollout": rollout}, "test"))
        for table in tables
    ]
    low, high = (experiment.row.settings for experiment in built)
    assert jax.tree.structure(low) == jax.tree.structure(high)


# Certification


def test_evolution_and_certification_have_the_same_bar_and_goals():
    acceptance = LimboThresholds()
    assert (acceptance.place, EXAMINED_RADIUS) == (BAR_PLACE, evolution.BAR_RADIUS)
    assert acceptance.height == LimboConfig().height == HEIGHT
    assert (acceptance.goals, acceptance.nominal) == (
        evolution.LIMBO_GOALS,
        evolution.LIMBO_NOMINAL_GOAL,
    )


def test_clearance_is_the_distance_of_the_nearest_part(luxo: Creature, looker: Clearance):
    """The foremost part is the rim of the shade, 0.159 m ahead of the base's centre."""
    front = BAR_PLACE - EXAMINED_RADIUS - 0.15928
    assert clearance(looker, posed(luxo, front - 0.03)) == pytest.approx(0.03, abs=1e-3)
    assert clearance(looker, posed(luxo, front + 0.01)) == pytest.approx(-0.01, abs=2e-3)
    assert clearance(looker, posed(luxo, 0.0)) == FAR
    # The top is at 0.4199 m, below a bar at 0.45 m.
    assert clearance(looker, posed(luxo, BAR_PLACE - 0.09), 0.45) == pytest.approx(0.03, abs=2e-3)


def test_above_the_bar_clearance_is_negative(luxo: Creature, looker: Clearance):
    assert clearance(looker, posed(luxo, BAR_PLACE, up=1.0)) < 0


def test_each_simulation_has_its_own_bar(luxo: Creature, looker: Clearance):
    data = posed(luxo, 0.0)
    pos, rot = (np.repeat(a[None], 3, 0) for a in (data.geom_xpos, data.geom_xmat))
    bars = np.array([[0.2, 0.35], [0.1, 0.45], [5.0, 0.1]])
    close, below, far = looker.of(pos, rot, bars)
    assert (close, far) == (pytest.approx(0.2 - 0.01 - 0.159, abs=1e-3), FAR)
    assert below == pytest.approx(0.45 - 0.42, abs=5e-3)


def became(clear: list[float]) -> Outcome:
    """An outcome in which every trial arrives."""
    count = len(clear)
    path, nothing = np.full((count, 4400), 1.4), np.zeros((0, 4400))
    film = Trajectory(STEP, *[nothing] * 5)
    up, aside = np.full(count, np.inf), np.zeros((count, 4400))
    return Outcome(up, np.zeros((count, 2)), path, np.array(clear), film, aside=aside)


def test_disturbed_trials_succeed_only_if_clear_of_the_bar(luxo: Creature):
    starts = DEMANDS.aimed(nominal_starts(luxo, 4), CONFIG)
    outcome = became([0.1, 0.001, -0.001, np.nan])
    assert DEMANDS.succeeded(outcome, starts, CONFIG).tolist() == [True, True, False, False]


def still(creature: Creature) -> Champion:
    """A champion that stands still."""
    made = pose_champion(creature, np.stack([creature.joints.stand] * 2), {})
    return dataclasses.replace(made, task="limbo")


def standing(creature: Creature, goal: float, bar: float) -> Recording:
    """Recording of a champion that stands still, with its goal and bar at these places."""
    starts = nominal_starts(creature, 1)
    starts.goal[:], starts.bar[:] = goal, (bar, HEIGHT)
    return record(creature, still(creature), 6.0, start=starts)


@pytest.mark.parametrize(
    ("bar", "failed"), [(0.6, set()), (0.1, {3}), (-0.1, set())], ids=["far", "head", "low elbow"]
)
def test_criterion_3_allows_no_part_to_touch_the_bar(luxo: Creature, bar: float, failed: set[int]):
    recording = standing(luxo, 0.001, bar)
    criteria = DEMANDS.basic(recording, CONFIG)
    assert {c.number for c in criteria if not c.passed} - {2} == failed


def test_clearance_is_measured_for_perturbed_starts(luxo: Creature):
    starts = DEMANDS.aimed(perturbed_starts(luxo, 3, np.random.default_rng(0)), CONFIG)
    starts.bar[1:, 0] = 0.1, 0.25
    outcome = simulate(luxo, still(luxo), starts, 0.2)
    assert outcome.clearance[0] == FAR
    assert outcome.clearance[1] < 0 < outcome.clearance[2] < FAR


def test_validation_requires_clearing_the_certificates_bar(luxo: Creature):
    there = {"off": np.zeros(2), "seconds": np.full(2, 8.0)}
    examined = CONFIG.limbo.height
    # Training may use a lower bar than certification, and may touch that one.
    for beneath in (examined, examined - 0.02):
        assert promising(DEMANDS, there | {"bar": np.array([beneath, examined])}, 8.0, luxo)
    assert not promising(DEMANDS, there | {"bar": np.array([0.0, examined + 1e-3])}, 8.0, luxo)


def test_a_short_run_ends_with_a_champion_and_a_certificate(tmp_path: Path, capsys):
    folder, short = tmp_path / "run", tmp_path / "short.toml"
    short.write_text(SHORT + "[limbo]\nstay = 1.0\n")
    small = "--population 6 --generations 1 --rollout.seconds 0.4 --rollout.lanes 4"
    rest = "--examination.candidates 0 --no-plots --task limbo"
    said_by(capsys, "train", "--env", STOOL, *small.split(), *rest.split(), "--out", folder, code=0)
    champion = json.loads((folder / "champion.json").read_text())
    assert list(champion["terms"]) == list(terms_under(LimboWeights()))
    assert set(champion["origin"]["nominal"]) == {"left", "off", "arrival", "seconds", "bar"}
    said_by(capsys, "certify", folder, "--config", short, code=0)
    certificate = json.loads((folder / "certificate.json").read_text())
    assert [c["number"] for c in certificate["criteria"]] == [1, 2, 3, 4, 6, 8, 9]
    assert certificate["report"]["goal"] == evolution.LIMBO_NOMINAL_GOAL
