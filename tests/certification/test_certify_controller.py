"""NumPy controller against hand calculations from docs/reference/controller.md."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from certify_made_up import make_champion
from helpers import altered

from mjxgait.controllers.key_poses.reference import READS, PoseReference, pose_cycle
from mjxgait.reference.layout import start_frame
from mjxgait.reference.state import (
    ADDED,
    SENSES,
    Drive,
    State,
    sense,
)

STEP = 0.005


def rotation(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array(
        {
            "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }[axis]
    )


def made_up(creature, rot=None, pos=(0.0, 0.0, 0.3035), angvel=(0.0, 0.0, 0.0), seed=None, count=1):
    """A state that stands still unless a seed draws joints, velocities and dynamics."""
    nv, joints = creature.model.nv, len(creature.joints.stand)
    rng = np.random.default_rng(seed)
    draw = (
        (lambda *shape: rng.normal(0, 0.3, shape))
        if seed is not None
        else (lambda *shape: np.zeros(shape))
    )
    root = draw(count, nv, nv)
    return State(
        start=start_frame(creature),
        ground=None,
        time=np.full(count, 0.3),
        joint_pos=creature.joints.stand + draw(count, joints),
        velocity=draw(count, nv),
        trunk_pos=np.tile(pos, (count, 1)),
        trunk_rot=np.tile(np.eye(3) if rot is None else rot, (count, 1, 1)),
        trunk_vel=draw(count, 3),
        trunk_angvel=np.tile(angvel, (count, 1)),
        foot_height=np.tile([0.0, 0.001, 0.003, 0.05], (count, 1)),
        mass_matrix=root @ root.swapaxes(1, 2) + np.eye(nv),
        bias=draw(count, nv),
        constraint_force=draw(count, nv),
        foot_pos=draw(count, 4, 3),
    )


def felt(creature, *arguments, **keys):
    """Observations of the controller in a made-up state."""
    return sense(creature, made_up(creature, *arguments, **keys), READS)


def reference(creature, *arguments, **keys):
    return PoseReference(creature, make_champion(creature, *arguments, **keys), STEP)


def drive(creature, **settings):
    return Drive(creature, make_champion(creature, **settings).drive, "pose", STEP)


def poses(creature, count=2):
    return np.random.default_rng(5).uniform(-0.4, 0.4, (count, len(creature.joints.stand)))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_cycle_passes_through_the_key_poses_and_their_mirror_images(tiny, count):
    key_poses = poses(tiny, count)
    control = reference(tiny, key_poses, interpolation=7)
    assert control.length == 2 * count * 7
    at_poses = control.planned(np.arange(2 * count) * 7)
    mirrored = np.array(
        [
            [tiny.mirror.sign[j] * pose[tiny.mirror.partner[j]] for j in range(8)]
            for pose in key_poses
        ]
    )
    np.testing.assert_array_equal(at_poses, [*key_poses, *mirrored])


def test_mirroring_swaps_left_and_right(tiny):
    names = list(tiny.joints.names)
    pose = np.zeros((1, 8))
    pose[0, names.index("front_left_hip")], pose[0, names.index("hind_right_knee")] = 0.3, -0.2
    image = pose_cycle(pose, tiny)[1]
    assert image[names.index("front_right_hip")] == 0.3
    assert image[names.index("hind_left_knee")] == -0.2
    assert np.count_nonzero(image) == 2


def test_a_roll_joint_changes_sign_in_the_mirror(tiny):
    rolling = altered(tiny, mirror={"sign": -tiny.mirror.sign})
    np.testing.assert_array_equal(pose_cycle(np.full((1, 8), 0.1), rolling)[1], np.full(8, -0.1))


def test_between_poses_the_target_is_linear_and_the_cycle_closes(tiny):
    key_poses = poses(tiny)
    control = reference(tiny, key_poses, interpolation=10)
    cycle = pose_cycle(key_poses, tiny)
    np.testing.assert_allclose(
        control.planned(np.array([3]))[0], 0.7 * cycle[0] + 0.3 * cycle[1], atol=1e-15
    )
    np.testing.assert_allclose(
        control.planned(np.array([39]))[0], 0.1 * cycle[3] + 0.9 * cycle[0], atol=1e-15
    )


def test_an_unsymmetric_creature_is_not_mirrored(tiny):
    lopsided = altered(tiny, mirror={"symmetric": False})
    assert len(pose_cycle(poses(tiny), lopsided)) == 2


def test_heading_to_the_left_and_being_on_the_left_are_positive(tiny):
    control = reference(tiny, tuning={"steer": 0.5})
    assert control.corrections(felt(tiny, rotation("z", 0.3)))[0] == pytest.approx(0.15)
    on_the_left = felt(tiny, pos=(4.0, 0.2, 0.3))
    assert control.corrections(on_the_left)[0] == pytest.approx(
        0.5 * 0.2 / (2 * tiny.frame.body_length)
    )
    assert control.corrections(felt(tiny, rotation("z", 3.0)))[0] == pytest.approx(0.5)


def test_nose_down_and_right_side_down_are_positive(tiny):
    still = reference(tiny, tuning={"pitch": 1.0, "roll": 2.0})
    _, pitch, roll = still.corrections(felt(tiny, rotation("y", 0.2)))
    assert (pitch, roll) == (pytest.approx(0.2), pytest.approx(0.0))
    _, pitch, roll = still.corrections(felt(tiny, rotation("x", 0.2)))
    assert (pitch, roll) == (pytest.approx(0.0), pytest.approx(0.4))


def test_rates_are_positive_when_the_angles_grow(tiny):
    swinging = reference(tiny, tuning={"pitch_rate": 0.1, "roll_rate": 0.2})
    turned = rotation("z", 1.0)
    _, pitch, roll = swinging.corrections(felt(tiny, turned, angvel=turned @ [0.7, 0.5, 9.0]))
    assert (pitch, roll) == (pytest.approx(0.05), pytest.approx(0.14))


def test_the_corrected_target_equals_the_documented_sum(tiny):
    key_poses = poses(tiny)
    stand = np.full(8, 0.05)
    creature = altered(tiny, joints={"stand": stand})
    control = reference(creature, key_poses, {"steer": 1.0, "pitch": 1.0, "roll": 1.0})
    rot = rotation("z", 0.1) @ rotation("y", 0.2)
    u, p, r = (float(part[0]) for part in control.corrections(felt(creature, rot)))
    target = control.target(np.array([0]), felt(creature, rot), np.zeros(1, int))[0]
    for j in range(8):
        want = stand[j] + (key_poses[0, j] - stand[j]) * (
            1 + u * creature.corrections.steer_stride[j]
        )
        want += (
            u * creature.corrections.steer_bend[j]
            + p * creature.corrections.balance_pitch[j]
            + r * creature.corrections.balance_roll[j]
        )
        assert target[j] == pytest.approx(want, abs=1e-14)


def test_the_target_stays_within_the_joint_ranges(tiny):
    control = reference(tiny, np.full((2, 8), 3.0))
    np.testing.assert_array_equal(
        control.target(np.array([0]), felt(tiny), np.zeros(1, int))[0], tiny.joints.high
    )


@pytest.mark.parametrize("constraint_forces", [False, True])
def test_stable_pd_against_the_dense_formula(tiny, constraint_forces):
    h, nv = STEP, tiny.model.nv
    state = made_up(tiny, seed=1, count=3)
    target = np.random.default_rng(2).normal(0, 0.2, (3, 8))
    got = drive(tiny, constraint_forces=constraint_forces).torque(target, state)
    for s in range(3):
        kp, kd, q, wish = (np.zeros(nv) for _ in range(4))
        kp[tiny.joints.dof_adr], kd[tiny.joints.dof_adr] = tiny.gains.kp, tiny.gains.kd
        q[tiny.joints.dof_adr], wish[tiny.joints.dof_adr] = state.joint_pos[s], target[s]
        p = -kp * (q + h * state.velocity[s] - wish)
        d = -kd * state.velocity[s]
        force = p + d - state.bias[s] + (state.constraint_force[s] if constraint_forces else 0)
        acc = np.linalg.inv(state.mass_matrix[s] + h * np.diag(kd)) @ force
        want = np.clip(
            (p + d - h * kd * acc)[tiny.joints.dof_adr],
            -tiny.gains.torque_limit,
            tiny.gains.torque_limit,
        )
        np.testing.assert_allclose(got[s], want, atol=1e-9)


def test_stable_pd_predicts_the_acceleration_that_its_own_torque_makes(tiny):
    loose = altered(tiny, gains={"torque_limit": np.full(8, 1e9)})
    state, target, h = made_up(tiny, seed=3), np.full((1, 8), 0.1), STEP
    torque = drive(loose).torque(target, state)[0]
    force = -state.bias[0]
    force[tiny.joints.dof_adr] += torque
    acc = np.linalg.solve(state.mass_matrix[0], force)[tiny.joints.dof_adr]
    v = state.velocity[0, tiny.joints.dof_adr]
    np.testing.assert_allclose(
        torque,
        -tiny.gains.kp * (state.joint_pos[0] + h * v - target[0]) - tiny.gains.kd * (v + h * acc),
        rtol=1e-9,
    )


def test_plain_pd(tiny):
    state, target = made_up(tiny, seed=4), np.full((1, 8), 0.1)
    want = (
        -tiny.gains.kp * (state.joint_pos - target)
        - tiny.gains.kd * state.velocity[:, tiny.joints.dof_adr]
    )
    got = drive(tiny, law="pd").torque(target, state)
    np.testing.assert_allclose(got, np.clip(want, -12, 12))


def test_the_position_advances_if_the_pose_error_is_below_the_threshold(tiny):
    control = reference(tiny, tuning={"threshold": 0.12})
    off = np.zeros((3, 8))
    off[0], off[1], off[2, 0] = 0.119, 0.121, 0.12 * np.sqrt(8) * 0.99
    np.testing.assert_array_equal(
        control.advance(np.array([39, 39, 5]), off, np.zeros((3, 8)), np.ones(3, int)), [0, 39, 6]
    )


def test_the_clock_advances_at_any_error(tiny):
    control = reference(tiny, tuning={"period": 0.8}, advance="clock")
    far = np.ones((1, 8))
    at = [
        int(control.advance(np.array([0]), far, 0 * far, np.array([k]))[0])
        for k in (0, 3, 4, 80, 159, 160, 164)
    ]
    assert at == [0, 0, 1, 20, 39, 0, 1]


def test_a_torque_command_is_only_limited(tiny):
    wanted = np.array([[1.0, -2.0, 50.0, -50.0, 0.0, 12.0, -12.0, 3.0]])
    got = Drive(tiny, make_champion(tiny).drive, "torque", STEP).torque(wanted, made_up(tiny))
    np.testing.assert_array_equal(got, np.clip(wanted, -12, 12))


def askew(tiny):
    """A tilted body, as a state of the reference simulator and of evolution."""
    import jax.numpy as jnp

    from mjxgait.types import Sensed

    rot = rotation("z", 0.7) @ rotation("y", 0.2) @ rotation("x", -0.4)
    state = made_up(tiny, rot, (0.3, -0.1, 0.25), (0.5, -0.7, 0.9), seed=6)
    return state, Sensed(
        joint_pos=jnp.asarray(state.joint_pos[0]),
        joint_vel=jnp.asarray(state.velocity[0, tiny.joints.dof_adr]),
        bias=jnp.asarray(state.bias[0]),
        trunk_pos=jnp.asarray(state.trunk_pos[0]),
        trunk_rot=jnp.asarray(rot),
        trunk_vel=jnp.asarray(state.trunk_vel[0]),
        trunk_angvel=jnp.asarray(state.trunk_angvel[0]),
        geom_pos=jnp.zeros((len(tiny.feet.watched), 3)).at[:4].set(jnp.asarray(state.foot_pos[0])),
        geom_low=jnp.zeros(len(tiny.feet.watched)).at[:4].set(jnp.asarray(state.foot_height[0])),
    )


def test_every_observation_equals_that_of_evolution(tiny):
    import jax.numpy as jnp

    from mjxgait.controllers import observations as evolution

    state, sensed = askew(tiny)
    assert SENSES.keys() == evolution.SENSES.keys()
    for name, value in evolution.sense(tiny, sensed, jnp.float32(0.3), SENSES).items():
        ours = sense(tiny, state, [name])[name][0]
        np.testing.assert_allclose(np.asarray(value), ours, atol=1e-6, err_msg=name)
        assert name == "time" or np.any(ours != 0), name


@pytest.mark.parametrize(("time", "beat"), [(0.0, -1.0), (0.75, 0.5), (1.0, -1.0), (7.25, -0.5)])
def test_the_beat_restarts_every_second(tiny, time, beat):
    import jax.numpy as jnp

    from mjxgait.controllers import observations as evolution

    state, sensed = askew(tiny)
    state = dataclasses.replace(state, time=np.array([time]))
    assert sense(tiny, state, ["beat"])["beat"].tolist() == [beat]
    assert float(evolution.sense(tiny, sensed, jnp.float32(time), ["beat"])["beat"]) == beat


def test_observations_added_by_tasks_equal_those_of_evolution(tiny):
    """Every shipped task, without the light of modular bodies.

    `tests/tasks/modular/test_roaming.py` tests the light.
    """
    import jax.numpy as jnp

    from mjxgait.kinds import tasks
    from mjxgait.tasks.hop.limbo import LimboGoal

    state, sensed = askew(tiny)
    state = dataclasses.replace(state, goal=np.array([0.8]), bar=np.array([0.6]))
    found = {}
    for name, kind in tasks().items():
        if kind.modular:
            continue
        task = kind.part("task")(tiny, STEP, 1000, tiny.settings.termination)
        # A goal 0.8 m ahead, and a bar at its final height.
        given = (
            LimboGoal(jnp.float32(0.8), jnp.float32(0.0)) if name == "limbo" else jnp.float32(0.8)
        )
        goal = task.goal(SimpleNamespace(goal=given))
        found |= task.observations(goal, sensed)
        assert set(task.adds) <= set(found)
    assert {*found, "light"} == ADDED.keys()
    for name, value in found.items():
        ours = sense(tiny, state, [name])[name][0]
        np.testing.assert_allclose(np.asarray(value), ours, atol=1e-6, err_msg=name)
