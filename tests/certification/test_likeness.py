"""Likeness of a walk to an animal's, in the certificate and in evolution."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from certify_made_up import DOG, make_champion, walk
from helpers import small_config
from test_certify_wishes import CONFIG, missed

from mjxgait.certification.acceptance import acceptance_of
from mjxgait.certification.describe import in_words, likeness
from mjxgait.certification.trials import simulate
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording, measure
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import nominal_starts
from mjxgait.tasks.walk import fitness as evolution
from mjxgait.tasks.walk.config import LIKENESS
from mjxgait.tasks.walk.gaits import animal_duty, animal_stride
from mjxgait.tasks.walk.task import Walk

STEP, HORIZON = 0.005, 1000
"""5 s."""


def like_an_animal(speed: float = 0.9, stride: float = 1.0, duty: float = 1.0) -> Recording:
    """Walk with these multiples of an animal's stride length and duty factor, feet as at rest."""
    period = stride * animal_stride(speed, DOG.hip_height) / speed
    made = walk(speed=speed, period=period, duty=duty * animal_duty(speed, DOG.hip_height))
    places = np.tile([ahead for ahead, _ in DOG.foot_places], (len(made.trunk_pos), 1))
    return dataclasses.replace(made, foot_ahead=places)


def test_a_walk_like_an_animals_has_full_likeness():
    found = likeness(like_an_animal(), CONFIG.gait.clearance)
    assert found["stride"] == pytest.approx(1.0, rel=0.02)
    assert found["duty_factor"] == pytest.approx(1.0, rel=0.02)
    assert found["reach"] == pytest.approx(0.0, abs=1e-9)
    assert found["pitch"] == pytest.approx(0.0, abs=0.05)


def test_a_foot_that_briefly_loses_the_floor_counts_as_flicker():
    made = like_an_animal()
    assert likeness(made, CONFIG.gait.clearance)["patter"] == 0.0
    # One foot, once in each of its stances.
    begins = np.flatnonzero(np.diff(made.contact[:, 0].astype(int)) > 0) + 1
    force = made.foot_force.copy()
    force[begins[:-1] + 5, 0] = 0.0
    found = likeness(dataclasses.replace(made, foot_force=force), CONFIG.gait.clearance)
    assert found["patter"] == pytest.approx(1 / 4, abs=0.03)


def test_likeness_is_described_in_words():
    report = acceptance_of("walk").report(like_an_animal(stride=0.7, duty=0.8), CONFIG)
    assert "Strides are 0.7" in in_words(report)
    assert "duty factors 0.8" in in_words(report)
    assert "loses the floor" not in in_words(report)
    patters = report["likeness"] | {"patter": 2.34}
    assert "a foot loses the floor for a moment 2.3 times" in in_words({"likeness": patters})
    for nothing in ({}, {"likeness": {"stride": None, "duty_factor": 0.5}}):
        assert in_words(nothing) is None


def test_likeness_is_relative_to_the_speed():
    """Figures of Alexander: strides of 1.5 hip heights, duty factor 0.63 at Froude number 0.25."""
    speed = np.sqrt(0.25 * 9.81 * DOG.hip_height)
    assert animal_stride(speed, DOG.hip_height) / DOG.hip_height == pytest.approx(1.52, abs=0.01)
    assert animal_duty(speed, DOG.hip_height) == pytest.approx(0.631, abs=0.001)
    short = likeness(like_an_animal(0.6, stride=0.7, duty=0.8), CONFIG.gait.clearance)
    assert short["stride"] == pytest.approx(0.7, rel=0.02)
    assert short["duty_factor"] == pytest.approx(0.8, rel=0.03)


def test_reach_counts_the_offset_of_each_foot():
    made = like_an_animal()
    for off in ([0.05] * 4, [0.05, 0.05, -0.05, -0.05]):
        moved = dataclasses.replace(made, foot_ahead=made.foot_ahead + off)
        assert likeness(moved, 0.05)["reach"] == pytest.approx(0.05 / DOG.hip_height)
    # The motion of a foot in the air does not count.
    swings = made.foot_ahead + np.where(made.contact, 0.0, 0.3)
    assert likeness(dataclasses.replace(made, foot_ahead=swings), 0.05)["reach"] < 1e-9


@pytest.mark.parametrize(
    ("name", "asked", "room"),
    [("stride", 1.0, 0.25), ("duty_factor", 1.0, 0.25), ("reach", 0.0, 0.15), ("pitch", 0.0, 8.0)],
)
def test_likeness_targets_have_limits(name: str, asked: float, room: float):
    made = like_an_animal()
    near, far = 0.9 * room, 1.15 * room
    spoilt = {
        "stride": lambda by: like_an_animal(stride=1.0 - by),
        "duty_factor": lambda by: like_an_animal(duty=1.0 - by),
        "reach": lambda by: dataclasses.replace(
            made, foot_ahead=made.foot_ahead + by * DOG.hip_height
        ),
        "pitch": lambda by: dataclasses.replace(made, pitch=made.pitch + np.radians(by)),
    }[name]
    assert missed(spoilt(near), **{name: asked}) == set()
    assert missed(spoilt(far), **{name: asked}) == {f"off the {name} of {asked:g}"}


ANIMAL = {"stride": 1.0, "duty_factor": 1.0, "reach": 0.0, "pitch": 0.0}


@pytest.fixture(scope="module")
def natural(tiny: Creature) -> Walk:
    config = small_config(fitness={"wish": ANIMAL}).fitness
    return Walk.with_settings(tiny, STEP, HORIZON, tiny.settings.termination, config)


def stats_of(task: Walk, speed: float, stride: float = 1.0, duty: float = 1.0, **more):
    """Episode statistics of such a walk after 5 s in evolution."""
    hip = task.creature.frame.hip_height
    swings = HORIZON * STEP * speed / (stride * animal_stride(speed, hip))
    way = speed * HORIZON * STEP
    found = {
        "steps": jnp.int32(HORIZON),
        "forward": jnp.float32(way),
        "forward_half": jnp.float32(way / 2),
        "swings": jnp.full(4, swings),
        "contact": jnp.full(4, HORIZON * duty * animal_duty(speed, hip)),
    }
    arrays = {name: jnp.asarray(value, jnp.float32) for name, value in more.items()}
    return dataclasses.replace(task.init(), **(found | arrays))


@pytest.mark.parametrize("speed", [0.2, 0.5, 1.0])
def test_evolution_finds_full_likeness_at_any_speed(natural: Walk, speed: float):
    found = evolution.likeness(natural.creature, STEP, HORIZON, stats_of(natural, speed))
    np.testing.assert_allclose([found[name] for name in LIKENESS], [1, 1, 0, 0], atol=1e-5)


def test_evolution_and_certificate_measure_the_same_likeness(natural: Walk):
    """They agree on strides, duty factor, places of the feet and pitch."""
    hip = natural.creature.frame.hip_height
    stats = stats_of(natural, 0.5, stride=0.7, duty=0.8)
    stood = 0.1 * hip * stats.contact * jnp.array([1, 1, -1, -1])
    nose_down = HORIZON * np.radians(6.0)
    stats = dataclasses.replace(stats, reach=stood, pitch=jnp.float32(nose_down))
    found = evolution.likeness(natural.creature, STEP, HORIZON, stats)
    np.testing.assert_allclose([found[n] for n in LIKENESS], [0.7, 0.8, 0.1, -6.0], rtol=1e-4)
    made = like_an_animal(stride=0.7, duty=0.8)
    made = dataclasses.replace(
        made,
        foot_ahead=made.foot_ahead + 0.1 * DOG.hip_height * np.array([1, 1, -1, -1]),
        pitch=made.pitch + np.radians(6.0),
    )
    seen = likeness(made, CONFIG.gait.clearance)
    np.testing.assert_allclose([seen[n] for n in LIKENESS], [0.7, 0.8, 0.1, -6.0], rtol=0.03)


@pytest.mark.parametrize(
    "less",
    [{"stride": 0.8}, {"stride": 1.3}, {"duty": 0.8}, {"duty": 1.2}, {"pitch": 100.0}],
    ids=str,
)
def test_unlikeness_to_an_animal_is_penalized(natural: Walk, less: dict):
    config = small_config(fitness={"wish": ANIMAL}).fitness
    like, unlike = (natural.evaluate(stats_of(natural, 0.5, **how), config) for how in ({}, less))
    worse = [n for n in LIKENESS if float(unlike[n]) > float(like[n]) + 0.05]
    assert worse == ["duty_factor" if "duty" in less else next(iter(less))]


def test_likeness_is_finite_without_lifted_feet(natural: Walk):
    config = small_config(fitness={"wish": ANIMAL}).fitness
    drags = stats_of(natural, 0.5, swings=np.zeros(4))
    for stats in (drags, dataclasses.replace(drags, steps=jnp.int32(1)), natural.init()):
        terms = natural.evaluate(stats, config)
        assert all(np.isfinite(float(value)) for value in terms.values())


@pytest.fixture(scope="module")
def standing(tiny: Creature) -> Outcome:
    return simulate(tiny, make_champion(tiny), nominal_starts(tiny, 1), 0.5, record=1)


def test_feet_are_measured_where_they_stand(tiny: Creature, standing: Outcome):
    seen = measure(tiny, standing.trajectory)
    assert seen.foot_ahead is not None
    ahead = [ahead for ahead, _ in seen.dimensions.foot_places]
    np.testing.assert_allclose(seen.foot_ahead[-1], ahead, atol=0.01)
    np.testing.assert_allclose(tiny.feet.places, seen.dimensions.foot_places, atol=1e-9)


def test_feet_are_measured_along_the_nose(tiny: Creature, standing: Outcome):
    """The heading does not matter."""
    film = standing.trajectory
    turned = film.qpos.copy()
    turned[0, :, 3:7] = [0.0, 0.0, 0.0, 1.0]
    about = dataclasses.replace(film, qpos=turned)
    ahead = [ahead for ahead, _ in measure(tiny, film).dimensions.foot_places]
    found = measure(tiny, about).foot_ahead
    assert found is not None
    np.testing.assert_allclose(found[0], ahead, atol=0.01)
