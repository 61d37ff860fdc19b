"""What is asked of a walk: its worth in evolution, its footfalls, and the words for it."""

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
from mjxgait.creature.scale import SETTINGS, facing, load_files
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.plugins import resolve_config
from mjxgait.plugins.fit import check_fit
from mjxgait.tasks.base import in_order, score
from mjxgait.tasks.walk.config import TargetWeights, WalkConfig, Weights
from mjxgait.tasks.walk.fitness import REWARDS, TERMS, terms_under
from mjxgait.tasks.walk.gaits import (
    GAITS,
    animal_stride,
    gait_of,
    placed,
    stations_of,
)
from mjxgait.tasks.walk.stats import EpisodeStats, Footfalls, gait_missed, no_footfalls, stepped
from mjxgait.tasks.walk.targets import (
    WalkTargets,
    configured,
    hint,
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
"""For the whole episode, on all feet."""
DIES = {"steps": 40, "reason": 1, "tilt": 20.0, "touch": 1.0}
MISSES = ("tilt", "wobble", "work", "saturation", "limits", "airborne", "foot_height", "touch")
MISSES += ("foot_speed",)
WHIP = {"foot_speed": 4.0}
"""A weight that is compiled in."""


@pytest.fixture(scope="module")
def body(stool: Creature) -> Creature:
    """Of round measures, with four feet where a dog has them."""
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
    """Fitness of one episode by its statistics, whatever the settings; compiled once."""
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
    """A steady walk of so many m; half of it in half the time."""
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
def test_a_walk_however_bad_beats_none_at_any_weights(
    fitness_of, weights, worth, targets, spoilt, way, steps, left
):
    own = Weights(**(weights | WHIP | {"distance": worth}))
    base = config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0)
    wish = dataclasses.replace(base.wish, weights=TargetWeights(**targets))
    config = traced_fitness(dataclasses.replace(base, weights=own, wish=wish))
    bad = walking(way, steps=steps, reason=1, left=left) | spoilt
    # Beyond rounding: a hundredth of what it earned is left to it at least.
    assert fitness_of(bad, config) > 0.005 * fitness_of(bad, traced_fitness(free_of_cost(own)))
    # Whoever stands gets nothing, whatever is spoilt besides; nor does who falls where he stands.
    assert fitness_of(STANDS, config) == 0.0
    assert fitness_of(DIES | spoilt, config) == 0.0


def free_of_cost(weights: Weights) -> WalkConfig:
    """The same rewards, and nothing that costs."""
    nothing = dict.fromkeys((n for n in TERMS if n not in REWARDS), 0.0)
    free = dict.fromkeys((field.name for field in dataclasses.fields(TargetWeights)), 0.0)
    base = config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0)
    wish = dataclasses.replace(base.wish, weights=TargetWeights(**free))
    return dataclasses.replace(base, weights=dataclasses.replace(weights, **nothing), wish=wish)


def traced_fitness(config: WalkConfig) -> WalkConfig:
    return traced(Config(fitness=config)).fitness


def test_the_speed_is_held_from_both_sides(fitness_of):
    config = traced_fitness(config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0))
    worth = [fitness_of(walking(way), config) for way in (0.5, 1.0, 1.8, 2.0, 2.2, 3.0, 4.0, 8.0)]
    assert np.argmax(worth) == 3
    assert (np.diff(worth[:4]) > 0).all()
    assert (np.diff(worth[3:]) < 0).all()


def test_who_lunges_and_falls_is_no_walker(fitness_of):
    """All of the way in an eighth of the time is worth less than half of it on the feet."""
    config = traced_fitness(config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0))
    lunge = walking(2.0, steps=125, reason=1, forward_half=2.0, contact=[75.0] * 4)
    assert fitness_of(lunge, config) < fitness_of(walking(1.0), config)


@pytest.mark.parametrize("name", MISSES)
def test_less_of_a_penalty_is_better(fitness_of, name: str):
    config = traced_fitness(config_of(WHIP, gait="trot", height=0.9, bounce=0.02, sway=6.0))
    worth = [fitness_of(walking() | {name: value}, config) for value in (200.0, 400.0, 800.0)]
    assert worth[0] > worth[1] > worth[2]


def test_posture_is_held_from_both_sides(body: Creature, fitness_of):
    config = traced_fitness(config_of(gait="trot", height=0.9, bounce=0.02, sway=6.0))

    def carried(height: float, bounce: float) -> float:
        mean = height * float(body.frame.stand_height)
        square = mean**2 + (bounce * body.frame.hip_height) ** 2
        return fitness_of(walking(height=1000 * mean, height_squared=1000 * square), config)

    assert carried(0.9, 0.02) > max(carried(0.8, 0.02), carried(1.0, 0.02))
    assert carried(0.9, 0.02) > max(carried(0.9, 0.0), carried(0.9, 0.06))
    rolls = [walking(roll_squared=1000 * np.radians(deg) ** 2) for deg in (0.0, 6.0, 12.0)]
    worth = [fitness_of(rolling, config) for rolling in rolls]
    assert worth[1] > max(worth[0], worth[2])


def test_without_a_wish_nothing_is_looked_at(body: Creature):
    free = small_config().fitness
    task = Walk.with_settings(body, STEP, HORIZON, body.settings.termination, free)
    assert type(task) is Walk
    assert task.terms == terms_under(free.weights)
    assert type(task.init()) is EpisodeStats
    asks = traced_fitness(config_of()).wish
    assert len(jax.tree.leaves(asks)) == len(jax.tree.leaves(traced_fitness(free).wish)) + 1


def footfalls_of(phases: list[float], duty: float, period: int = 160) -> Footfalls:
    """Of feet that stand for `duty` of the cycle about these phases, 12 cycles long."""
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


BLANK = EpisodeStats(
    **{
        field.name: jnp.zeros((), jnp.int32 if field.name == "steps" else None)
        for field in dataclasses.fields(EpisodeStats)
    }
)
PLACES = {
    2: [(0.0, 0.1), (0.0, -0.1)],
    4: [(0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1)],
    6: [(x, y) for x in (0.2, 0.0, -0.2) for y in (0.3, -0.3)],
}
WAYS = [
    (feet, name, way)
    for feet, table in GAITS.items()
    for name, gait in table.items()
    for way in range(len(gait.ways))
]


def made_up(feet: int, name: str, way: int) -> tuple[list[float], float]:
    """Phases by foot and the duty factor of a gait in the middle of its range."""
    gait = gait_of(name, feet)
    low, high = gait.duty
    return placed(gait, stations_of(PLACES[feet]))[way], min(max(0.45, low + 0.1), high - 0.1)


@pytest.mark.parametrize(("feet", "name", "way"), WAYS)
def test_what_is_asked_for_is_what_the_examiner_calls_so(dog_sizes, feet: int, name: str, way: int):
    phases, duty = made_up(feet, name, way)
    size = dataclasses.replace(
        dog_sizes, foot_names=tuple("abcdef"[:feet]), foot_places=tuple(PLACES[feet])
    )
    label = gait_name(size, np.full(feet, duty), np.array(phases) % 1.0)
    assert label in gait_of(name, feet).labels


@pytest.fixture(scope="module")
def dog_sizes():
    from certify_made_up import DOG

    return DOG


def test_a_stance_is_where_it_presses():
    """Hind feet that come down late, but are low for as long before: their phase is that of their
    contact.
    """
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
def test_footfalls_miss_other_gaits_more_than_their_own(feet: int, name: str, way: int):
    phases, duty = made_up(feet, name, way)
    falls, stations = footfalls_of(phases, duty), stations_of(PLACES[feet])
    share = jnp.full(feet, duty)
    missed = {other: float(gait_missed(other, stations, falls, share)) for other in GAITS[feet]}
    assert missed[name] < 0.05
    apart = set(gait_of(name, feet).labels)
    for other, by in missed.items():
        if not apart & set(gait_of(other, feet).labels):
            assert by > 0.2, other


def test_a_foot_that_never_swings_misses_every_gait():
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


def test_stations_are_by_side_and_from_the_front():
    for places in itertools.permutations(PLACES[4]):
        stations = stations_of(places)
        for (ahead, left), (rank, is_left) in zip(places, stations, strict=True):
            assert (rank, is_left) == (int(ahead < 0), left > 0)


def test_who_turns_is_told_a_heading_that_turns(body: Creature):
    """And its way is what it goes along that heading."""
    task = asked(config_of(turn=30.0), body)
    starts = task.trials(key_of(0), body, small_config().rollout)
    goal = task.goal(jax.tree.map(lambda leaf: leaf[0], starts))
    for _ in range(200):
        goal = task.next_goal(goal, None)
    assert float(goal[0]) == pytest.approx(np.radians(30.0), rel=1e-4)


def test_who_is_steered_goes_straight_once_and_to_both_sides(body: Creature):
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


def test_rows_of_one_program_are_told_to_turn_each_at_its_own_rate(stool: Creature):
    configs = [small_config(fitness={"wish": {"speed": SPEED, "turn": t}}) for t in (10.0, -30.0)]
    for one, rate in zip(build_batch(stool, configs).experiments, (10.0, -30.0), strict=True):
        np.testing.assert_allclose(np.degrees(one.starts.goal), rate, rtol=1e-6)


def test_none_can_be_told_to_turn_and_be_steered():
    with pytest.raises(UserError, match="turn and steer"):
        config_of(turn=10.0, steer=10.0)


@pytest.mark.parametrize(
    ("text", "speed"),
    [("0.4", 0.4), ("0.4m/s", 0.4), ("0.5bl/s", 0.5), (".5 BL/S", 0.5), ("fr0.2", 0.99045)],
)
def test_a_speed_in_words(body: Creature, text: str, speed: float):
    assert speed_of(text, body) == pytest.approx(speed, rel=1e-4)


@pytest.mark.parametrize("text", ["fast", "0", "-1", "fr0.2bl/s", "0.4km/h", "nan", ""])
def test_what_is_no_speed_is_refused(body: Creature, text: str):
    with pytest.raises(UserError, match="--speed"):
        speed_of(text, body)


def test_wishes_are_names_for_settings(body: Creature):
    config = with_targets(Config(), body, WalkTargets(speed="0.25", gait="trot", turn=20.0))
    assert config.fitness.wish.table == {"speed": 0.25, "gait": "trot", "turn": 20.0}
    assert config.controller.interpolation > Config().controller.interpolation
    assert config.controller.mirror
    assert config.controller.steering > Config().controller.steering
    assert not with_targets(Config(), body, WalkTargets(gait="bound")).controller.mirror
    assert with_targets(Config(), body, WalkTargets()) is not None
    assert with_targets(Config(), body, WalkTargets()) == Config()


def test_natural_is_the_gait_of_an_animal_at_this_speed(body: Creature):
    def asked(**targets) -> Config:
        return with_targets(Config(), body, WalkTargets(gait="natural", **targets))

    for speed, gait in (("fr0.1", "walk"), ("fr0.45", "walk"), ("fr0.6", "trot")):
        wish = asked(speed=speed).fitness.wish
        assert wish.gait == gait
        assert [wish.stride, wish.duty_factor, wish.reach, wish.pitch] == [1.0, 1.0, 0.0, 0.0]
    assert asked().fitness.wish.speed is None
    two, eight = (altered(body, feet={"names": tuple(map(str, range(n)))}) for n in (1, 8))
    for other in (two, eight):
        config = with_targets(Config(), other, WalkTargets(gait="natural"))
        assert config.fitness.wish.gait == "auto"
        assert config.controller == Config().controller


def usually(creature: Creature, file: Path | None = None, **asked) -> Config:
    return configured(creature, file, {}, WalkTargets(**asked))


def natural_dog() -> Creature:
    """A dog that walks as an animal of its size does where nothing is requested."""
    files = load_creature(data_folder("envs") / "tall_quadruped").files
    return load_files({**files, SETTINGS: files[SETTINGS] + '[usual]\ngait = "natural"\n'})


def test_a_creature_may_have_a_usual_gait():
    creature = natural_dog()
    assert usually(creature) == usually(creature, gait="natural")
    assert usually(creature).fitness.wish.stride == 1.0


@pytest.mark.parametrize("name", shipped_creatures())
def test_no_shipped_creature_has_a_usual_gait(name: str):
    """Its search begins with random poses, as the thesis has it; a drawn cycle must be requested."""
    creature = load_creature(data_folder("envs") / name)
    assert creature.settings.usual.gait == "auto"


def test_what_is_asked_or_written_in_a_file_is_all_that_is_asked(tmp_path: Path):
    creature = natural_dog()
    (tmp_path / "mine.toml").write_text("[evolution]\npopulation = 40\n")
    nothing = Config().fitness.wish
    assert usually(creature, gait="auto").fitness.wish == nothing
    assert usually(creature, tmp_path / "mine.toml").fitness.wish == nothing
    assert usually(creature, Path("wilson")).fitness.wish == nothing
    assert usually(creature, style="calm").fitness.wish.stride is None
    assert usually(facing(creature, "back")).fitness.wish == nothing


def test_a_usual_gait_that_it_does_not_have_is_named(stool: Creature):
    odd = load_files(
        {**stool.files, SETTINGS: stool.files[SETTINGS] + '[usual]\ngait = "waddle"\n'}
    )
    with pytest.raises(UserError, match=r"stool/creature\.toml: \[usual\]: .*waddle"):
        usually(odd)


def test_natural_begins_with_a_drawn_cycle_in_an_animals_time(body: Creature):
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
    assert with_targets(Config(), body, WalkTargets(speed="0.2")).controller.around == slow.around
    # A controller without poses has nothing to begin near.
    other = dataclasses.replace(Config(), use=UseConfig("program", "walk"))
    natural = with_targets(other, body, WalkTargets(gait="natural"))
    assert natural.controller == other.controller
    assert natural.evolution == other.evolution


@pytest.mark.parametrize("wish", [{"gait": "natural"}, {"gait": "canter"}, {"speed": "0.4"}])
def test_a_requested_gait_or_speed_keeps_the_order_of_the_poses(body: Creature, wish: dict):
    default = resolve_config({}, "x")
    assert (default.evolution.crossing, default.evolution.mutation) == ("mixed", "mixed")
    found = with_targets(default, body, WalkTargets(**wish)).evolution
    assert (found.crossing, found.mutation) == ("align", "gaussian")
    assert not found.forced.enabled
    assert with_targets(default, body, WalkTargets(turn=20.0)).evolution == default.evolution


def test_a_gait_by_name_begins_with_its_own_footfalls(body: Creature):
    def drawn(name: str) -> tuple[float, ...]:
        return with_targets(Config(), body, WalkTargets(gait=name)).controller.around

    cycles = {name: drawn(name) for name in ("walk", "amble", "trot", "pace")}
    assert len(set(cycles.values())) == 4
    assert () not in cycles.values()
    # Of those whose halves do not mirror each other none is drawn.
    assert [drawn(name) for name in ("canter", "bound", "gallop")] == [()] * 3
    assert with_targets(Config(), body, WalkTargets(turn=20.0)).controller.around == ()


@pytest.mark.parametrize("name", ["walk", "amble", "trot", "pace"])
def test_a_drawn_gait_is_what_its_name_says(dog_sizes, name: str):
    """By the examiner, from which feet stand in each pose of the cycle."""
    body = load_creature(data_folder("envs") / "short_quadruped")
    config = with_targets(Config(), body, WalkTargets(gait=name)).controller
    half = np.array(config.around).reshape(config.key_poses, -1)
    cycle = np.concatenate([half, body.mirror.image(half)])
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


def test_who_sets_a_low_limit_instead_of_a_wish_is_told(body: Creature):
    def said(**fitness) -> str | None:
        return hint(small_config(fitness=fitness))

    assert "--speed 0.3bl/s" in said(speed=0.3)
    assert [said(), said(speed=0.0), said(speed=0.9)] == [None] * 3
    assert said(speed=0.3, wish={"speed": 0.3}) is None


def test_every_style_is_a_table_of_settings(body: Creature):
    for name in ("calm", "sneaky", "heavy", "proud", "tired", "hurried"):
        assert with_targets(Config(), body, WalkTargets(style=name)) != Config()


def test_to_walk_anywhere_is_learnt_on_all_that_it_is_asked_for(body: Creature):
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
def test_what_means_nothing_is_refused(body: Creature, targets: WalkTargets, says: str):
    with pytest.raises(UserError, match=says):
        with_targets(Config(), body, targets)


def test_a_style_file_with_an_unknown_key_is_named(body: Creature, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[fitness]\nclearence = 0.2\n")
    with pytest.raises(UserError, match=r"mine\.toml.*clearence"):
        with_targets(Config(), body, WalkTargets(style=str(file)))


def test_a_champion_remembers_what_was_asked(stool: Creature, tmp_path):
    poses = np.stack([stool.joints.stand] * 2)
    plain = pose_champion(stool, poses, {})
    champion = dataclasses.replace(plain, wish={"speed": 0.4, "gait": "trot"})
    write_champion(champion, stool, tmp_path / "champion.json")
    again = read_champion(tmp_path / "champion.json", stool)
    assert again.wish == champion.wish
    assert again.fingerprint == champion.fingerprint != plain.fingerprint
