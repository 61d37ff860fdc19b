"""Targets of a walk: their fitness terms, footfalls, and command-line values."""

import copy
import dataclasses
import itertools
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from helpers import altered, pose_champion, small_config
from hypothesis import given, settings
from hypothesis import strategies as st

from mjxgait.certification.describe import gait_name
from mjxgait.certification.stress import StressConfig
from mjxgait.champion import read_champion, write_champion
from mjxgait.config.layers import data_folder, shipped_creatures
from mjxgait.config.schema import Config, UseConfig
from mjxgait.config.traced import traced
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.load import SETTINGS, creature_of
from mjxgait.creature.scale import facing
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.plugins import resolve_config
from mjxgait.plugins.fit import check_fit
from mjxgait.tasks.base import in_order
from mjxgait.tasks.terms import score
from mjxgait.tasks.walk.config import TargetWeights, WalkConfig, Weights
from mjxgait.tasks.walk.fitness import REWARDS, TERMS, terms_under
from mjxgait.tasks.walk.gaits import (
    GAITS,
    animal_stride,
    gait_of,
    placed,
    stations_of,
)
from mjxgait.tasks.walk.stats import WalkStats
from mjxgait.tasks.walk.target_stats import Footfalls, gait_missed, no_footfalls, stepped
from mjxgait.tasks.walk.targets import (
    WalkTargets,
    configured,
    hint,
    lowest_height,
    speed_of,
    with_targets,
)
from mjxgait.tasks.walk.task import TargetedWalk, Walk
from mjxgait.training.experiment import build_batch

STEP, HORIZON = 0.005, 1000
"""5 s."""
SPEED = 0.4
"""m/s; 2 m in an episode."""
FINISHED = {"steps": HORIZON}
STANDS = FINISHED | {"contact": [1000.0] * 4, "height": 500.0, "height_squared": 250.0}
"""Stands on all feet for the whole episode."""
DIES = {"steps": 40, "reason": 1, "tilt": 20.0, "touch": 1.0}
MISSES = ("tilt", "wobble", "work", "saturation", "limits", "airborne", "foot_height", "touch")
MISSES += ("foot_speed",)
WHIP = {"foot_speed": 4.0}
"""This weight is compiled into the program."""


@pytest.fixture(scope="module")
def body(stool: Creature) -> Creature:
    """A body with round measures and four feet placed like a dog's."""
    return altered(
        stool,
        frame={"body_length": 1.0, "hip_height": 0.5, "mass": 20.0},
        feet={"stations": ((0, True), (0, False), (1, True), (1, False))},
    )


def asked(config: WalkConfig, body: Creature) -> TargetedWalk:
    task = Walk.with_settings(body, STEP, HORIZON, body.settings.termination, config)
    assert isinstance(task, TargetedWalk)
    return task


def config_of(weights: dict | None = None, **wish) -> WalkConfig:
    return small_config(fitness={"wish": {"speed": SPEED} | wish, "weights": weights or {}}).fitness


@pytest.fixture(scope="module")
def fitness_of(body: Creature):
    """Fitness of one episode from its statistics, for any settings; compiled once."""
    task = asked(config_of(WHIP, gait="trot", height=0.9, bounce=0.02, sway=6.0), body)

    @jax.jit
    def evaluation(stats, config: WalkConfig) -> jax.Array:
        terms = in_order(task.evaluate(stats, config), task.terms)
        weights = in_order(task.weights(config, jnp.int32(0)), task.terms)
        return score(terms[None], weights, 0.5)

    def fitness(stats: dict, config: WalkConfig) -> float:
        arrays = {name: jnp.asarray(value, jnp.float32) for name, value in stats.items()}
        filled = dataclasses.replace(task.init(), **arrays)
        return float(evaluation(filled, config))

    return fitness


def walking(way: float = 2.0, **more) -> dict:
    """Statistics of a steady walk of `way` m; half of it in half the time."""
    return FINISHED | {"forward": way, "forward_half": way / 2, "contact": [600.0] * 4} | more


amount = st.floats(0.0, 1024.0, width=32, allow_subnormal=False)
everything = st.fixed_dictionaries(dict.fromkeys(MISSES, amount))


@settings(max_examples=30, deadline=None)
@given(
    weights=st.fixed_dictionaries({n: amount for n in TERMS if n not in ("distance", *WHIP)}),
    worth=st.floats(0.0078125, 128.0, width=32),
    targets=st.fixed_dictionaries({f.name: amount for f in dataclasses.fields(TargetWeights)}),
    spoilt=everything,
    way=st.floats(0.0625, 40.0, width=32),
    steps=st.integers(40, HORIZON),
    left=st.floats(-5.0, 5.0, width=32, allow_subnormal=False),
)
def test_any_walk_beats_no_walk_at_any_weights(
    fitness_of, weights, worth, targets, spoilt, way, steps, left
):
    own = Weights(**(weights | WHIP | {"distance": worth}))
    base = config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0)
    wish = dataclasses.replace(base.wish, weights=TargetWeights(**targets))
    config = traced_fitness(dataclasses.replace(base, weights=own, wish=wish))
    bad = walking(way, steps=steps, reason=1, left=left) | spoilt
    # Beyond rounding: a walk keeps at least a hundredth of its reward.
    assert fitness_of(bad, config) > 0.005 * fitness_of(bad, traced_fitness(free_of_cost(own)))
    # Standing earns nothing, whatever the penalties; nor does falling on the spot.
    assert fitness_of(STANDS, config) == 0.0
    assert fitness_of(DIES | spoilt, config) == 0.0


def free_of_cost(weights: Weights) -> WalkConfig:
    """The same rewards without penalties."""
    nothing = dict.fromkeys((n for n in TERMS if n not in REWARDS), 0.0)
    free = dict.fromkeys((field.name for field in dataclasses.fields(TargetWeights)), 0.0)
    base = config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0)
    wish = dataclasses.replace(base.wish, weights=TargetWeights(**free))
    return dataclasses.replace(base, weights=dataclasses.replace(weights, **nothing), wish=wish)


def traced_fitness(config: WalkConfig) -> WalkConfig:
    return traced(Config(fitness=config)).fitness


def test_fitness_peaks_at_the_target_speed(fitness_of):
    config = traced_fitness(config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0))
    worth = [fitness_of(walking(way), config) for way in (0.5, 1.0, 1.8, 2.0, 2.2, 3.0, 4.0, 8.0)]
    assert np.argmax(worth) == 3
    assert (np.diff(worth[:4]) > 0).all()
    assert (np.diff(worth[3:]) < 0).all()


def test_a_lunge_scores_less_than_half_a_walk(fitness_of):
    """The full distance in an eighth of the time, then a fall, scores less than half the distance
    without a fall.
    """
    config = traced_fitness(config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0))
    lunge = walking(2.0, steps=125, reason=1, forward_half=2.0, contact=[75.0] * 4)
    assert fitness_of(lunge, config) < fitness_of(walking(1.0), config)


@pytest.mark.parametrize("name", MISSES)
def test_fitness_falls_as_a_penalty_grows(fitness_of, name: str):
    config = traced_fitness(config_of(WHIP, gait="trot", height=0.9, bounce=0.02, sway=6.0))
    worth = [fitness_of(walking() | {name: value}, config) for value in (200.0, 400.0, 800.0)]
    assert worth[0] > worth[1] > worth[2]


def test_fitness_peaks_at_the_target_posture(body: Creature, fitness_of):
    config = traced_fitness(config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0))

    def carried(height: float, bounce: float) -> float:
        mean = height * float(body.frame.stand_height)
        square = mean**2 + (bounce * body.frame.hip_height) ** 2
        return fitness_of(walking(height=1000 * mean, height_squared=1000 * square), config)

    assert carried(0.9, 0.02) > max(carried(0.8, 0.02), carried(1.0, 0.02))
    assert carried(0.9, 0.02) > max(carried(0.9, 0.0), carried(0.9, 0.06))
    far = [carried(height, 0.02) for height in (1.05, 1.0, 0.95, 0.9)]
    assert np.diff(far).min() > 0.5 * np.diff(far).max(), "hardly a reason to begin to crouch"
    rolls = [walking(roll_squared=1000 * np.radians(deg) ** 2) for deg in (0.0, 6.0, 12.0)]
    worth = [fitness_of(rolling, config) for rolling in rolls]
    assert worth[1] > max(worth[0], worth[2])


def test_without_targets_a_walk_has_no_target_terms(body: Creature):
    free = small_config().fitness
    task = Walk.with_settings(body, STEP, HORIZON, body.settings.termination, free)
    assert type(task) is Walk
    assert task.terms == terms_under(free.weights)
    assert type(task.init()) is WalkStats
    asks = traced_fitness(config_of()).wish
    assert len(jax.tree.leaves(asks)) == len(jax.tree.leaves(traced_fitness(free).wish)) + 1


def footfalls_of(phases: list[float], duty: float, period: int = 160) -> Footfalls:
    """Footfalls of feet that stand for `duty` of the cycle around these phases, over 12 cycles."""
    time = np.arange(12 * period) / period
    off = (time[:, None] - np.array(phases) + 0.5) % 1.0 - 0.5
    swinging = jnp.asarray(np.abs(off) > duty / 2, jnp.float32)

    def step(carry, now):
        falls, before, steps = carry
        after = dataclasses.replace(BLANK, steps=steps + 1, swinging=now, foot_down=1 - now)
        earlier = dataclasses.replace(BLANK, steps=steps, swinging=before)
        return (stepped(falls, earlier, after), now, steps + 1), None

    first = (no_footfalls(len(phases)), swinging[0], jnp.int32(0))
    return jax.lax.scan(step, first, swinging)[0][0]


BLANK = WalkStats(
    **{
        field.name: jnp.zeros((), jnp.int32 if field.name == "steps" else None)
        for field in dataclasses.fields(WalkStats)
    }
)
PLACES = {
    2: [(0.0, 0.1), (0.0, -0.1)],
    4: [(0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1)],
    6: [(x, y) for x in (0.2, 0.0, -0.2) for y in (0.3, -0.3)],
    8: [(x, y) for x in (0.3, 0.1, -0.1, -0.3) for y in (0.3, -0.3)],
}
WAYS = [
    (feet, name, way)
    for feet, table in GAITS.items()
    for name, gait in table.items()
    for way in range(len(gait.ways))
]


def made_up(feet: int, name: str, way: int) -> tuple[list[float], float]:
    """Phases by foot and a duty factor within the range of a gait."""
    gait = gait_of(name, feet)
    low, high = gait.duty
    return placed(gait, stations_of(PLACES[feet]))[way], min(max(0.45, low + 0.1), high - 0.1)


@pytest.mark.parametrize(("feet", "name", "way"), WAYS)
def test_a_target_gait_gets_its_own_label_in_certification(
    dog_sizes, feet: int, name: str, way: int
):
    phases, duty = made_up(feet, name, way)
    size = dataclasses.replace(
        dog_sizes, foot_names=tuple("abcdefgh"[:feet]), foot_places=tuple(PLACES[feet])
    )
    label = gait_name(size, np.full(feet, duty), np.array(phases) % 1.0)
    assert label in gait_of(name, feet).labels


@pytest.fixture(scope="module")
def dog_sizes():
    from certify_made_up import DOG

    return DOG


def test_stance_phase_follows_contact():
    """The hind feet are low early but touch late: their phase is that of the contact."""
    period, share = 160, 0.6
    time = np.arange(12 * period) / period
    phase = time[:, None] - np.array([0.0, 0.5, 0.0, 0.5])
    swinging = jnp.asarray(phase % 1.0 > share, jnp.float32)
    late = jnp.asarray([0.0, 0.0, 0.3, 0.3])
    down = jnp.asarray((phase % 1.0 > late) & (phase % 1.0 <= share), jnp.float32)

    def step(carry, now):
        falls, before, steps = carry
        earlier = dataclasses.replace(BLANK, steps=steps, swinging=before)
        after = dataclasses.replace(BLANK, steps=steps + 1, swinging=now[0], foot_down=now[1])
        return (stepped(falls, earlier, after), now[0], steps + 1), None

    first = (no_footfalls(4), swinging[0], jnp.int32(0))
    falls = jax.lax.scan(step, first, (swinging, down))[0][0]
    phases = np.arctan2(falls.sine, falls.cosine) / (2 * np.pi) % 1.0
    np.testing.assert_allclose(phases, [0.0, 0.5, 0.15, 0.65], atol=0.01)


@pytest.mark.parametrize(("feet", "name", "way"), WAYS)
def test_footfalls_match_their_own_gait_best(feet: int, name: str, way: int):
    phases, duty = made_up(feet, name, way)
    falls, stations = footfalls_of(phases, duty), stations_of(PLACES[feet])
    share = jnp.full(feet, duty)
    missed = {other: float(gait_missed(other, stations, falls, share)) for other in GAITS[feet]}
    assert missed[name] < 0.05
    apart = set(gait_of(name, feet).labels)
    for other, by in missed.items():
        if not apart & set(gait_of(other, feet).labels):
            assert by > 0.2, other


def test_a_foot_that_never_swings_matches_no_gait():
    phases, duty = made_up(4, "trot", 0)
    falls = footfalls_of(phases, duty)
    dragged = dataclasses.replace(
        falls,
        cosine=falls.cosine.at[3].set(0.0),
        sine=falls.sine.at[3].set(0.0),
        stances=falls.stances.at[3].set(0.0),
    )
    stations, share = stations_of(PLACES[4]), jnp.full(4, duty)
    for name in GAITS[4]:
        whole, less = (gait_missed(name, stations, f, share) for f in (falls, dragged))
        assert float(less) > float(whole) or name != "trot"
    none = no_footfalls(4)
    assert float(gait_missed("trot", stations, none, share)) > 0.7


def test_stations_are_ranked_from_the_front_by_side():
    for places in itertools.permutations(PLACES[4]):
        stations = stations_of(places)
        for (ahead, left), (rank, is_left) in zip(places, stations, strict=True):
            assert (rank, is_left) == (int(ahead < 0), left > 0)


def test_a_turn_target_turns_the_heading_goal(body: Creature):
    task = asked(config_of(turn=30.0), body)
    starts = task.trials(key_of(0), body, small_config().rollout)
    goal = task.goal(jax.tree.map(lambda leaf: leaf[0], starts))
    for _ in range(200):
        goal = task.next_goal(goal, None)
    assert float(goal[0]) == pytest.approx(np.radians(30.0), rel=1e-4)


def test_steer_trials_go_straight_once_and_to_both_sides(body: Creature):
    task = asked(config_of(steer=40.0), body)
    rollout = dataclasses.replace(small_config().rollout, starts=5)
    turn = np.degrees(task.trials(key_of(0), body, rollout).goal)
    assert turn[0] == 0.0
    assert np.sign(turn[1:]).tolist() == [1.0, -1.0, 1.0, -1.0]
    assert ((abs(turn[1:]) >= 20.0) & (abs(turn[1:]) <= 40.0)).all()


def test_speeds_and_turns_share_a_program_and_gaits_do_not():
    def shape(**wish) -> object:
        return jax.tree.structure(traced_fitness(config_of(**wish)))

    assert shape(speed=0.3) == shape(speed=1.3)
    assert shape(turn=10.0) == shape(turn=-20.0)
    assert shape(steer=10.0) == shape(steer=20.0)
    for one, other in (
        ({}, {"turn": 10.0}),
        ({"turn": 10.0}, {"steer": 10.0}),
        ({"gait": "trot"}, {"gait": "pace"}),
        ({}, {"height": 0.9}),
    ):
        assert shape(**one) != shape(**other)


def test_experiments_in_one_program_keep_their_own_turn_rates(stool: Creature):
    configs = [small_config(fitness={"wish": {"speed": SPEED, "turn": t}}) for t in (10.0, -30.0)]
    for one, rate in zip(build_batch(stool, configs).experiments, (10.0, -30.0), strict=True):
        np.testing.assert_allclose(np.degrees(one.starts.goal), rate, rtol=1e-6)


def test_turn_and_steer_exclude_each_other():
    with pytest.raises(UserError, match="turn and steer"):
        config_of(turn=10.0, steer=10.0)


@pytest.mark.parametrize(
    ("text", "speed"),
    [("0.4", 0.4), ("0.4m/s", 0.4), ("0.5bl/s", 0.5), (".5 BL/S", 0.5), ("fr0.2", 0.99045)],
)
def test_speed_is_parsed_in_each_unit(body: Creature, text: str, speed: float):
    assert speed_of(text, body) == pytest.approx(speed, rel=1e-4)


@pytest.mark.parametrize("text", ["fast", "0", "-1", "fr0.2bl/s", "0.4km/h", "nan", ""])
def test_an_invalid_speed_is_rejected(body: Creature, text: str):
    with pytest.raises(UserError, match="--speed"):
        speed_of(text, body)


def test_targets_set_fitness_and_controller_settings(body: Creature):
    config = with_targets(Config(), body, WalkTargets(speed="0.25", gait="trot", turn=20.0))
    assert config.fitness.wish.table == {"speed": 0.25, "gait": "trot", "turn": 20.0}
    assert config.controller.interpolation > Config().controller.interpolation
    assert config.controller.mirror
    assert config.controller.steering > Config().controller.steering
    assert not with_targets(Config(), body, WalkTargets(gait="bound")).controller.mirror
    assert with_targets(Config(), body, WalkTargets()) is not None
    assert with_targets(Config(), body, WalkTargets()) == Config()


def test_natural_picks_an_animals_gait_at_this_speed(body: Creature):
    def asked(**targets) -> Config:
        return with_targets(Config(), body, WalkTargets(gait="natural", **targets))

    for speed, gait in (("fr0.1", "walk"), ("fr0.45", "walk"), ("fr0.6", "trot")):
        wish = asked(speed=speed).fitness.wish
        assert wish.gait == gait
        assert [wish.stride, wish.duty_factor, wish.reach, wish.pitch] == [1.0, 1.0, 0.0, 0.0]
    assert asked().fitness.wish.speed is None
    one, five = (altered(body, feet={"names": tuple(map(str, range(n)))}) for n in (1, 5))
    for other in (one, five):
        config = with_targets(Config(), other, WalkTargets(gait="natural"))
        assert config.fitness.wish.gait == "auto"
        assert config.controller == Config().controller


def usually(creature: Creature, file: Path | None = None, **asked) -> Config:
    return configured(creature, file, {}, WalkTargets(**asked))


def natural_dog() -> Creature:
    """A dog with the natural gait as its default."""
    files = load_creature(data_folder("envs") / "tall_quadruped").files
    return creature_of({**files, SETTINGS: files[SETTINGS] + '[usual]\ngait = "natural"\n'})


def test_a_creature_can_set_a_default_gait():
    creature = natural_dog()
    usual, asked = usually(creature), usually(creature, gait="natural")
    wish = dataclasses.replace(usual.fitness.wish, binding=True)
    assert asked == dataclasses.replace(
        usual, fitness=dataclasses.replace(usual.fitness, wish=wish)
    )
    assert wish.stride == 1.0


def test_a_default_gait_guides_the_search_and_is_not_demanded():
    creature = natural_dog()
    assert usually(creature).wish == {}
    assert usually(creature, gait="natural").wish["gait"] == "walk"


@pytest.mark.parametrize("name", shipped_creatures())
def test_no_shipped_creature_has_a_default_gait(name: str):
    """The search starts from random poses, as in the thesis; a drawn cycle must be requested."""
    creature = load_creature(data_folder("envs") / name)
    assert creature.settings.usual.gait == "auto"


def test_any_target_or_settings_file_replaces_the_default_gait(tmp_path: Path):
    creature = natural_dog()
    (tmp_path / "mine.toml").write_text("[evolution]\npopulation = 40\n")
    nothing = Config().fitness.wish
    assert usually(creature, gait="auto").fitness.wish == nothing
    assert usually(creature, tmp_path / "mine.toml").fitness.wish == nothing
    assert usually(creature, Path("wilson")).fitness.wish == nothing
    assert usually(creature, style="calm").fitness.wish.stride is None
    assert usually(facing(creature, "back")).fitness.wish == nothing


def test_an_unknown_default_gait_is_reported_with_its_file(stool: Creature):
    odd = creature_of(
        {**stool.files, SETTINGS: stool.files[SETTINGS] + '[usual]\ngait = "waddle"\n'}
    )
    with pytest.raises(UserError, match=r"stool/creature\.toml: \[usual\]: .*waddle"):
        usually(odd)


def test_natural_starts_from_a_drawn_cycle_at_an_animals_period(body: Creature):
    slow, fast = (
        with_targets(Config(), body, WalkTargets(gait="natural", speed=speed)).controller
        for speed in ("0.2", "1.0")
    )
    assert slow.advance == fast.advance == "clock"
    assert len(slow.around) == slow.key_poses * len(body.joints.names)
    hip = body.frame.hip_height
    for config, speed in ((slow, 0.2), (fast, 1.0)):
        low, high = config.tuning.period
        assert low < animal_stride(speed, hip) / speed < high
        poses = config.key_poses * (1 + body.mirror.symmetric)
        positions = poses * config.interpolation
        assert high <= positions * body.model.opt.timestep < high + poses * body.model.opt.timestep
    assert with_targets(Config(), body, WalkTargets(speed="0.2")).controller.around == slow.around
    # A controller without poses has no poses to start from.
    other = dataclasses.replace(Config(), use=UseConfig("program", "walk"))
    natural = with_targets(other, body, WalkTargets(gait="natural"))
    assert natural.controller == other.controller
    assert natural.evolution == other.evolution


@pytest.mark.parametrize("wish", [{"gait": "natural"}, {"gait": "canter"}, {"speed": "0.4"}])
def test_a_gait_or_speed_target_keeps_the_pose_order(body: Creature, wish: dict):
    default = resolve_config({}, "x")
    assert (default.evolution.crossing, default.evolution.mutation) == ("mixed", "mixed")
    found = with_targets(default, body, WalkTargets(**wish)).evolution
    assert (found.crossing, found.mutation) == ("align", "gaussian")
    assert not found.forced.enabled
    assert with_targets(default, body, WalkTargets(turn=20.0)).evolution == default.evolution


def test_a_named_gait_starts_with_its_own_footfalls(body: Creature):
    def drawn(name: str) -> tuple[float, ...]:
        return with_targets(Config(), body, WalkTargets(gait=name)).controller.around

    cycles = {name: drawn(name) for name in ("walk", "amble", "trot", "pace")}
    assert len(set(cycles.values())) == 4
    assert () not in cycles.values()
    # Where the halves are no mirror images the whole cycle is drawn.
    whole = {name: drawn(name) for name in ("canter", "bound", "hop")}
    assert len(set(whole.values())) == 3
    assert {len(poses) for poses in whole.values()} == {2 * len(cycles["walk"])}
    assert drawn("gallop") == ()
    assert with_targets(Config(), body, WalkTargets(turn=20.0)).controller.around == ()


@pytest.mark.parametrize(("name", "together"), [("bound", True), ("hop", True), ("canter", False)])
def test_in_a_gait_of_pairs_left_and_right_move_together(body: Creature, name: str, together: bool):
    config = with_targets(Config(), body, WalkTargets(gait=name)).controller
    assert (config.mirror, config.in_phase) == (False, together)
    poses = np.array(config.around).reshape(config.key_poses, -1)
    assert np.allclose(poses, body.mirror.image(poses), atol=1e-4) == together


@pytest.mark.parametrize("name", [name for name, gait in GAITS[4].items() if gait.drawn])
def test_a_drawn_gait_gets_its_own_label(dog_sizes, name: str):
    """The label certification gives to the feet that stand in each pose of the cycle."""
    body = load_creature(data_folder("envs") / "short_quadruped")
    config = with_targets(Config(), body, WalkTargets(gait=name)).controller
    poses = np.array(config.around).reshape(config.key_poses, -1)
    cycle = np.concatenate([poses, body.mirror.image(poses)]) if config.mirror else poses
    fine = np.array(
        [
            np.interp(np.arange(64) / 8, np.arange(9), np.append(column, column[0]))
            for column in cycle.T
        ]
    ).T
    data = mujoco.MjData(body.model)
    heights = []
    for pose in fine:
        data.qpos[:] = body.stand_qpos
        data.qpos[body.joints.qpos_adr] = pose
        mujoco.mj_kinematics(body.model, data)
        heights.append(data.geom_xpos[list(body.feet.stepping), 2].copy())
    stands = np.array(heights) < np.min(heights, axis=0) + 0.01
    angle = np.exp(2j * np.pi * np.arange(64) / 64)
    phases = np.angle((stands * angle[:, None]).sum(0)) / (2 * np.pi)
    size = dataclasses.replace(
        dog_sizes, foot_names=tuple("abcd"), foot_places=tuple(map(tuple, body.feet.places))
    )
    gait = gait_of(name, 4)
    # Feet are near the floor for longer than they stand on it.
    duty = np.clip(stands.mean(0), *gait.duty) - 1e-6
    assert gait_name(size, duty, (phases - phases[0]) % 1.0) in gait.labels


def test_a_low_speed_limit_without_a_target_gives_a_hint(body: Creature):
    def said(**fitness) -> str | None:
        return hint(small_config(fitness=fitness))

    assert "--speed 0.3bl/s" in said(speed=0.3)
    assert [said(), said(speed=0.0), said(speed=0.9)] == [None] * 3
    assert said(speed=0.3, wish={"speed": 0.3}) is None


def test_every_style_changes_the_settings(body: Creature):
    for name in ("calm", "sneaky", "heavy", "proud", "tired", "hurried"):
        assert with_targets(Config(), body, WalkTargets(style=name)) != Config()


def test_a_style_asks_no_trunk_to_be_below_the_floor(body: Creature):
    crawler = load_creature(data_folder("envs") / "alien")  # its belly lies on the floor
    heights = [
        with_targets(Config(), creature, WalkTargets(style="sneaky")).fitness.wish.height
        for creature in (body, crawler)
    ]
    assert heights == [0.85, pytest.approx(1.0, abs=1e-3)]
    bare = copy.copy(crawler.model)
    bare.geom_contype[bare.geom_bodyid == crawler.trunk] = 0
    bare.geom_conaffinity[bare.geom_bodyid == crawler.trunk] = 0
    assert lowest_height(dataclasses.replace(crawler, model=bare)) == 0, "no part of it can lie"


def test_anywhere_trains_on_everything_its_certificate_tests(body: Creature):
    assert with_targets(Config(), body, WalkTargets(certificate="walks")) == Config()
    config = with_targets(Config(), body, WalkTargets(certificate="anywhere"))
    asked, rollout = StressConfig(), config.rollout
    assert config.examination.level == "anywhere"
    assert rollout.slope >= asked.slope
    assert rollout.rough >= asked.bumps
    assert rollout.friction[0] <= asked.friction
    assert rollout.push >= asked.push
    with pytest.raises(UserError, match="it is for walks"):
        check_fit(body, dataclasses.replace(config, use=UseConfig("program", "hop")))


def test_poses_that_are_their_own_image_make_a_whole_cycle(body: Creature):
    """With the mirrored half each pose would come twice."""
    twice = dataclasses.replace(Config().controller, in_phase=True)
    with pytest.raises(UserError, match=r"take --controller\.no-mirror"):
        check_fit(body, dataclasses.replace(Config(), controller=twice))
    whole = dataclasses.replace(twice, mirror=False)
    check_fit(body, dataclasses.replace(Config(), controller=whole))


@pytest.mark.parametrize(
    ("targets", "says"),
    [
        (WalkTargets(certificate="anywere"), 'did you mean "anywhere"'),
        (WalkTargets(gait="tripod"), "a body with 4 feet has no tripod"),
        (WalkTargets(gait="tort"), "no tort"),
        (WalkTargets(style="calmm"), 'did you mean "calm"'),
        (WalkTargets(style="none.toml"), "no such file"),
    ],
)
def test_an_invalid_target_is_rejected(body: Creature, targets: WalkTargets, says: str):
    with pytest.raises(UserError, match=says):
        with_targets(Config(), body, targets)


def test_an_unknown_key_in_a_style_file_is_reported(body: Creature, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[fitness]\nclearence = 0.2\n")
    with pytest.raises(UserError, match=r"mine\.toml.*clearence"):
        with_targets(Config(), body, WalkTargets(style=str(file)))


def test_a_champion_file_keeps_its_targets(stool: Creature, tmp_path):
    poses = np.stack([stool.joints.stand] * 2)
    plain = pose_champion(stool, poses, {})
    champion = dataclasses.replace(plain, wish={"speed": 0.4, "gait": "trot"})
    write_champion(champion, stool, tmp_path / "champion.json")
    again = read_champion(tmp_path / "champion.json", stool)
    assert again.wish == champion.wish
    assert again.fingerprint == champion.fingerprint != plain.fingerprint
