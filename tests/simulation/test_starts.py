"""Each perturbation of the starts alone. `test_episode_parity` shows that they reach the motion."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config

from mjxgait.controllers.config import HOLDS
from mjxgait.creature import Creature
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import EvolutionState
from mjxgait.simulation.rollout import CHECK_EVERY
from mjxgait.tasks.starts import NEVER, Starts, draw_starts
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.generation import next_starts
from mjxgait.types import BodyState

NONE = {
    "joint_noise": 0.0,
    "velocity_noise": 0.0,
    "friction": (1.0, 1.0),
    "push": 0.0,
    "gains": 0.0,
}
COUNT = 40


def drawn(creature: Creature, **perturbation: object) -> Starts:
    config = small_config(rollout={**NONE, "starts": COUNT, "seconds": 2.0, **perturbation})
    return jax.device_get(draw_starts(key_of(5), creature, config.rollout))


def differing(one: Starts, other: Starts) -> set[str]:
    names = [field.name for field in dataclasses.fields(Starts)]
    return {n for n in names if not np.array_equal(getattr(one, n), getattr(other, n))}


@pytest.mark.parametrize(
    ("perturbation", "field"),
    [
        ({"joint_noise": 0.1}, "qpos"),
        ({"velocity_noise": 0.5}, "qvel"),
        ({"friction": (0.6, 1.4)}, "friction"),
        ({"push": 0.2}, "push"),
    ],
    ids=["joints displaced", "joints moving", "friction", "push"],
)
def test_a_perturbation_changes_only_its_field_except_in_the_first_start(
    stool: Creature, perturbation: dict, field: str
):
    starts, none = drawn(stool, **perturbation), drawn(stool)
    assert differing(starts, none) == {field}
    values, nominal = getattr(starts, field), getattr(none, field)
    assert np.array_equal(values[0], nominal[0])
    assert all(not np.array_equal(row, nominal[0]) for row in values[1:])


def test_noise_fills_its_range_on_both_sides_for_joints_only(stool: Creature):
    starts = drawn(stool, joint_noise=0.1, velocity_noise=0.5)
    shift = starts.qpos - np.float32(stool.stand_qpos)
    for noise, places, width in (
        (shift, stool.joints.qpos_adr, 0.1),
        (starts.qvel, stool.joints.dof_adr, 0.5),
    ):
        assert width * 0.95 < noise[1:, places].max() <= width
        assert -width * 0.95 > noise[1:, places].min() >= -width
        assert not np.delete(noise, places, axis=1).any()


def test_each_joint_has_its_own_gains(stool: Creature):
    starts = drawn(stool, gains=0.2)
    for factors in (starts.stiffness, starts.damping):
        assert (factors[0] == 1).all()
        assert 0.8 <= factors.min() < 0.82
        assert 1.18 < factors.max() <= 1.2
        assert all(len(set(row)) == len(row) for row in factors[1:].tolist())
    assert not np.array_equal(starts.stiffness, starts.damping)


def test_friction_lies_within_its_range(stool: Creature):
    friction = drawn(stool, friction=(0.6, 1.4)).friction[1:]
    assert 0.6 <= friction.min() < 0.65
    assert 1.35 < friction.max() <= 1.4


def test_pushes_are_horizontal_in_all_directions_and_mid_episode(stool: Creature):
    starts = drawn(stool, push=0.2)
    push = starts.push[1:]
    assert not push[:, 2:].any()
    assert np.allclose(np.hypot(*push[:, :2].T), 0.2 * np.sqrt(9.81 * stool.frame.hip_height))
    assert all((np.sign(push[:, :2]) == way).all(1).any() for way in ((1, 1), (1, -1), (-1, 1)))
    assert starts.push_step[0] == NEVER
    assert ((starts.push_step[1:] >= 100) & (starts.push_step[1:] < 300)).all()


def test_each_part_has_its_own_mass_except_in_the_first_start(stool: Creature):
    starts = drawn(stool, masses=0.2)
    assert differing(starts, drawn(stool)) == {"mass_scale"}
    assert starts.mass_scale.shape == (COUNT, stool.model.nbody - 1)
    assert np.all(starts.mass_scale[0] == 1.0)
    assert 1.18 < starts.mass_scale[1:].max() <= 1.2
    assert 0.8 <= starts.mass_scale[1:].min() < 0.82


def test_torques_are_delayed_up_to_the_latency_except_in_the_first_start(stool: Creature):
    assert drawn(stool).delay is None
    delay = drawn(stool, latency=2).delay
    assert delay[0] == 0
    assert set(delay) == {0, 1, 2}


@pytest.fixture(scope="module")
def weighed(stool: Creature) -> Experiment:
    """A run with starts that differ only in the masses."""
    return build_experiment(stool, small_config(rollout={**NONE, "masses": 0.2, "starts": 3}))


def test_bodies_have_the_masses_of_their_starts(weighed: Experiment):
    """So are all derived numbers, by `Plant.with_mass_scale`; its own tests compare C MuJoCo."""
    simulator, starts, settings = weighed.simulator, weighed.starts, weighed.row.settings
    plain = simulator.plant.parameters
    masses = jax.jit(simulator.plant.with_mass_scale)(plain, starts.mass_scale[1])

    given = weighed.init().genomes, starts, settings
    genomes, *rows = jax.tree.map(lambda leaf: leaf[None], given)

    @jax.jit
    def lane() -> BodyState:
        """The body of a lane in the second start."""
        prepare = jax.vmap(jax.vmap(simulator.controller.prepare, (0, None)))
        plans = prepare(genomes, rows[-1].controller)
        place = jnp.int32(0)
        return simulator._fresh_lane(plans, *rows, None, place, jnp.int32(1)).body

    own = lane().parameters
    for leaf, its, one in zip(*map(jax.tree.leaves, (starts.parameters, masses, own)), strict=True):
        np.testing.assert_allclose(leaf[1], its, rtol=1e-6)
        np.testing.assert_array_equal(leaf[1], one)


@pytest.mark.thorough("test_evolve_body.py has a body per lane in episodes")
def test_other_masses_change_every_motion(weighed: Experiment):
    """The starts differ in nothing else."""
    forward = jax.jit(weighed.simulate)(weighed.init().genomes).stats.forward
    assert np.abs(np.diff(forward, axis=1)).max() > 1e-5


def test_every_held_command_ends_with_a_round():
    """Else a lane could begin an episode with the command of the previous one."""
    assert all(CHECK_EVERY % steps == 0 for steps in HOLDS)


def frictions(experiment: Experiment, state: EvolutionState, generation: int) -> list[float]:
    """Friction of the floor in each start of a generation."""
    latest = dataclasses.replace(state, generation=jnp.int32(generation - 1))
    return np.asarray(
        next_starts(experiment.simulator.task, experiment.row, latest).friction
    ).tolist()


def test_held_starts_change_every_third_generation(stool: Creature):
    config = small_config(
        rollout={"starts": 3, "variety": 4, "hold": 3, "friction": (0.6, 1.4)},
        evolution={"survival": "children", "elite": 0.1},
    )
    experiment = build_experiment(stool, config)
    state = experiment.init()
    first, *rest = (frictions(experiment, state, generation) for generation in range(-1, 7))
    assert rest[:3] == [first] * 3
    assert rest[3:6] == [rest[3]] * 3
    assert len({tuple(one) for one in rest}) == 3


def test_generations_have_different_starts_until_the_cycle_repeats(stool: Creature):
    config = small_config(
        rollout={"starts": 3, "variety": 4, "friction": (0.6, 1.4)},
        evolution={"survival": "children", "elite": 0.1},
    )
    experiment = build_experiment(stool, config)
    state = experiment.init()

    rounds = [frictions(experiment, state, generation) for generation in range(5)]
    assert {friction[0] for friction in rounds} == {1.0}
    assert len({friction for one in rounds[:4] for friction in one[1:]}) == 8
    assert rounds[4] == rounds[0]


def test_disturbances_grow_to_full_size_in_the_given_steps(stool: Creature):
    """Compiled, as in a run. Without steps, trials have full difficulty from the beginning."""
    rollout = {"seconds": 0.4, "starts": 5, "latency": 4, "promote": 1.0}
    row, plain, long = (
        build_experiment(stool, small_config(rollout=rollout, fitness={"hardening": steps}))
        for steps in (3, 0, 40)
    )
    full = row.row.starts
    assert row.init().level == 0
    assert plain.init().level is None
    assert not differing(jax.device_get(plain.row.starts), jax.device_get(full))

    def at(experiment: Experiment, level: int) -> Starts:
        now = dataclasses.replace(experiment.init(), level=jnp.int32(level))
        return jax.jit(next_starts, static_argnums=0)(
            experiment.simulator.task, experiment.row, now
        )

    assert np.array_equal(at(long, 40).delay, full.delay)
    for level, share in ((0, 0.25), (2, 0.75), (3, 1.0), (9, 1.0)):
        now = at(row, level)
        for field, usual in (
            ("qpos", full.qpos[0]),
            ("qvel", 0.0),
            ("friction", 1.0),
            ("push", 0.0),
            ("stiffness", 1.0),
            ("damping", 1.0),
        ):
            of_all = usual + share * (np.asarray(getattr(full, field)) - usual)
            assert np.allclose(getattr(now, field), of_all, atol=1e-6), field
        assert np.array_equal(now.delay, np.floor(share * np.asarray(full.delay)))
        assert np.array_equal(now.push_step, full.push_step)


@pytest.mark.parametrize(("fallen", "ready"), [(0.0, True), (0.2, True), (0.4, False)])
def test_few_falls_lead_to_harder_trials(stool: Creature, fallen: float, ready: bool):
    task = build_experiment(stool, small_config(fitness={"hardening": 3})).simulator.task
    assert task.has_curriculum
    assert task.levels(task.settings) == 3
    assert bool(task.level_passed({"fall": jnp.float32(fallen)})) == ready
