"""Reference simulator: independent rows, agreement with a plain MuJoCo loop, measurements."""

import dataclasses
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from certify_made_up import make_champion

from mjxgait.certification import (
    distance,
    nominal_check,
    record,
    survival,
)
from mjxgait.certification.trials import simulate
from mjxgait.controllers.key_poses.reference import PoseReference
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.reference.layout import start_frame
from mjxgait.reference.measure import measure
from mjxgait.reference.outcome import Fall
from mjxgait.reference.starts import (
    join,
    nominal_starts,
    perturbed_starts,
    pushed_starts,
    unfamiliar,
)
from mjxgait.reference.state import Drive, State, sense
from mjxgait.reference.stepping import examined_model

SECONDS = 1.5


@pytest.fixture(scope="module")
def mixed(tiny):
    """Starts with every kind of disturbance, and two that must fall early."""
    rng = np.random.default_rng(3)
    noisy = unfamiliar(
        perturbed_starts(tiny, 4, rng, friction=(0.3, 1.5), mass=0.3),
        rng,
        gains=0.2,
        slope=0.05,
        floor=(0.2, 5.0),
    )
    noisy.delay[:] = [0, 1, 2, 1]
    noisy.push_time[:] = [0.2, 0.503, 0.9, np.inf]
    noisy.push[:] = rng.normal(0, 0.3, (4, 2))
    return join(noisy, pushed_starts(tiny, 2, rng, 6.0, (0.1, 0.3)), perturbed_starts(tiny, 2, rng))


@pytest.fixture(scope="module")
def outcome(tiny, trotter, mixed):
    return simulate(tiny, trotter, mixed, SECONDS, record=len(mixed), threads=1)


def plain_loop(creature, champion, starts, row, seconds):
    """States before each step of one simulation that shares nothing with the batch."""
    model = examined_model(creature)
    model.geom_friction[:, 0] *= starts.friction[row]
    model.body_mass[:] *= starts.mass[row]
    model.body_inertia[:] *= starts.mass[row][:, None]
    rise = np.hypot(*starts.slope[row])
    uphill = np.array([*starts.slope[row], 0.0]) / max(rise, 1e-12)
    model.opt.gravity[:] = -9.81 * (np.sin(rise) * uphill + [0.0, 0.0, np.cos(rise)])
    softness = (1 / model.geom_solimp[:, :2] - 1) * starts.floor[row]
    model.geom_solimp[:, :2] = 1 / (1 + softness)
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    step = model.opt.timestep
    control, states = PoseReference(creature, champion, step), []
    drive, memory = Drive(creature, champion.drive, "pose", step), control.init(1)
    torques = []
    data.qpos[:] = creature.stand_qpos
    mujoco.mj_kinematics(model, data)
    feet = creature.feet.watched[:4]
    usual = data.geom_xpos[feet, 2].min()
    data.qpos[creature.joints.qpos_adr] += starts.joint_offset[row]
    mujoco.mj_kinematics(model, data)
    data.qpos[2] += max(0.0, usual - data.geom_xpos[feet, 2].min())
    data.qvel[creature.joints.dof_adr] = starts.joint_velocity[row]
    mass = np.zeros((model.nv, model.nv))
    for k in range(round(seconds / model.opt.timestep)):
        if int(np.floor(min(starts.push_time[row], 1e6) / model.opt.timestep)) == k:
            data.qvel[:2] += starts.push[row]
        states.append(np.concatenate([data.qpos, data.qvel]))
        last = data.qfrc_constraint.copy()
        mujoco.mj_step1(model, data)
        mujoco.mj_fullM(model, data, mass)
        rot = data.xmat[creature.trunk].reshape(3, 3)
        state = State(
            start=start_frame(creature),
            ground=None,
            time=np.array([k * step]),
            joint_pos=data.qpos[None, creature.joints.qpos_adr],
            velocity=data.qvel[None],
            trunk_pos=data.xpos[None, creature.trunk],
            trunk_rot=rot[None],
            trunk_vel=data.qvel[None, :3],
            trunk_angvel=(rot @ data.qvel[3:6])[None],
            foot_height=np.zeros((1, 0)),
            mass_matrix=mass[None],
            bias=(data.qfrc_bias - data.qfrc_passive)[None],
            constraint_force=last[None],
        )
        target, memory = control.act(memory, sense(creature, state, control.reads))
        gains = starts.stiffness[[row]], starts.damping[[row]]
        torques.append(drive.torque(target, state, *gains)[0])
        data.qfrc_applied[creature.joints.dof_adr] = torques[max(k - starts.delay[row], 0)]
        mujoco.mj_step2(model, data)
    return np.array(states)


@pytest.fixture(scope="module", params=["clock", "error"])
def disturbed(request, tiny, trotter, mixed):
    """A champion with active corrections, and its recording from all starts."""
    champion = make_champion(
        tiny,
        trotter.genome["key_poses"],
        {"steer": 1.0, "roll": 0.3, "pitch_rate": 0.1},
        advance=request.param,
        constraint_forces=True,
    )
    return champion, simulate(tiny, champion, mixed, 1.0, record=len(mixed)).trajectory


@pytest.mark.parametrize("row", [0, 1, 2, 3, 7])
def test_every_disturbance_reaches_the_right_simulation(tiny, mixed, disturbed, row):
    champion, film = disturbed
    want = plain_loop(tiny, champion, mixed, row, 1.0)
    got = np.concatenate([film.qpos[row], film.qvel[row]], 1)
    np.testing.assert_allclose(got, want, atol=1e-9)


def test_rows_are_independent_and_threads_do_not_matter(tiny, trotter, mixed, outcome):
    three = simulate(tiny, trotter, mixed, SECONDS, record=len(mixed), threads=3)
    np.testing.assert_array_equal(three.trajectory.qpos, outcome.trajectory.qpos)
    np.testing.assert_array_equal(three.fell, outcome.fell)
    for row in range(1, len(mixed), 2):
        alone = simulate(tiny, trotter, mixed.rows(slice(row, row + 1)), SECONDS, record=1)
        np.testing.assert_array_equal(alone.trajectory.qpos[0], outcome.trajectory.qpos[row])


def test_dropping_fallen_simulations_does_not_change_the_others(tiny, trotter, mixed, outcome):
    dropped = simulate(tiny, trotter, mixed, SECONDS, threads=1)
    assert 2 <= np.isfinite(dropped.fell).sum() < len(mixed)
    np.testing.assert_array_equal(dropped.fell, outcome.fell)
    standing = dropped.stayed_up
    np.testing.assert_array_equal(dropped.travel[standing], outcome.travel[standing])


def test_sharing_a_simulation_until_the_push_does_not_change_it(tiny, trotter):
    pushed = pushed_starts(tiny, 6, np.random.default_rng(5), 1.2, (0.2, 1.2))
    pushed.push_time[-1] = 99.0
    together = simulate(tiny, trotter, pushed, SECONDS, threads=1)
    alone = [simulate(tiny, trotter, pushed.rows(slice(i, i + 1)), SECONDS) for i in range(6)]
    np.testing.assert_array_equal(together.fell, [a.fell[0] for a in alone])
    np.testing.assert_array_equal(together.travel, [a.travel[0] for a in alone])
    assert len(set(together.travel[:, 0])) == 6


def test_a_fall_before_the_push_is_that_of_the_shared_simulation(tiny):
    flat = make_champion(tiny, np.tile([1.0, 1.4], (2, 4)))
    pushed = pushed_starts(tiny, 3, np.random.default_rng(5), 0.1, (1.0, 1.4))
    together = simulate(tiny, flat, pushed, SECONDS, threads=1)
    alone = simulate(tiny, flat, nominal_starts(tiny, 1), SECONDS)
    np.testing.assert_array_equal(together.fell, np.repeat(alone.fell, 3))
    np.testing.assert_array_equal(together.travel, np.repeat(alone.travel, 3, axis=0))


def test_a_repeated_simulation_is_identical(tiny, trotter, mixed, outcome):
    again = simulate(tiny, trotter, mixed, SECONDS, record=len(mixed), threads=1)
    np.testing.assert_array_equal(again.trajectory.qpos, outcome.trajectory.qpos)
    np.testing.assert_array_equal(again.trajectory.torque, outcome.trajectory.torque)


def test_a_standing_creature_stands(tiny):
    champion = make_champion(tiny)
    assert simulate(
        tiny, champion, perturbed_starts(tiny, 6, np.random.default_rng(0)), 2.0
    ).stayed_up.all()
    assert abs(distance(tiny, champion, 2.0)) < 0.02


def test_a_standing_creature_is_carried_by_its_feet_and_does_not_slide(tiny):
    recording = record(tiny, make_champion(tiny), 2.0).window(1.0)
    assert recording.foot_force.sum(1) == pytest.approx(tiny.frame.mass * 9.81, rel=0.01)
    assert recording.contact.all()
    assert not recording.touch.any()
    assert recording.foot_slip.max() < 5e-3
    assert np.abs(recording.foot_height).max() < 2e-3
    assert recording.trunk_up == pytest.approx(1.0, abs=1e-3)


def test_a_walk_survives_and_advances(tiny, trotter):
    assert distance(tiny, trotter, 4.0) > 0.8
    assert survival(tiny, trotter, starts=6, seconds=4.0) == 1.0


def test_slip_is_the_velocity_at_the_contact_point(tiny, trotter):
    """The expected velocity comes from the Jacobian of the contact point."""
    outcome = simulate(tiny, trotter, nominal_starts(tiny, 1), 1.0, record=1)
    recording = record(tiny, trotter, 1.0)
    model, data = examined_model(tiny), mujoco.MjData(examined_model(tiny))
    jac, seen = np.zeros((3, model.nv)), 0
    for k in range(0, 200, 7):
        data.qpos[:], data.qvel[:] = outcome.trajectory.qpos[0, k], outcome.trajectory.qvel[0, k]
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            foot = list(tiny.feet.watched[:4]).index(max(contact.geom))
            mujoco.mj_jac(model, data, jac, None, contact.pos, model.geom_bodyid[max(contact.geom)])
            if recording.contact[k, foot]:
                assert recording.foot_slip[k, foot] == pytest.approx(
                    np.linalg.norm((jac @ data.qvel)[:2]), abs=1e-9
                )
                seen += 1
    assert seen > 20


def test_the_recording_is_in_the_frame_of_the_start(tiny, trotter):
    outcome = simulate(tiny, trotter, nominal_starts(tiny, 1), 2.0, record=1)
    recording = record(tiny, trotter, 2.0)
    np.testing.assert_allclose(
        recording.trunk_pos[:, :2], outcome.trajectory.qpos[0, :, :2], atol=1e-12
    )
    np.testing.assert_array_equal(
        recording.joint_pos, outcome.trajectory.qpos[0][:, tiny.joints.qpos_adr]
    )
    assert np.abs(recording.torque).max() <= 12.0
    assert recording.touch.sum() == 0


def test_half_the_time_step_has_the_same_frames_and_nearly_the_same_walk(tiny, trotter):
    finer = dataclasses.replace(nominal_starts(tiny, 1), refine=np.array([2]))
    whole, halved = record(tiny, trotter, 2.0), record(tiny, trotter, 2.0, finer)
    assert halved.time_step == whole.time_step
    assert len(halved.trunk_pos) == len(whole.trunk_pos)
    assert halved.trunk_pos[-1, 0] == pytest.approx(whole.trunk_pos[-1, 0], rel=0.5)
    assert not np.array_equal(halved.joint_pos, whole.joint_pos)


def test_a_commanded_heading_turns_the_walk(tiny, trotter):
    steps = round(3.0 / 0.005)
    ways = [
        simulate(
            tiny, trotter, nominal_starts(tiny, 1), 3.0, record=1, heading=np.full(steps, turn)
        ).trajectory.qpos[0, :, 1]
        for turn in (-0.5, 0.5)
    ]
    assert not np.allclose(*ways)


def test_lying_on_the_belly_is_a_fall_even_if_upright(tiny):
    flat = make_champion(tiny, np.tile([1.0, 1.4], (2, 4)))
    starts = nominal_starts(tiny, 1)
    outcome = simulate(tiny, flat, starts, 1.5, record=1)
    assert np.isfinite(outcome.fell[0])
    assert simulate(tiny, flat, starts, 1.5, fall=Fall(height=(0.01, 1.5), touch=False)).stayed_up[
        0
    ]


def test_a_diverged_simulation_counts_as_fallen_to_the_end(tiny, trotter, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    starts = join(
        nominal_starts(tiny, 1), pushed_starts(tiny, 1, np.random.default_rng(0), 1e6, (0.2, 0.2))
    )
    outcome = simulate(tiny, trotter, starts, 0.6, record=2, threads=1)
    assert outcome.stayed_up.tolist() == [True, False]
    assert np.isfinite(outcome.trajectory.qpos[0]).all()
    assert np.isnan(outcome.trajectory.qpos[1, -1]).all()
    recording = measure(tiny, outcome.trajectory, row=1)
    assert np.isnan(recording.trunk_up[-1])
    assert recording.touch[-1]
    # MuJoCo writes a log into the current folder when numbers are not finite.
    assert not list(tmp_path.iterdir())


def test_perturbations_stay_within_their_bounds(tiny):
    starts = perturbed_starts(tiny, 500, np.random.default_rng(0))
    assert np.abs(starts.joint_offset).max() == pytest.approx(0.05, rel=0.01)
    assert np.abs(starts.joint_velocity).max() == pytest.approx(0.1, rel=0.01)
    assert (starts.friction.min(), starts.friction.max()) == (
        pytest.approx(0.8, abs=0.01),
        pytest.approx(1.2, abs=0.01),
    )
    assert (starts.mass.min(), starts.mass.max()) == (
        pytest.approx(0.95, abs=0.001),
        pytest.approx(1.05, abs=0.001),
    )
    pushed = pushed_starts(tiny, 64, np.random.default_rng(0), 0.3, (2.0, 10.0))
    assert np.linalg.norm(pushed.push, axis=1) == pytest.approx(0.3)
    assert np.abs(pushed.push.mean(0)).max() < 0.02
    assert pushed.push_time.min() >= 2.0
    assert pushed.push_time.max() <= 10.0


def test_unfamiliar_disturbances_stay_in_bounds_and_keep_the_others(tiny):
    familiar = perturbed_starts(tiny, 500, np.random.default_rng(0))
    starts = unfamiliar(
        familiar,
        np.random.default_rng(1),
        gains=0.1,
        latency=1,
        slope=np.radians(1.0),
        floor=(0.25, 4.0),
    )
    for factor in (starts.stiffness, starts.damping):
        assert (factor.min(), factor.max()) == pytest.approx((0.9, 1.1), abs=1e-3)
    assert np.bincount(starts.delay) == pytest.approx([250, 250], abs=40)
    steepness = np.degrees(np.hypot(*starts.slope.T))
    assert 0.99 < steepness.max() <= 1.0
    assert np.abs(starts.slope.mean(0)).max() < 0.1 * np.radians(1.0)
    assert (starts.floor.min(), starts.floor.max()) == pytest.approx((0.25, 4.0), rel=0.05)
    assert np.median(starts.floor) == pytest.approx(1.0, rel=0.2)
    for name in ("joint_offset", "joint_velocity", "friction", "mass", "push"):
        np.testing.assert_array_equal(getattr(starts, name), getattr(familiar, name))


def test_unfamiliar_without_arguments_changes_nothing(tiny):
    plain = nominal_starts(tiny, 3)
    same = unfamiliar(plain, np.random.default_rng(0))
    for name in ("stiffness", "damping", "delay", "slope", "floor"):
        np.testing.assert_allclose(getattr(same, name), getattr(plain, name), atol=1e-15)


def resting(creature, **changes):
    """Forward travel and depth of the feet, in m, after 2 s of standing from a changed start."""
    starts = dataclasses.replace(nominal_starts(creature, 1), **changes)
    outcome = simulate(creature, make_champion(creature), starts, 2.0, record=1)
    recording = measure(creature, outcome.trajectory)
    return outcome.travel[0, 0], -recording.foot_height[-1].mean()


def test_a_body_sinks_deeper_into_a_softer_floor(tiny):
    hard, usual, soft = (resting(tiny, floor=np.array([f]))[1] for f in (0.25, 1.0, 4.0))
    assert 1e-5 < 2 * hard < usual < soft / 1.5


def test_a_standing_body_leans_down_the_slope(tiny):
    uphill, downhill = (resting(tiny, slope=np.array([[s, 0.0]]))[0] for s in (0.2, -0.2))
    assert uphill < -1e-3 < 1e-3 < downhill


@pytest.mark.parametrize(
    ("poses", "tuning", "words"),
    [
        (np.full((2, 8), np.nan), {}, 'key pose 1 has nan rad for joint "front_left_hip"'),
        (np.full((2, 8), np.inf), {}, "inf rad"),
        (None, {"period": np.nan}, 'tuning "period" is nan'),
    ],
)
def test_numbers_that_are_not_finite_are_refused_in_one_sentence(
    tiny, tmp_path, monkeypatch, capfd, poses, tuning, words
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=words):
        nominal_check(tiny, make_champion(tiny, poses, tuning))
    # MuJoCo would write a log here and repeat its warning a thousand times.
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")


def test_the_certification_never_imports_jax():
    code = (
        "import mjxgait.certification, sys; "
        "sys.exit(any(n.split('.')[0] in ('jax', 'jaxlib', 'mjx') for n in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_part_without_mass_is_as_fast_as_the_same_part_with_some(tiny, trotter, tmp_path):
    """MuJoCo computes its centre of mass twice as far out: a foot's speed came out doubled."""
    text = tiny.files["creature.xml"]
    leg = text.index(">", text.index('<body name="front_left_lower"')) + 1
    speeds = []
    for name, mass in (
        ("none", ""),
        ("some", '<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>'),
    ):
        (tmp_path / name).mkdir()
        shoe = f'<body name="shoe" pos="0.5 0 -0.5">{mass}</body>'
        (tmp_path / name / "creature.xml").write_text(text[:leg] + shoe + text[leg:])
        (tmp_path / name / "creature.toml").write_text(tiny.files["creature.toml"])
        speeds.append(record(load_creature(tmp_path / name), trotter, 1.0).body_speed.max())
    np.testing.assert_allclose(*speeds, rtol=1e-2)
