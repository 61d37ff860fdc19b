"""Every measure of every criterion on a made-up walk that violates only this one."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from certify_made_up import DOG, walk
from test_certify_criteria import (
    aimless,
    belly_slider,
    changed,
    creeper,
    dragger,
    drifter,
    flier,
    foot_slider,
    knee_toucher,
    moved,
    rocker,
    stander,
    time_of,
    tripper,
    unsteady,
)

from mjxgait.certification import CertificateConfig, criteria
from mjxgait.certification.criteria import Criterion
from mjxgait.reference.measure import Recording
from mjxgait.tasks.walk import criteria as acceptance

CONFIG = CertificateConfig()
AT = 3000
"""A frame within the window."""
EARLY = 100
"""A frame before the window."""


def leaner() -> Recording:
    """It is down before the window begins; a fall counts from the first moment."""
    good = walk()
    return changed(good, trunk_up=np.where(np.arange(4400) == EARLY, 0.4, good.trunk_up))


def ducker() -> Recording:
    return moved(walk(), up=np.where(np.arange(4400) == AT, 0.15, 0.4))


def leaper() -> Recording:
    return moved(walk(), up=np.where(np.arange(4400) == AT, 0.65, 0.4))


def fader() -> Recording:
    good = walk()
    late = np.maximum(time_of(good) - 12, 0)
    return moved(good, forward=good.trunk_pos[:, 0] - 0.25 * late)


def once(name: str, value: float) -> Callable[[], Recording]:
    """A walk with another value of one array in one frame."""

    def fraud() -> Recording:
        good = walk()
        values = getattr(good, name).copy()
        values[AT] = value
        return changed(good, **{name: values})

    return fraud


def waddler_astray() -> Recording:
    """Its nose is off for three seconds."""
    return changed(walk(), heading=np.radians(np.where(np.arange(4400) // 600 == 3, 30.0, 0.0)))


def chatterer() -> Recording:
    """Every foot loses the floor six times in each stance of 96 frames."""
    good = walk()
    held = np.arange(4400)[:, None] % 14 > 0
    return changed(good, foot_force=np.where(held, good.foot_force, 0.0))


def buzzer() -> Recording:
    """A knee vibrates by 0.01 rad at 28 Hz."""
    good = walk()
    vibrates = np.sin(2 * np.pi * 28 * time_of(good))[:, None] * [0, 1.0, 0, 0]
    return changed(good, joint_vel=good.joint_vel + 2 * np.pi * 28 * 0.01 * vibrates)


def slumper() -> Recording:
    """It leans by 40 degrees in one frame."""
    good = walk()
    leans = np.cos(np.radians(40.0))
    return changed(good, trunk_up=np.where(np.arange(4400) == AT, leans, good.trunk_up))


def limper() -> Recording:
    """One leg swings at 70 % of the others' amplitude."""
    good = walk()
    return changed(good, joint_pos=good.joint_pos * [1, 1, 0.7, 1])


def hopper() -> Recording:
    """One foot stands for a sixth of the stride less than its partner."""
    good = walk()
    short = walk(duty=0.45)
    force = good.foot_force.copy()
    force[:, 3] = short.foot_force[:, 3]
    return changed(good, foot_force=force)


FRAUDS: dict[str, Callable[[], Recording]] = {
    "least upright": leaner,
    "least height": ducker,
    "greatest height": leaper,
    "time on wrong parts": knee_toucher,
    "strides": lambda: walk(period=2.9),
    "shortest stride / mean stride": rocker,
    "speed (body lengths/s)": creeper,
    "drift / distance": drifter,
    "off straight ahead (deg)": waddler_astray,
    "second half / first half": fader,
    "autocorrelation at stride period": aimless,
    "variation of stride period": unsteady,
    "stride frequency / animal's": lambda: walk(period=0.25, speed=0.9),
    "stride length / hip height": tripper,
    "least clearance / hip height": dragger,
    "worst foot's slip / distance": foot_slider,
    "least duty factor": flier,
    "greatest duty factor": stander,
    "flicker of a foot per stride": chatterer,
    "buzz of a joint / joint speed": buzzer,
    "tilt beyond standing (deg)": slumper,
    "left and right amplitudes": limper,
    "left and right duty factors": hopper,
    "joint speed (rad/s)": once("joint_vel", -21.0),
    "joint past its range (rad)": once("joint_pos", -0.95),
    "body speed / sqrt(g h)": once("body_speed", 6.0),
    "penetration / hip height": once("penetration", 0.03),
    "torque / limit": once("torque", -31.0),
}


def evaluation(recording: Recording) -> list[Criterion]:
    """All criteria that one recording decides by itself."""
    window = recording.window(CONFIG.warmup)
    return [
        *acceptance.basic(recording, CONFIG),
        acceptance.gait(window, CONFIG.gait),
        criteria.physics(window, CONFIG.physics),
    ]


def failed(*of: Criterion) -> set[str]:
    return {
        measure.name for criterion in of for measure in criterion.measures if not measure.passed
    }


def test_every_measure_has_its_fraud():
    names = [measure.name for criterion in evaluation(walk()) for measure in criterion.measures]
    assert set(names) == set(FRAUDS)
    assert len(names) == len(set(names))


@pytest.mark.parametrize("name", FRAUDS)
def test_one_measure_fails_alone(name: str):
    assert failed(*evaluation(FRAUDS[name]())) == {name}


def test_a_good_walk_fails_none():
    assert failed(*evaluation(walk())) == set()


def test_a_joint_may_not_pass_either_end_of_its_range():
    assert failed(*evaluation(once("joint_pos", 0.65)())) == {"joint past its range (rad)"}


def test_shares_of_starts_and_pushes():
    for evaluate, least in ((criteria.starts, 0.9), (criteria.pushes, 0.8)):
        assert failed(evaluate(least, CONFIG)) == set()
        assert failed(evaluate(least - 0.01, CONFIG)) == {"share that stays up"}


@pytest.mark.parametrize(
    ("halved", "name"),
    [
        (belly_slider, "failures in criteria 1 to 3"),
        (lambda: walk(speed=0.6), "change of distance"),
        (lambda: walk(speed=1.0), "change of distance"),
    ],
    ids=["another verdict", "shorter", "longer"],
)
def test_half_the_time_step(halved: Callable[[], Recording], name: str):
    assert failed(acceptance.half_step(walk(), halved(), CONFIG)) == {name}
    assert failed(acceptance.half_step(walk(), walk(), CONFIG)) == set()


def test_a_longer_body_is_slower_in_its_own_lengths():
    long = dataclasses.replace(DOG, body_length=2.0)
    assert failed(*evaluation(changed(walk(), dimensions=long))) == {"speed (body lengths/s)"}
