"""Modular bodies that walk, jump or follow a light, through the same run as all creatures."""

import dataclasses
import types
from collections.abc import Callable
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from controllers.sims_brain.made_up import CALM, moment

from mjxgait.api import load_creature
from mjxgait.certification.acceptance import acceptance_of, promising
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.trials import simulate
from mjxgait.config.schema import RolloutConfig
from mjxgait.controllers.sims_brain.reference_body import LIGHT
from mjxgait.creature import Creature
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import EvolutionState
from mjxgait.plugins.registry import build_config
from mjxgait.reference.bodies import VELOCITY_STAGE
from mjxgait.reference.grown import seen_grown
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import nominal_starts
from mjxgait.reference.stepping import ReferenceSimulation
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.modular.base import ModularTask
from mjxgait.tasks.modular.config import JumpConfig, RoamConfig
from mjxgait.tasks.modular.follow import Following, FollowInWater, FollowOnLand, Light
from mjxgait.tasks.modular.jump import LYING, Jump
from mjxgait.tasks.modular.roam import Roam
from mjxgait.tasks.modular.swim import Swim
from mjxgait.tasks.starts import NEVER
from mjxgait.training.experiment import Experiment, build_experiment

TABLE = {
    "use": {"controller": "brain", "task": "follow-on-land"},
    "controller": {"nodes": 3, "parts": 4, "links": 4, "local": 2, "central": 1},
    "evolution": {"population": 60},
    "seed": 1,
    "rollout": {"seconds": 1.6, "starts": 2, "promote": 1.0, "lanes": 20, "joint_noise": 0.1},
    "fitness": {"settle": 0.1, "weights": {"overlap": 0.0, "balance": 0.0}},
}
COUNT = 8


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    """An experiment with small capacities, so that it compiles fast."""
    return build_experiment(load_creature("blocks"), build_config(TABLE, "test"))


@pytest.fixture(scope="module")
def first(experiment: Experiment) -> EvolutionState:
    """The first population, evaluated without a generation step; best first."""
    state, task = experiment.init(), experiment.simulator.task
    stats = jax.jit(experiment.simulate)(state.genomes).stats
    told = jax.jit(jax.vmap(jax.vmap(task.outcome)))(stats)
    outcome = np.stack([np.asarray(told[name]) for name in task.outcomes], axis=-1)
    order = np.argsort(-outcome[:, :, 0].mean(1))
    return dataclasses.replace(
        state,
        key=jnp.zeros(()),
        genomes=jax.tree.map(lambda leaf: np.asarray(leaf)[order], state.genomes),
        outcome=outcome[order],
    )


@pytest.mark.thorough(
    "test_swimming.py evolves bodies of blocks, and other tests here judge walkers"
)
def test_walkers_get_faster(experiment: Experiment):
    step, state, best = experiment.compile(), experiment.place(experiment.init()), []
    for _ in range(4):
        state, metrics = step(state)
        best.append(float(metrics.best))
    assert np.isfinite(best).all()
    assert best == sorted(best)
    assert best[-1] > best[0] > 0


def test_the_reference_simulator_finds_the_same_approach(experiment: Experiment, first):
    """Two implementations of body, brain, ground, light, and the height at the start."""
    mine, ways, elsewhere = first.outcome[:COUNT, 0, 0], [], []
    for rank in range(COUNT):
        champion = experiment.champion(first, {}, rank)
        body = champion.embodied(experiment.creature)
        start = nominal_starts(body, 1)
        behind = dataclasses.replace(start, light=np.array([[-10.0, 0.0, 0.0]]))
        ways.append(nearer(body, simulate(body, champion, start, 1.6, record=1)))
        elsewhere.append(nearer(body, simulate(body, champion, behind, 1.6, record=1)))
    lengths = np.array(ways)
    assert lengths.max() > 0.05
    # A corner that touches one tick earlier changes the path.
    assert np.median(np.abs(mine - lengths) / lengths) < 0.05
    assert (np.abs(lengths - elsewhere) > 0.02).any(), "some go by the light"


def test_both_simulators_move_the_light_at_the_same_time():
    """In the second of two equal starts in water the light ahead jumps to the side after 0.5 s."""
    table = TABLE | {"use": {"controller": "brain", "task": "follow"}, "fitness": {"settle": 0.1}}
    swimmers = build_experiment(load_creature("blocks"), build_config(table, "test"))
    state, step = swimmers.init(), swimmers.simulator.task.step
    starts = jax.tree.map(lambda leaf: np.asarray(leaf)[[0, 0]], swimmers.starts)
    later = np.tile(np.float32([0.0, 10.0, 0.0]), (2, 1))
    lights = Light(starts.goal.place, later, np.array([NEVER, round(0.5 / step)], np.int32))
    starts = dataclasses.replace(starts, goal=lights)
    place = np.asarray(jax.jit(swimmers.simulate)(state.genomes, starts).stats.place)
    elsewhere = place[:, 1] - place[:, 0]
    size = np.linalg.norm(elsewhere, axis=1)
    for rank in np.argsort(-size)[:3]:
        assert size[rank] > 0.01, "the light matters"
        champion = swimmers.champion(state, {}, int(rank))
        body = champion.embodied(swimmers.creature)
        start = dataclasses.replace(
            nominal_starts(body, 2),
            light=np.tile([10.0, 0, 0], (2, 1)),
            moved_light=later,
            light_time=np.array([np.inf, 0.5]),
        )
        middle = simulate(body, champion, start, 1.6, record=2).middle[:, -2]
        assert np.linalg.norm(middle[1] - middle[0] - elsewhere[rank]) < 0.05 * size[rank]


def test_reference_light_direction_is_in_each_blocks_own_axes(experiment: Experiment, first):
    champion = experiment.champion(first, {})
    body, light = champion.embodied(experiment.creature), np.array([3.0, -4.0, 1.0])
    task = acceptance_of("follow-on-land")
    start = dataclasses.replace(
        nominal_starts(body, 3),
        light=np.stack([light, 0 * light, -light]),
        moved_light=np.stack([0 * light, 0 * light, light]),
        light_time=np.array([1.1, np.inf, 0.9]),
    )
    bodies = ReferenceSimulation(
        body, champion, start, 0, task.fall(CertificateConfig()), task
    ).bodies
    bodies.qpos[:, 3:7] = [0.5, -0.5, 0.1, 0.7]
    bodies.batch.forward(stage=VELOCITY_STAGE)
    seen, dark, moved = bodies.light(np.arange(3), np.ones(3))
    assert not dark.any()
    np.testing.assert_array_equal(moved, seen)
    data = mujoco.MjData(body.model)
    data.qpos[:] = bodies.qpos[0]
    mujoco.mj_kinematics(body.model, data)
    for part in range(body.model.nbody - 1):
        block = body.model.geom(f"block{part}").id
        there = bodies.start.place + light - data.geom_xpos[block]
        there = data.geom_xmat[block].reshape(3, 3).T @ there
        np.testing.assert_allclose(seen[part], there / np.linalg.norm(there), atol=1e-9)


def test_only_starts_with_the_same_light_and_bar_are_shared(experiment: Experiment, first):
    """Undisturbed starts are shared only when light and bar agree."""
    champion = experiment.champion(first, {})
    body, task = champion.embodied(experiment.creature), acceptance_of("follow-on-land")
    lights = np.array([[10.0, 0, 0], [0, 10.0, 0], [10.0, 0, 0]])
    start = dataclasses.replace(nominal_starts(body, 3), light=lights)
    stepping = ReferenceSimulation(body, champion, start, 0, task.fall(CertificateConfig()), task)
    leader, waiting = stepping._alike(None)
    assert {leader, *waiting} == {0, 2}
    stepping.starts = dataclasses.replace(
        start, bar=np.array([[1.0, 0.2], [np.inf] * 2, [1.0, 0.3]])
    )
    assert not len(stepping._alike(None)[1]), "nor like who has another bar"


def nearer(body: Creature, outcome: Outcome) -> float:
    """Approach in m to the light ahead, from 0.1 s on; the statistics end before the last step."""
    film = outcome.trajectory
    middle = seen_grown(body, film.qpos[0], film.qvel[0], 0.0).middle[[10, -1], :2]
    apart = np.linalg.norm(middle - [LIGHT, 0.0], axis=1)
    return float(apart[0] - apart[1])


def test_heights_and_positions_are_kept_for_every_frame(experiment: Experiment, first):
    """Also without a recording. In weak gravity (0.5 m/s²) every body leaps."""
    highest = []
    for rank in range(4):
        champion = dataclasses.replace(experiment.champion(first, {}, rank), task="jump")
        body = champion.embodied(experiment.creature)
        body.model.opt.gravity[2] = -0.5
        outcome = simulate(body, champion, nominal_starts(body, 2), 4.0, record=1)
        film = outcome.trajectory
        seen = seen_grown(body, film.qpos[0], film.qvel[0], 0.0)
        # A frame is recorded before the step; these values follow it.
        np.testing.assert_allclose(outcome.low[0, :-1], seen.low[1:], atol=1e-9)
        moved = seen.middle[1:] - body.stand_qpos[:3]
        np.testing.assert_allclose(outcome.middle[0, :-1], moved, atol=1e-9)
        np.testing.assert_array_equal(outcome.low[0], outcome.low[1])
        np.testing.assert_array_equal(outcome.middle[0], outcome.middle[1])
        highest.append(outcome.low[0].max())
    assert max(highest) > 0


@cache
def updating(task: ModularTask) -> Callable[..., Any]:
    """Update of a task's statistics, compiled once."""
    return jax.jit(task.update)


def evaluation(
    task: Roam,
    tilt: float = 0.0,
    sunk: float = 0.0,
    before: float = 0.0,
    hertz: Callable[[float], float] = lambda time: 0.0,
) -> dict[str, float]:
    """Terms at 1 m/s. tilt, sunk: at one moment; before: both, before settling. Angles in deg.

    hertz: swings of one of the joints per second, at each moment.
    """
    settings, update = RoamConfig(settle=0.5), updating(task)
    stats, params, still = task.init(), task.params(settings), np.zeros(3, np.float32)
    for k in range(task.horizon):
        angle = np.radians({10: before, 100: tilt}.get(k, 0.0))
        turned = np.float32(
            [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        )
        own = {
            "com": np.float32([0.0, task.step * k, 0.1 * k]),
            "depth": np.float32({10: before, 100: sunk}.get(k, 0.0)),
        }
        time = task.step * k
        swings = np.float32([np.sin(2 * np.pi * hertz(time) * time), 0, 0])
        sensed = moment(own, trunk_rot=turned, joint_vel=swings)
        stats = update(stats, sensed, still, params, ())
    return {name: float(value) for name, value in task.evaluate(stats, settings).items()}


@pytest.fixture(scope="module")
def task(experiment: Experiment) -> Roam:
    found = experiment.simulator.task
    assert isinstance(found, FollowOnLand)
    return Roam(found.creature, found.step, found.horizon, found.ends)


def test_motion_counts_only_after_settling(task: Roam):
    calm = evaluation(task, before=90.0)
    # The last moment is the one before the end.
    assert calm["speed"] == pytest.approx(1.0, rel=0.02)
    assert calm["overlap"] == calm["balance"] == pytest.approx(0, abs=1e-6)


def test_tipping_over_costs_speed(task: Roam):
    leaning, over = (evaluation(task, tilt=tilt) for tilt in (RoamConfig().tilt, 180.0))
    assert leaning["balance"] == pytest.approx(leaning["speed"] / 2, rel=1e-3)
    assert over["balance"] > 0.9 * over["speed"]
    assert leaning["overlap"] == 0


@pytest.mark.parametrize("kind", [Roam, Swim])
@pytest.mark.parametrize("turn", [0.0, 90.0, 150.0, 240.0])
def test_a_way_in_a_curve_costs_what_twice_its_length_would_lose(
    task: Roam, kind: type[Roam | Swim], turn: float
):
    """On a circle: turned by so many degrees in the time that counts, at 1 m/s."""
    own = kind(task.creature, task.step, task.horizon, task.ends)
    settings, still = own.Settings(settle=0.5, apart=0.0), np.zeros(3, np.float32)
    stats, params, update = own.init(), own.params(settings), updating(own)
    begin = int(params)
    rate = np.radians(turn) / (own.horizon - 1 - begin)
    place = np.zeros(3)
    for k in range(own.horizon):
        stats = update(stats, moment({"com": np.float32(place)}), still, params, ())
        angle = rate * (k + 0.5 - begin)
        if k >= begin:
            place = place + own.step * np.array([np.cos(angle), np.sin(angle), 0.0])
    found = {name: float(value) for name, value in own.evaluate(stats, settings).items()}
    kept = max(np.cos(np.radians(turn) / 2), 0.0)
    assert found["curve"] == pytest.approx((1 - kept) * found["speed"], abs=0.02)


def test_joints_that_vibrate_cost_speed(task: Roam):
    half = np.arcsin(RoamConfig().vibration / 2) / (np.pi * task.step)
    swings = evaluation(task, hertz=lambda time: half)
    assert swings["vibration"] == pytest.approx(swings["speed"] / 2, rel=0.05)
    calm, buzzing = (evaluation(task, hertz=lambda time, n=n: n * half) for n in (0.3, 2.0))
    assert calm["vibration"] < 0.01 * calm["speed"]
    assert buzzing["vibration"] > 0.8 * buzzing["speed"]
    early = evaluation(task, hertz=lambda time: 2 * half if time < 0.45 else 0.1 * half)
    assert early["vibration"] < 0.01 * early["speed"]
    tipped = evaluation(task, tilt=180.0, hertz=lambda time: 2 * half)
    assert tipped["balance"] + tipped["vibration"] < tipped["speed"]


def test_jump_height_is_of_the_lowest_part_after_settling(task: Roam):
    jumping = Jump(task.creature, task.step, task.horizon, task.ends)
    settings, still = JumpConfig(settle=0.5), np.zeros(3, np.float32)

    def jumped(sunk: float = 0.0, again: float = 0.0) -> dict[str, float]:
        """0.3 m high in the first half of the counted time, `again` m in the second."""
        stats, params, update = jumping.init(), jumping.params(settings), updating(jumping)
        heights = {10: 0.7, 60: 0.2, 80: 0.3, 120: again, 140: again / 2}
        for k in range(task.horizon):
            low = np.float32([1.0, heights.get(k, 0.0), 1.0, 1.0])
            deep = np.float32(sunk if k == 100 else -1.0)
            sensed = moment({"depth": deep}, geom_low=low)
            stats = update(stats, sensed, still, params, ())
        return {name: float(value) for name, value in jumping.evaluate(stats, settings).items()}

    assert jumped(again=0.3) == pytest.approx({"height": 0.3, "overlap": 0, "wild": 0})
    assert jumped() == pytest.approx({"height": 0.15, "overlap": 0, "wild": 0})
    assert jumped(settings.overlap)["overlap"] == pytest.approx(0.075)
    assert jumped(settings.overlap / 2)["overlap"] < 0.005, "a jumper has to land"
    deep = jumped(10 * settings.overlap)
    assert deep["overlap"] < deep["height"]
    half = dataclasses.replace(
        jumping.init(), heights=jnp.full(jumping.spans, 0.3), steps=jnp.int32(task.horizon // 2)
    )
    assert float(jumping.evaluate(half, settings)["wild"]) == pytest.approx(0.15)


def test_a_body_that_lies_still_for_a_span_ends_its_episode(task: Roam):
    jumping, settings, ends = Jump(task.creature, 0.1, 100, task.ends), JumpConfig(settle=2.0), []
    params, update = jumping.params(settings), jax.jit(jumping.update)
    assert jumping.spans == 4
    for until in (40, 70, 100):
        stats = jumping.init()
        while int(stats.steps) < 100 and not int(stats.reason):
            k = int(stats.steps)
            low = jnp.float32(0.02 if k % 15 == 10 and k < until else 0.005)
            sensed = moment({"depth": jnp.float32(-1.0)}, geom_low=CALM.geom_low.at[:].set(low))
            stats = update(stats, sensed, jnp.zeros(3), params, ())
        ends.append((int(stats.steps), int(stats.reason)))
    assert ends == [(61, LYING), (81, LYING), (100, Reason.FINISHED)]


def test_sinking_into_the_ground_costs_speed(task: Roam):
    touching, deep = (evaluation(task, sunk=sunk) for sunk in (RoamConfig().overlap, 1.0))
    assert touching["overlap"] == pytest.approx(touching["speed"] / 2, rel=1e-3)
    assert deep["overlap"] > 0.99 * deep["speed"]
    both = evaluation(task, tilt=180.0, sunk=1.0)
    assert both["overlap"] + both["balance"] < both["speed"]


def lamp(place: list[float], later: tuple[float, ...] = (0.0,) * 3, steps: int = NEVER) -> Light:
    """A light that moves after so many steps."""
    return Light(jnp.array(place), jnp.array(later), jnp.array(steps))


@pytest.mark.parametrize("follower", [FollowInWater, FollowOnLand])
def test_following_counts_the_approach_to_the_light(task: Roam, follower: type):
    """The body moves 2 m of the 10 m; a step aside gains nothing."""
    following = follower(task.creature, task.step, task.horizon, task.ends)
    settings = following.Settings(settle=0.0)
    for light, way in (([10.0, 0, 0], 2.0), ([-10.0, 0, 0], -2.0), ([0, 10.0, 0], -0.198)):
        stats, params = following.init(), following.params(settings)
        for k in (0, 1):
            sensed = moment({"com": jnp.array([2.0 * k, 0.0, 0.0])})
            stats = following.update(stats, sensed, jnp.zeros(3), params, lamp(light))
        assert float(following.way(stats)) == pytest.approx(way, abs=1e-3)
        evaluation = following.evaluate(
            dataclasses.replace(stats, overlap=jnp.float32(1.0)), settings
        )
        assert (evaluation["overlap"] > 0) == (way > 0), "nothing is gained by blocks in each other"


def test_the_way_to_a_light_that_moves_is_the_sum_of_both(task: Roam):
    """One step of 2 m towards the first light, then three of 1 m away from it, to the second.

    That it turns costs nothing.
    """
    following = FollowInWater(task.creature, task.step, task.horizon, task.ends)
    settings = following.Settings(settle=task.step)
    stats, params = following.init(), following.params(settings)
    light, seen = lamp([10.0, 0, 0], (-10.0, 0, 0), 3), []
    for place in (-5.0, 0.0, 2.0, 1.0, 0.0, -1.0):
        sensed = moment({"com": jnp.array([place, 0.0, 0.0])})
        stats = following.update(stats, sensed, jnp.zeros(3), params, light)
        light = following.next_goal(light, sensed)
        seen.append(float(following.way(stats)))
    assert seen == pytest.approx([0.0, 0.0, 2.0, 3.0, 4.0, 5.0], abs=1e-5)
    assert float(Swim.curved(following, stats)) > 0.5
    assert float(following.evaluate(stats, settings)["curve"]) == 0


def lights_of(following: Following, rollout: RolloutConfig) -> Light:
    """Lights of all trials, drawn by one program."""
    creature = load_creature("blocks")
    return jax.device_get(
        jax.jit(lambda key: following.trials(key, creature, rollout).goal)(key_of(0))
    )


@pytest.mark.parametrize(("others", "moved"), [(1, False), (2, True), (3, True)])
def test_lights_change_places_in_all_trials_but_the_first(task: Roam, others: int, moved: bool):
    following = FollowOnLand(task.creature, task.step, task.horizon, task.ends)
    rounds = 20
    rollout = RolloutConfig(starts=1 + others * rounds, variety=rounds)
    still = lights_of(following, rollout)
    assert (still.steps == NEVER).all()
    lights = lights_of(following, dataclasses.replace(rollout, moves=0.5))
    np.testing.assert_array_equal(lights.place, still.place)
    assert lights.steps[0] == NEVER
    assert (lights.steps[1:] == round(0.5 / task.step)).all()
    before, after = (all_[1:].reshape(rounds, others, 3) for all_ in (lights.place, lights.later))
    np.testing.assert_allclose(before.sum(1), after.sum(1), atol=1e-5)
    assert (np.abs(before - after).max(2) > 0.1).all() == moved


@pytest.mark.parametrize("follower", [FollowInWater, FollowOnLand])
@pytest.mark.parametrize("others", [1, 2, 3, 4, 5, 64])
def test_lights_cancel_out_and_change_every_round(task: Roam, follower: type, others: int):
    """Swimming straight ahead gains nothing by luck. No light can be memorized except the first,
    which is ahead.
    """
    following: Following = follower(task.creature, task.step, task.horizon, task.ends)
    rounds = 200
    rollout = RolloutConfig(starts=1 + others * rounds, variety=rounds)
    lights = lights_of(following, rollout).place / LIGHT
    np.testing.assert_allclose(np.linalg.norm(lights, axis=1), 1.0, rtol=1e-5)
    assert lights[0] == pytest.approx([1, 0, 0])
    drawn = lights[1:].reshape(rounds, others, 3)
    np.testing.assert_allclose(lights[0] + drawn.sum(1), np.zeros((rounds, 3)), atol=1e-4)
    if following.axes == 2:
        assert np.abs(drawn[..., 2]).max() < 1e-6
    if others > 2:
        # Evenly to all sides, without repetition.
        assert np.abs(drawn[:, -1, 1:].mean(0)).max() < 0.15
        assert len(np.unique(drawn[:, -1].round(5), axis=0)) > 0.95 * rounds


@pytest.mark.parametrize("follower", [FollowInWater, FollowOnLand])
def test_many_lights_cover_all_directions(task: Roam, follower: type):
    following: Following = follower(task.creature, task.step, task.horizon, task.ends)
    rollout = RolloutConfig(starts=200)
    lights = lights_of(following, rollout).place / LIGHT
    spread = (lights**2).mean(0)
    np.testing.assert_allclose(spread[: following.axes], 1 / following.axes, atol=0.1)


def test_lights_in_water_form_tetrahedra_and_crosses(task: Roam):
    following = FollowInWater(task.creature, task.step, task.horizon, task.ends)
    rollout = RolloutConfig(starts=1 + 3 * 100, variety=100)
    lights = lights_of(following, rollout).place / LIGHT
    cosines = [np.sort(np.r_[1, one[:, 0]]) for one in lights[1:].reshape(100, 3, 3)]
    solid, cross = ([-1 / 3] * 3 + [1], [-1, 0, 0, 1])
    solids = sum(bool(np.allclose(found, solid, atol=1e-5)) for found in cosines)
    crosses = sum(bool(np.allclose(found, cross, atol=1e-5)) for found in cosines)
    assert solids + crosses == 100
    assert min(solids, crosses) > 30


def test_validation_requires_approaching_as_many_lights_as_the_certificate():
    acceptance, creature = acceptance_of("follow-on-land"), load_creature("blocks")
    assert acceptance.worth == CertificateConfig().follow.arrive
    outcome = {"way": np.array([2.0, 2.0, 0.9, 2.0]), "seconds": np.full(4, 10.0)}
    assert promising(acceptance, outcome, 10.0, creature)
    slow = {**outcome, "way": np.array([2.0, 0.9, 0.9, 2.0])}
    assert not promising(acceptance, slow, 10.0, creature)


def test_a_promised_speed_counts_from_the_settling_time(task: Roam):
    following = FollowOnLand(task.creature, task.step, task.horizon, task.ends)
    settings, still = following.Settings(settle=0.5), jnp.zeros(3)
    params = following.params(settings)
    stats = following.update(following.init(), CALM, still, params, lamp([1.0] * 3))
    assert float(following.outcome(stats)["since"]) == pytest.approx(0.5, abs=task.step)
    acceptance, config = acceptance_of("follow-on-land"), CertificateConfig()
    for told, since in (({"since": 4.0}, 4.0), ({}, config.warmup)):
        nominal = {"way": 1.2, "seconds": 10.0, **told}
        champion = types.SimpleNamespace(origin={"nominal": nominal})
        assert acceptance.since(champion, config) == since
        assert acceptance.promise(champion, 10.0, config) == pytest.approx(1.2 / (10.0 - since))
