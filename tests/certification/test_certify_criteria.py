"""Every criterion on a made-up walk that must fail only this one."""

import dataclasses

import numpy as np
import pytest
from certify_made_up import DOG, walk

from mjxgait.certification import CertificateConfig, criteria, describe
from mjxgait.certification.certificate import half_point
from mjxgait.certification.criteria import Measure, obstacle
from mjxgait.reference import measure
from mjxgait.tasks.walk import criteria as acceptance

CONFIG = CertificateConfig()


def failures(recording, halved=None, started=1.0, pushed=1.0):
    """Numbers of the failed criteria."""
    window = recording.window(CONFIG.warmup)
    evaluation = (
        *acceptance.basic(recording, CONFIG),
        criteria.starts(started, CONFIG),
        criteria.pushes(pushed, CONFIG),
        acceptance.half_step(recording, halved or recording, CONFIG),
        acceptance.gait(window, CONFIG.gait),
        criteria.physics(window, CONFIG.physics),
        criteria.parts(window, CONFIG.parts),
    )
    assert [c.number for c in evaluation] == list(range(1, 10))
    return {c.number for c in evaluation if not c.passed}


def changed(recording, **arrays):
    return dataclasses.replace(recording, **arrays)


def time_of(recording):
    return np.arange(len(recording.trunk_pos)) * recording.time_step


def moved(recording, forward=None, left=None, up=None):
    pos = recording.trunk_pos.copy()
    for axis, values in enumerate((forward, left, up)):
        if values is not None:
            pos[:, axis] = values
    return changed(recording, trunk_pos=pos)


def test_a_good_walk_passes_all():
    assert failures(walk()) == set()


def jumper():
    good = walk()
    return moved(good, up=0.4 + 0.3 * np.abs(np.sin(np.pi * time_of(good) / 0.8)))


def somersaulter():
    good = walk()
    return changed(good, trunk_up=np.cos(2 * np.pi * time_of(good) / 0.8))


def collapser():
    good = walk()
    return moved(good, up=np.where(time_of(good) > 15, 0.1, 0.4))


def belly_slider():
    return changed(walk(), touch=np.ones(4400, bool))


def knee_toucher():
    good = walk()
    return changed(good, touch=np.arange(4400) == 3000)


@pytest.mark.parametrize("fraud", [jumper, somersaulter, collapser, belly_slider, knee_toucher])
def test_criterion_1_stays_up(fraud):
    assert failures(fraud(), halved=walk()) == {1}
    # Criterion 6 repeats 1 to 3, so it fails too when the fraud is as bad at half the time step.
    assert failures(fraud()) == {1, 6}


def drifter():
    good = walk()
    return moved(good, left=0.4 * good.trunk_pos[:, 0])


def circler():
    good = walk()
    return moved(good, left=6 * np.sin(np.pi * time_of(good) / 22))


def stopper():
    good = walk()
    return moved(
        good,
        forward=np.minimum(good.trunk_pos[:, 0], 0.8 * 12)
        + 0.01 * np.maximum(time_of(good) - 12, 0),
    )


def rocker():
    good = walk()
    # forward in every other stride, back a little in those between
    return moved(
        good, forward=good.trunk_pos[:, 0] + 0.35 * np.sin(np.pi * time_of(good) / 0.8 + np.pi / 2)
    )


def creeper():
    return walk(speed=0.45)


@pytest.mark.parametrize("fraud", [drifter, circler, stopper, rocker, creeper])
def test_criterion_2_progress(fraud):
    assert failures(fraud()) == {2, 6}


def test_criterion_2_few_strides():
    assert failures(walk(period=2.9, speed=0.8)) == {2, 6}


def aimless():
    good = walk()
    rng = np.random.default_rng(0)
    noise = np.cumsum(rng.normal(0, 0.02, (4400, 4)), 0)
    # The same amplitude on the left and on the right.
    noise /= noise[400:].std(0)
    # The noise exceeds the dog's joint ranges, which is not tested here.
    return changed(
        good,
        joint_pos=noise,
        dimensions=dataclasses.replace(DOG, joint_range=((-np.inf, np.inf),) * 4),
    )


def unsteady():
    good = walk()
    # alternately long and short strides; the joints keep their own steady time
    measure = [np.arange(n) / n for _ in range(14) for n in (190, 130)]
    phase = np.concatenate(measure)[:4400, None] + np.full(4, 0.5)
    return changed(good, foot_height=0.05 * np.sin(2 * np.pi * phase))


@pytest.mark.parametrize("fraud", [aimless, unsteady])
def test_criterion_3_periodic(fraud):
    assert failures(fraud(), halved=walk()) == {3}


def test_criteria_4_and_5_shares():
    assert failures(walk(), started=57 / 64) == {4}
    assert failures(walk(), pushed=51 / 64) == {5}
    assert failures(walk(), started=58 / 64, pushed=52 / 64) == set()


def test_criterion_6_half_the_time_step():
    assert failures(walk(), halved=walk(speed=0.6)) == {6}
    assert failures(walk(), halved=walk(speed=1.0)) == {6}
    assert failures(walk(), halved=walk(speed=0.7)) == set()
    assert failures(walk(), halved=belly_slider()) == {6}


def vibrator():
    return walk(period=1 / 6.6, lift=0.02)


def hidden_vibrator():
    """Six swings of every foot while the joints go through one cycle."""
    good = walk()
    phase = (time_of(good)[:, None] / 0.8 * 6 + np.array([0.0, 0.5, 0.5, 0.0])) % 1.0
    return changed(good, foot_height=0.03 * np.sin(2 * np.pi * phase))


def foot_slider():
    good = walk()
    return changed(good, foot_slip=np.where(good.contact, 0.25, 0.0))


def one_foot_slider():
    good = walk()
    return changed(good, foot_slip=np.where(good.contact, [0.3, 0.0, 0.0, 0.0], 0.0))


def dragger():
    good = walk()
    return changed(good, foot_height=good.foot_height * [1, 1, 1, 0.1])


def limper():
    """One foot stays down in one stride."""
    good = walk()
    height = good.foot_height.copy()
    height[1760:1925, 2] = -0.001
    return changed(good, foot_height=height)


def flier():
    return walk(duty=0.12)


def stander():
    good = walk()
    return changed(good, foot_force=np.where(good.contact, good.foot_force, 1.0))


def tripper():
    """Strides of a tenth of a hip height, fast enough only because the body is short."""
    good = walk(period=0.8, speed=0.15)
    return changed(
        good, dimensions=dataclasses.replace(DOG, body_length=0.25), foot_slip=good.foot_slip / 10
    )


@pytest.mark.parametrize(
    "fraud",
    [
        vibrator,
        foot_slider,
        one_foot_slider,
        dragger,
        limper,
        flier,
        stander,
        tripper,
    ],
)
def test_criterion_7_gait(fraud):
    assert failures(fraud()) == {7}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("joint_vel", 21.0),
        ("joint_pos", 0.61),
        ("joint_pos", -0.91),
        ("body_speed", 6.0),
        ("penetration", 0.03),
        ("torque", 31.0),
    ],
)
def test_criterion_8_physics(name, value):
    good = walk()
    values = getattr(good, name).copy()
    values[3000] = value
    assert failures(changed(good, **{name: values})) == {8}


def test_criterion_8_tolerates_a_small_overrun_of_a_joint():
    good = walk()
    joints = good.joint_pos.copy()
    joints[3000, 2], joints[3001, 1] = 0.59, -0.81
    overshooting = changed(good, joint_pos=joints).window(2.0)
    assert criteria.joint_overrun(overshooting).max(0) == pytest.approx([0, 0.01, 0.09, 0])
    assert criteria.physics(overshooting, CONFIG.physics).passed


def test_criterion_8_accepts_joints_without_a_range():
    endless = dataclasses.replace(DOG, joint_range=((-np.inf, np.inf),) * 4)
    assert (
        criteria.joint_overrun(
            changed(walk(), dimensions=endless, joint_pos=np.full((4400, 4), 50.0))
        ).max()
        == 0
    )


def crossing_legs(depth):
    """A shin goes through another in a few frames."""
    overlap = np.zeros((4400, 2))
    overlap[3000:3100, 1] = depth
    return changed(walk(), overlap=overlap)


def test_criterion_9_parts():
    hip_height = DOG.hip_height
    assert failures(crossing_legs(0.03 * hip_height)) == {9}
    assert failures(crossing_legs(0.01 * hip_height)) == set()
    half = criteria.parts(crossing_legs(0.01 * hip_height).window(2.0), CONFIG.parts)
    assert half.margin == pytest.approx(0.5)


@pytest.mark.parametrize(("share", "fails"), [(0.2, set()), (0.3, {9})])
def test_parts_without_a_shape_cannot_pass_unexamined(share: float, fails: set[int]):
    """Nothing of them can be in another part."""
    unseen = changed(walk(), dimensions=dataclasses.replace(DOG, shapeless=share))
    assert failures(unseen) == fails
    _, of_shapes = criteria.parts(unseen.window(2.0), CONFIG.parts).measures
    assert (of_shapes.value, of_shapes.passed) == (share, not fails)


def test_a_diverged_walk_fails_every_criterion_measured_on_it():
    good = walk()
    broken = {
        f.name: np.where(
            time_of(good).reshape(-1, *[1] * (getattr(good, f.name).ndim - 1)) < 12,
            getattr(good, f.name),
            np.nan,
        )
        for f in dataclasses.fields(good)
        if getattr(good, f.name, None) is not None
        and isinstance(getattr(good, f.name), np.ndarray)
        and f.name != "touch"
    }
    assert failures(changed(good, **broken)) >= {1, 2, 3, 6, 7, 8, 9}


def test_no_stride_at_all_fails_without_an_error():
    good = walk()
    assert failures(changed(good, foot_height=np.zeros((4400, 4)))) == {2, 3, 6, 7}


def test_a_walk_backwards_fails():
    assert 2 in failures(walk(speed=-0.8))


def test_margin_is_one_at_best_and_zero_at_the_threshold():
    assert criteria.at_least("speed", 0.5, 0.5).margin == 0
    assert criteria.at_least("speed", 3.0, 0.5).margin == 1
    assert criteria.at_least("share", 0.95, 0.9, 1.0).margin == pytest.approx(0.5)
    assert criteria.at_most("slip", 0.0, 0.15).margin == 1
    assert criteria.at_most("slip", 0.3, 0.15).margin == pytest.approx(-1)
    assert criteria.at_most("touch", 0.0, 0.0).margin == 1
    assert criteria.at_most("touch", 0.1, 0.0).margin < 0
    assert criteria.at_least("speed", np.nan, 0.5).margin == -np.inf
    assert not Measure("nothing", np.nan, "<=", 1.0, 1.0).passed


def test_strides_are_footfalls_not_joint_cycles():
    assert {3, 7} <= failures(hidden_vibrator())
    hidden, window = hidden_vibrator().window(2.0), walk().window(2.0)
    assert measure.stride_frequency(window, 0.03) == pytest.approx(1 / 0.8, rel=0.01)
    assert measure.stride_frequency(hidden, 0.03) == pytest.approx(6 / 0.8, rel=0.02)


def test_strides_come_from_the_steadiest_foot():
    good = walk().window(2.0)
    assert set(np.diff(measure.stride_starts(good))) == {160}
    scuffing = good.foot_height.copy()
    # One foot comes down in between in every other stride, another is late now and then.
    moment = np.arange(4000) % 320
    scuffing[:, 0] = np.where((moment >= 25) & (moment < 35), 0.0, scuffing[:, 0])
    scuffing[:, 1] = np.roll(scuffing[:, 1], 30) * (np.arange(4000) > 1500)
    falls = measure.footfalls(scuffing[:, 0], measure.SWING * good.dimensions.hip_height)
    assert len(set(np.diff(falls))) > 1
    found = measure.stride_starts(changed(good, foot_height=scuffing))
    assert set(np.diff(found)) == {160}


def test_a_foot_that_hardly_moves_defines_no_strides():
    good = walk().window(2.0)
    height = good.foot_height.copy()
    height[:, 0] = np.where(np.isin(np.arange(4000), [500, 2500]), 0.1, 0.0)
    assert set(np.diff(measure.stride_starts(changed(good, foot_height=height)))) == {160}


def test_slip_is_summed_over_the_stance_only():
    window = walk().window(2.0)
    assert describe.slip_distance(window) == pytest.approx(np.full(4, 0.02 * 0.6 * 20), rel=0.02)


def test_push_that_fells_half_lies_between_the_pushes_tried():
    assert half_point({0.0: 1.0, 0.1: 1.0, 0.2: 0.75, 0.4: 0.25}) == pytest.approx(0.3)
    assert half_point({0.0: 1.0, 0.8: 0.6}) is None
    assert half_point({0.0: 0.0, 0.1: 0.0}) == 0.0


@pytest.mark.parametrize(
    ("recording", "said"),
    [
        (walk, None),
        (collapser, "fell after 15.0 s"),
        (lambda: moved(walk(), up=np.where(time_of(walk()) > 0.4, 0.1, 0.4)), "fell in the first"),
        (lambda: moved(walk(), up=np.full(4400, np.nan)), "fell in the first second, after 0.0 s"),
        (lambda: walk(speed=0.001), "never left its place: 0.02 m in 22 s"),
        (lambda: walk(speed=-0.5), "went backwards, 11.0"),
        (lambda: walk(lift=0.001), "went 17.60 m without a stride"),
    ],
    ids=["walks", "falls late", "falls soon", "blows up", "stands", "goes back", "slides"],
)
def test_the_obstacle_to_a_walk_is_named_in_a_sentence(recording, said):
    found = obstacle(recording(), CONFIG)
    assert found is None if said is None else found.startswith(said)
