"""Predictions before anything is evolved: strength, reach, room for strides."""

import copy
import dataclasses

import mujoco
import numpy as np
import pytest
from certify_made_up import TOML, XML

from mjxgait.certification.advice import ADVICE, advised
from mjxgait.certification.criteria import Criterion, at_most
from mjxgait.certification.feasibility import feasibility
from mjxgait.certification.statics import IN_A_STEP, Statics
from mjxgait.config.layers import find_creature, shipped_creatures
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.load import creature_of
from mjxgait.creature.textbook import Leg

SHIPPED = [name for name in shipped_creatures() if name != "blocks"]


@pytest.fixture(scope="module")
def tiny() -> Creature:
    return creature_of({"creature.xml": XML, "creature.toml": TOML})


@pytest.fixture(scope="module")
def bent(tiny: Creature) -> Creature:
    """The small quadruped with bent legs: hips forward, knees back, feet below the hips."""
    qpos = tiny.stand_qpos.copy()
    qpos[tiny.joints.qpos_adr] = np.tile([0.6, -1.2], 4)
    qpos[2] -= 0.28 * (1 - np.cos(0.6))
    angles = dataclasses.replace(tiny.joints, stand=qpos[tiny.joints.qpos_adr])
    return dataclasses.replace(tiny, stand_qpos=qpos, joints=angles)


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_creature_is_fit_to_walk(name: str):
    found = feasibility(load_creature(find_creature(name)))
    assert found.limits == []
    assert found.lines()[-1] == "Strength, reach and strides are enough for a walk."


def test_a_dog_with_a_fifth_of_its_torque_is_too_weak():
    dog = load_creature(find_creature("tall_quadruped"))
    limit = 0.2 * dog.gains.torque_limit
    gains = dataclasses.replace(dog.gains, torque_limit=limit)
    ((said, remedy),) = feasibility(dataclasses.replace(dog, gains=gains)).limits
    assert said.startswith('"front_left_knee" and 3 more are up to 35% too weak for its weight')
    assert "`torque_limit` in creature.toml" in remedy


def test_a_body_of_which_little_can_be_seen_is_never_certified(tiny: Creature):
    model = copy.copy(tiny.model)
    trunk = np.flatnonzero(model.geom_bodyid == tiny.trunk)
    model.geom_bodyid[trunk] = 0
    bare = dataclasses.replace(tiny, model=model)
    ((said, remedy),) = feasibility(bare).limits
    share = model.body_mass[tiny.trunk] / model.body_mass.sum()
    assert said.startswith(f"Parts with {share:.0%} of its mass have no shape")
    assert "meshes" in remedy
    # The certificate states it as a measure, so its advice does not say it again.
    unseen = at_most("not examined: mass without a shape / mass", float(share), 0.25)
    told = advised([Criterion(9, "parts", (unseen,))], "walk", {}, bare)[ADVICE]
    assert " ".join(told).count("no shape") == 1


def test_the_weight_is_shared_by_the_feet(bent: Creature):
    statics = Statics(bent)
    assert statics.weights.sum() == pytest.approx(bent.frame.mass * bent.gravity, rel=1e-3)
    assert statics.weights == pytest.approx(np.full(4, statics.weights.mean()), rel=0.1)


def test_the_load_of_a_knee_is_weight_times_lever(bent: Creature):
    """Where the foot stands, at standing height: no other height is reached by one step."""
    statics, leg = Statics(bent), Leg(bent, 0)
    own = np.flatnonzero(statics.feet == 0)
    statics._pose(statics.stand)
    torques = statics._least_torques(leg, own)
    # Half of the upper leg's way ahead; the lower leg and foot pull a little against it.
    carried = IN_A_STEP * float(statics.weights[own].sum())
    lever = 0.14 * np.sin(0.6)
    hung = bent.gravity * (0.15 * lever / 2 + 0.05 * lever)
    assert abs(torques[1]) == pytest.approx(carried * lever - hung, rel=0.02)
    assert abs(torques[0]) < 0.1 * abs(torques[1])


def test_straighter_legs_carry_a_step_with_less(bent: Creature):
    statics, leg = Statics(bent), Leg(bent, 0)
    own = np.flatnonzero(statics.feet == 0)
    statics._pose(statics.stand)
    standing = np.abs(statics._least_torques(leg, own)).max()
    assert statics.in_a_step(leg, 0, (0.0,)).needed < 0.8 * standing


def test_joints_of_no_leg_hold_what_hangs_on_them():
    lamp = load_creature(find_creature("luxo"))
    data = mujoco.MjData(lamp.model)
    data.qpos[:] = lamp.stand_qpos
    mujoco.mj_forward(lamp.model, data)
    rest = feasibility(lamp).rest
    held = dict(zip(lamp.joints.names, data.qfrc_bias[lamp.joints.dof_adr], strict=True))
    assert rest.needed == pytest.approx(abs(held[rest.joint]), rel=1e-6)


def test_narrow_ranges_leave_no_room_for_a_stride(bent: Creature):
    stand = bent.joints.stand
    narrow = dataclasses.replace(bent.joints, pose_low=stand - 0.05, pose_high=stand + 0.05)
    said = [words for words, _ in feasibility(dataclasses.replace(bent, joints=narrow)).limits]
    assert any("hip heights to and fro, and a stride of 0.5 needs 0.25" in one for one in said)


def test_a_foot_in_the_air_is_named(bent: Creature):
    qpos = bent.stand_qpos.copy()
    qpos[bent.joints.qpos_adr[1]] -= 0.15
    lifted = dataclasses.replace(bent, stand_qpos=qpos)
    said = [words for words, _ in feasibility(lifted).limits]
    assert "In its standing pose front_left_lower does not reach the floor." in said
