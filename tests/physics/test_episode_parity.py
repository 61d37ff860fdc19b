"""The same episodes in lane-major physics, plain MJX and the reference simulator: all must agree.

The reference simulator is C MuJoCo in float64 with its own controller. The statistics of its
recordings are computed again in plain NumPy (`recorded_stats`). A change to the motion or to a
statistic in one of the three cannot pass unnoticed.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from disturbed_walks import (
    CONFIGS,
    DISTURBANCES,
    EPISODES,
    FALL,
    FIELDS,
    GENES_OF_THE_GAIT,
    LENIENT,
    PUSH_AT,
    SECONDS,
    SETTINGS,
    STEP,
    STEPS,
    disturbed,
    make_body,
    poses,
    tolerance,
    watched,
)
from helpers import STILL, small_config
from recorded_stats import Frames, end, stats_of

from mjxgait.config.traced import traced
from mjxgait.controllers.key_poses.controller import TUNING as GENES
from mjxgait.controllers.key_poses.controller import Genome
from mjxgait.creature import Creature
from mjxgait.reference.outcome import Outcome
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.starts import NEVER, Starts
from mjxgait.tasks.walk.stats import WalkStats
from mjxgait.training.experiment import build_experiment

SLIM = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": True}
"""Most of the time is compilation. The older emitter rounds differently and changes an episode."""


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    return make_body(tmp_path_factory.mktemp("parity"))


@pytest.fixture(scope="module")
def outcomes(body: Creature) -> list[Outcome]:
    return watched(body)


def starts_of(creature: Creature, films: list[Outcome]) -> Starts:
    """The same starts for evolution, [B, R]; certification lifts bodies with displaced joints."""
    rows, wanted = disturbed(creature), []
    push = np.zeros((len(rows), creature.model.nv))
    push[:, :2] = rows.push
    for outcome in films:
        film = outcome.trajectory
        at = np.where(np.isfinite(rows.push_time), PUSH_AT, NEVER)
        arrays = {
            "qpos": film.qpos[:, 0],
            "qvel": film.qvel[:, 0],
            "friction": rows.friction,
            "push": push,
            "stiffness": rows.stiffness,
            "damping": rows.damping,
        }
        floats = {name: jnp.asarray(array, jnp.float32) for name, array in arrays.items()}
        whole = {"push_step": jnp.int32(at), "delay": jnp.int32(rows.delay)}
        wanted.append(Starts(**floats, **whole))
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *wanted)


MJX = pytest.mark.thorough("test_ground_parity.py compares the fast step with MJX")


@pytest.fixture(
    scope="module",
    params=["auto", pytest.param("mjx", marks=MJX)],
    ids=["the fast step", "plain MJX"],
)
def statistics(
    request: pytest.FixtureRequest, body: Creature, outcomes: list[Outcome]
) -> WalkStats:
    """Statistics of evolution, leaves [B, 1, R, ...]."""
    rollout = {"seconds": SECONDS, "lanes": 3, "physics": request.param, **LENIENT}
    simulator = build_experiment(body, small_config(rollout=rollout)).simulator
    genes = STILL | GENES_OF_THE_GAIT
    genome = Genome(jnp.float32(poses(body)), jnp.float32([genes[name] for name in GENES]))
    genomes = jax.tree.map(lambda leaf: jnp.stack([leaf[None]] * len(CONFIGS)), genome)
    settings = jax.tree.map(lambda *leaves: jnp.stack(leaves), *map(traced, CONFIGS))
    arguments = (genomes, starts_of(body, outcomes), settings)
    program = jax.jit(simulator.simulate).lower(*arguments).compile(compiler_options=SLIM)
    return jax.device_get(program(*arguments)).stats


@pytest.fixture(scope="module")
def expected(
    body: Creature, outcomes: list[Outcome]
) -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """Statistics from the reference simulator's recordings, by settings and disturbance."""
    found = {}
    for name, config, outcome in zip(SETTINGS, CONFIGS, outcomes, strict=True):
        clearance = config.fitness.clearance * body.frame.hip_height
        for row, disturbance in enumerate(DISTURBANCES):
            frames = Frames(body, outcome.trajectory, row)
            steps, reason = end(frames, FALL)
            if steps > STEPS:
                steps, reason = STEPS, Reason.FINISHED
            stats = stats_of(frames, steps, STEPS // 2, clearance)
            found[name, disturbance] = {**stats, "reason": reason}
    return found


def test_every_statistic_is_compared(expected: dict):
    for name in FIELDS:
        assert all(name in stats for stats in expected.values()), (
            f"WalkStats.{name} is compared with nothing: work it out in recorded_stats.py, or say "
            "in UNCOMPARED why not"
        )


@pytest.mark.parametrize("name", FIELDS)
def test_statistics_match_the_reference_simulator(statistics: WalkStats, expected: dict, name: str):
    rows = dict(
        zip(EPISODES, np.reshape(getattr(statistics, name), (len(EPISODES), -1)), strict=True)
    )
    for episode, ours in rows.items():
        theirs = np.ravel(np.asarray(expected[episode][name], float))
        most = tolerance(name, theirs)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=most, err_msg=str(episode))


@pytest.mark.parametrize("name", [name for name in FIELDS if name != "reason"])
def test_every_statistic_is_nonzero_somewhere(expected: dict, name: str):
    """A value near zero in all episodes would agree with anything."""
    values = [np.asarray(stats[name], float) for stats in expected.values()]
    assert any(np.abs(value).max() > 3 * tolerance(name, value) for value in values)


def apart(one: dict, other: dict) -> float:
    """Distance between the final poses of two episodes, in tolerances."""
    places = ("forward", "left", "heading")
    return max(abs(one[name] - other[name]) / tolerance(name, one[name]) for name in places)


@pytest.mark.parametrize("disturbance", list(DISTURBANCES)[1:])
def test_every_disturbance_changes_the_motion(expected: dict, disturbance: str):
    one, other = (expected["stable PD", name] for name in (disturbance, "nominal"))
    assert apart(one, other) > 5


@pytest.mark.parametrize("settings", list(SETTINGS)[1:])
def test_every_setting_changes_the_motion(expected: dict, settings: str):
    one, other = (expected[name, "pushed to the left"] for name in (settings, "stable PD"))
    assert apart(one, other) > 5


def test_a_fall_ends_the_episode_at_the_reference_simulators_time(
    outcomes: list[Outcome], statistics: WalkStats
):
    """Reasons are compared above; the reference simulator dates a fall by the end of its step."""
    knocked = list(DISTURBANCES).index("knocked over")
    for row, name in enumerate(SETTINGS):
        fell = round(outcomes[row].fell[knocked] / STEP)
        assert PUSH_AT < fell < STEPS, name
        assert statistics.steps[row, 0, knocked] == fell, name
        assert statistics.reason[row, 0, knocked] != Reason.FINISHED
