"""Pose cycles drawn from a body's geometry: feet follow the gait, joints keep their ranges."""

import mujoco
import numpy as np
import pytest

from mjxgait.creature import Creature
from mjxgait.creature.textbook import CROUCH, Footfalls, textbook_cycle
from mjxgait.tasks.walk.gaits import (
    animal_duty,
    animal_stride,
    gait_of,
    placed,
)

POSES = 16
NAMES = {2: "walk", 4: "walk", 6: "tripod"}


def falls_of(creature: Creature, share: float = 0.6) -> Footfalls:
    """Footfalls of an animal's walk at 0.5 body lengths/s; `share`: the share of its stride."""
    hip, speed = creature.frame.hip_height, 0.5 * creature.frame.body_length
    gait = gait_of(NAMES[len(creature.feet.names)], len(creature.feet.names))
    phases = placed(gait, creature.feet.stations)[0]
    duty, stride = animal_duty(speed, hip), share * animal_stride(speed, hip)
    return Footfalls(phases, duty, stride, 0.1 * hip)


def feet_in(creature: Creature, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacements [N, 3] of the feet in m (ahead, left, up) from the standing pose, and the
    cosine [N] of each foot's tilt.
    """
    seen = []
    for angles in (creature.joints.stand, pose):
        data = mujoco.MjData(creature.model)
        data.qpos[:] = creature.stand_qpos
        data.qpos[creature.joints.qpos_adr] = angles
        mujoco.mj_kinematics(creature.model, data)
        geoms = [
            [
                g
                for g, of in zip(creature.feet.stepping, creature.feet.foot_of_geoms, strict=True)
                if of == n
            ]
            for n in range(len(creature.feet.names))
        ]
        bodies = [creature.model.geom_bodyid[own[0]] for own in geoms]
        axes = np.stack([*creature.frame.start_axes, [0, 0, 1]], 1)
        seen.append(
            (
                np.array([data.geom_xpos[own].mean(0) for own in geoms]) @ axes,
                data.xmat[bodies].reshape(-1, 3, 3),
            )
        )
    (rest, level), (moved, turned) = seen
    return moved - rest, np.einsum("nij,nij->n", turned[..., 2:], level[..., 2:])


@pytest.fixture
def walker(shipped: Creature) -> Creature:
    if len(shipped.feet.names) not in NAMES:
        pytest.skip("its gait has no name")
    return shipped


def test_feet_follow_the_gait(walker: Creature):
    """Stance feet move back evenly at one height, by one stride per cycle."""
    falls, hip = falls_of(walker), walker.frame.hip_height
    cycle = textbook_cycle(walker, falls, POSES)
    places = np.array([feet_in(walker, pose)[0] for pose in cycle]) / hip
    for foot, phase in enumerate(falls.phases):
        share = (np.arange(POSES) / POSES - phase + falls.duty / 2) % 1.0
        stands = share < falls.duty
        ahead, left, above = places[:, foot].T
        wanted = falls.stride / hip * (falls.duty / 2 - share[stands])
        np.testing.assert_allclose(ahead[stands], wanted, atol=0.03)
        np.testing.assert_allclose(above[stands], CROUCH, atol=0.03)
        np.testing.assert_allclose(left, 0.0, atol=0.03)
        assert above[~stands].max() - CROUCH > 0.06


def test_the_cycle_is_its_mirror_image_half_a_cycle_later(walker: Creature):
    cycle = textbook_cycle(walker, falls_of(walker), POSES)
    if walker.mirror.symmetric:
        image = walker.mirror.image(np.roll(cycle, POSES // 2, axis=0))
        np.testing.assert_allclose(image, cycle, atol=1e-6)


def test_joints_keep_their_ranges_and_other_joints_do_not_move(walker: Creature):
    """For any length of stride."""
    joints = walker.joints
    cycle = textbook_cycle(walker, falls_of(walker, share=3.0), POSES)
    assert (cycle >= joints.pose_low - 1e-9).all()
    assert (cycle <= joints.pose_high + 1e-9).all()
    for name, angles, stand in zip(joints.names, cycle.T, joints.stand, strict=True):
        if {"spine", "neck", "tail", "wing"} & set(name.split("_")):
            assert (angles == stand).all()


def test_feet_stay_level_on_legs_with_ankles(walker: Creature):
    if not any("ankle" in name for name in walker.joints.names):
        pytest.skip("its legs have none")
    for pose in textbook_cycle(walker, falls_of(walker), POSES):
        assert (feet_in(walker, pose)[1] > np.cos(np.radians(6.0))).all()
