"""Every fitness term, computed by hand from made-up statistics; weights, score and ramps."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import altered, small_config, weight_vector

from mjxgait.creature import Creature
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.terms import hardness, ramped, score
from mjxgait.tasks.walk.config import WalkConfig, Weights
from mjxgait.tasks.walk.fitness import (
    REWARDS,
    TERMS,
    fitness_terms,
    terms_under,
)
from mjxgait.tasks.walk.stats import StatsRecorder
from mjxgait.tasks.walk.task import Walk
from mjxgait.types import Sensed

STEP, HORIZON = 0.005, 1000
LIVED = {"steps": 1000, "forward": 2.0}
"""A whole episode of 5 s; a body of 1 m moves 2 m forward."""

CASES: list[tuple[str, float, dict]] = [
    ("distance", 2.0, {}),
    ("distance", -1.0, {"forward": -1.0}),
    ("alive", 1.0, {}),
    ("alive", 0.25, {"steps": 250}),
    ("drift", 0.3 + np.sin(0.5), {"left": -0.3, "heading": -1.0}),
    ("drift", 0.3 + np.sin(0.5), {"left": 0.3, "heading": 1.0}),
    ("fade", 0.8, {"forward_half": 1.4}),
    ("fade", 0.0, {"forward_half": 0.6}),
    ("slip", 0.25, {"slip": [0.1, 0.5, 0.2, 0.3]}),
    ("slip", 2.0, {"slip": [0.1, 0.5, 0.2, 0.3], "forward": 0.1}),
    ("clearance", 0.3, {"swings": [4.0] * 4, "shortfall": [1.2] * 4}),
    # A foot that swings once while the others swing four times is down in three of four strides.
    ("clearance", 0.75 / 4, {"swings": [4.0, 4.0, 1.0, 4.0]}),
    # A foot that swings more often than the others counts by its own swings.
    ("clearance", 0.5 / 4, {"swings": [4.0, 4.0, 8.0, 4.0], "shortfall": [0.0, 0.0, 4.0, 0.0]}),
    ("clearance", 1.0, {"swings": [0.0, 9.0, 0.0, 0.0]}),
    # 6 and 8 Hz against 0.7 of 1.2 * 4.48 * 20^-0.14 = 3.5344 Hz
    ("frequency", 6 / 3.5344 - 0.7, {"swings": [30.0] * 4}),
    ("frequency", 8 / 3.5344 - 0.7, {"swings": [80.0, 0.0, 80.0, 0.0]}),
    ("frequency", 0.0, {"swings": [12.0] * 4}),
    ("duty", 0.5, {"contact": [900.0, 500, 500, 500]}),
    ("duty", 0.75, {"contact": [500.0, 100, 500, 800]}),
    ("airborne", 0.15, {"airborne": 150.0}),
    # One touchdown at the start, one after each swing, and three too many of one foot.
    ("patter", 0.75 / 4.75 / 4, {"swings": [4.0] * 4, "touchdowns": [5.0, 5, 8, 5]}),
    ("patter", 0.0, {"swings": [4.0] * 4, "touchdowns": [5.0, 4, 5, 0]}),
    ("foot_height", 0.15, {"foot_height": 200.0}),
    ("foot_height", 0.0, {"foot_height": 100.0}),
    ("tilt", 0.12, {"tilt": 120.0}),
    ("tilt", 0.24, {"tilt": 120.0, "steps": 500}),
    ("wobble", 3.0, {"wobble": 9000.0}),
    ("touch", 0.04, {"touch": 40.0}),
    ("energy", 2.0, {"work": 2.0 * 20 * 9.81 * 2}),
    ("energy", 16.0, {"work": 2.0 * 20 * 9.81 * 2, "forward": -3.0}),
    ("saturation", 0.3, {"saturation": 300.0}),
    ("limits", 0.07, {"limits": 70.0}),
    # 0.05 hip heights beyond the 0.005 allowed for parts that only touch
    ("overlap", 0.5, {"overlap": 0.055 * 0.5}),
    ("overlap", 0.0, {"overlap": 0.004 * 0.5}),
    ("fall", 1.0, {"reason": int(Reason.TIPPED)}),
    # √(g·h) is 2.2147 m/s
    ("foot_speed", 0.75, {"foot_speed": 3.0 * 2.21472}),
    ("foot_speed", 0.0, {"foot_speed": 2.2 * 2.21472}),
]


@pytest.fixture(scope="module")
def body(stool: Creature) -> Creature:
    """A body with round measures."""
    return altered(stool, frame={"body_length": 1.0, "hip_height": 0.5, "mass": 20.0})


def terms_of(body: Creature, stats: dict, **fitness: float) -> dict[str, float]:
    config = small_config(fitness={"speed": 0.0, **fitness}).fitness
    arrays = {name: jnp.asarray(value) for name, value in (LIVED | stats).items()}
    filled = dataclasses.replace(StatsRecorder(body, STEP, HORIZON // 2).init(), **arrays)
    terms = fitness_terms(body, config, STEP, HORIZON, filled)
    return {name: float(value) for name, value in terms.items()}


def at_rest(body: Creature, low: jax.Array) -> Sensed:
    """One moment of standing still; the watched shapes are `low` [G] above the floor."""
    joints, still = jnp.zeros(len(body.joints.names)), jnp.zeros(3)
    return Sensed(
        joint_pos=joints,
        joint_vel=joints,
        bias=joints,
        trunk_pos=still,
        trunk_rot=jnp.eye(3),
        trunk_vel=still,
        trunk_angvel=still,
        geom_pos=jnp.zeros((len(low), 3)),
        geom_low=low,
    )


IDS = [f"{name} of {' and '.join(stats) or 'a whole walk'}" for name, _, stats in CASES]


@pytest.mark.parametrize(("name", "value", "stats"), CASES, ids=IDS)
def test_terms_match_hand_computed_values(body: Creature, name: str, value: float, stats: dict):
    assert terms_of(body, stats)[name] == pytest.approx(value, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("name", TERMS)
def test_every_term_has_a_nonzero_case(name: str):
    assert any(term == name and value for term, value, _ in CASES), (
        f'"{name}" is a fitness term that nothing computes by hand: add a row to CASES'
    )


def test_statistics_of_one_term_change_no_other_penalty(body: Creature):
    shared = {"distance", "alive", "fade", "clearance", "duty"}
    for name, _, stats in CASES:
        if set(stats) & {"steps", "forward"}:
            continue
        plain, changed = terms_of(body, {}), terms_of(body, stats)
        differ = {term for term in TERMS if changed[term] != pytest.approx(plain[term])}
        assert differ <= {name} | shared, name


def test_style_penalties_scale_with_the_share_of_the_target(body: Creature):
    """2 m are four ninths of 5 s at 0.9 body lengths/s; distance and foot height do not scale."""
    stats = {"tilt": 120.0, "foot_height": 200.0, "airborne": 150.0}
    terms = terms_of(body, stats, speed=0.9)
    assert terms["tilt"] == pytest.approx(0.12 * 4 / 9, rel=1e-4)
    assert terms["airborne"] == pytest.approx(0.15 * 4 / 9, rel=1e-4)
    assert terms["foot_height"] == pytest.approx(0.15, rel=1e-4)
    assert terms["distance"] == pytest.approx(2.0)


def test_with_leniency_they_scale_with_that_share_squared(body: Creature):
    """A short walk costs less, and one over the whole distance the same."""
    half = terms_of(body, {"tilt": 120.0}, speed=0.9, leniency=0.5)["tilt"]
    lenient = terms_of(body, {"tilt": 120.0}, speed=0.9, leniency=1.0)
    assert half == pytest.approx(0.12 * (4 / 9 + 16 / 81) / 2, rel=1e-4)
    assert lenient["tilt"] == pytest.approx(0.12 * 16 / 81, rel=1e-4)
    assert lenient["distance"] == pytest.approx(2.0)
    whole = {"tilt": 120.0, "forward": 4.5}
    assert terms_of(body, whole, speed=0.9, leniency=1.0) == terms_of(body, whole, speed=0.9)


@pytest.mark.parametrize(("forward", "counts"), [(0.0, 0.25), (2.0, 0.25 + 0.75 * 4 / 9), (9.0, 1)])
def test_alive_reward_grows_with_the_distance_walked(body, forward, counts):
    """The target distance is 4.5 m. Standing still must not score higher than walking."""
    stats = {"steps": 500, "forward": forward}
    assert terms_of(body, stats, speed=0.9)["alive"] == pytest.approx(0.5 * counts, rel=1e-4)


def test_each_weight_has_the_place_and_sign_of_its_term():
    weights = {name: 1.0 + 0.5 * place for place, name in enumerate(TERMS)}
    vector = weight_vector(small_config(fitness={"weights": weights}).fitness, jnp.int32(0))
    expected = [weights[name] if name in REWARDS else -weights[name] for name in TERMS]
    assert np.allclose(vector, expected)
    assert {"distance", "alive"} == set(REWARDS)


def test_foot_speed_is_a_term_only_with_a_weight():
    """Runs from before this term existed can continue."""
    assert terms_under(Weights()) == tuple(name for name in TERMS if name != "foot_speed")
    assert terms_under(Weights(foot_speed=4.0)) == TERMS


def test_a_task_follows_its_settings(body: Creature):
    """The weights choose the terms; `contact` sets the height below which a foot is down."""
    for contact, whip, down in ((0.002, 0.0, 1.0), (0.0, 4.0, 0.0)):
        settings = WalkConfig(contact=contact, weights=Weights(foot_speed=whip))
        task = Walk.with_settings(body, STEP, HORIZON, body.settings.termination, settings)
        assert ("foot_speed" in task.terms) == bool(whip)
        touching = jnp.full(len(body.feet.watched), 0.001)
        stats = task.update(
            task.init(), at_rest(body, touching), jnp.zeros(len(body.joints.names)), 0.1, ()
        )
        assert np.all(stats.contact == down)


def test_score_combines_the_weighted_sums_of_the_trials():
    terms, weights = jnp.array([[1.0, 2.0], [3.0, 0.5]]), jnp.array([2.0, -1.0])
    assert float(score(terms, weights, 0.0)) == pytest.approx((0.0 + 5.5) / 2)
    assert float(score(terms, weights, 0.25)) == pytest.approx(0.75 * 2.75)
    assert np.isneginf(score(terms.at[0, 0].set(jnp.nan), weights, 0.5))


def test_caution_lowers_uneven_scores_of_few_trials():
    """The mean loses more with more spread between trials and with fewer trials."""
    weights, even, uneven = jnp.ones(1), jnp.array([[2.0], [2.0]]), jnp.array([[1.0], [3.0]])
    often = jnp.tile(uneven, (2, 1))
    plain = [float(score(each, weights, 0.0)) for each in (even, uneven, often)]
    wary = [float(score(each, weights, 0.0, caution=2.0)) for each in (even, uneven, often)]
    assert plain == [2.0, 2.0, 2.0]
    assert wary == pytest.approx([2.0, 2.0 - 2 / np.sqrt(2), 2.0 - 2 / np.sqrt(4)])


@pytest.mark.parametrize("steps", [0, 1, 7, 10])
def test_ramps_rise_to_exactly_one(steps: int):
    """Compiled for any length: the value must reach 1 in spite of integer rounding."""
    now = np.arange(20)
    grown = np.asarray(jax.jit(jax.vmap(ramped, (None, 0)))(jnp.int32(steps), jnp.asarray(now)))
    at_level = np.asarray(
        jax.jit(jax.vmap(hardness, (None, 0)))(jnp.int32(steps), jnp.asarray(now))
    )
    rising = now < steps
    np.testing.assert_allclose(grown[rising], now[rising] / max(steps, 1), atol=1e-6)
    np.testing.assert_allclose(at_level[rising], (now[rising] + 1) / (steps + 1), rtol=1e-6)
    assert (grown[~rising] == 1).all()
    assert (at_level[~rising] == 1).all()
