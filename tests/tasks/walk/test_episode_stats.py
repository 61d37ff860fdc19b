"""Running episode statistics and the end of an episode, against values from whole recordings."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certify_made_up import LEGS
from disturbed_walks import (
    CONFIGS,
    DISTURBANCES,
    EPISODES,
    FIELDS,
    STEP,
    STEPS,
    make_body,
    tolerance,
    watched,
)
from recorded_stats import Frames, end, stats_of

from mjxgait.creature import Creature
from mjxgait.tasks.falls import Reason, why_fallen
from mjxgait.tasks.walk.stats import CONTACT_GAP, StatsRecorder, WalkStats
from mjxgait.tasks.walk.target_stats import TargetStats, target_stats, target_updated
from mjxgait.types import Sensed


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    return make_body(tmp_path_factory.mktemp("stats"))


@pytest.fixture(scope="module")
def recordings(body: Creature) -> list[Frames]:
    """Recordings of all episodes, including falls and what follows them."""
    films = [outcome.trajectory for outcome in watched(body)]
    return [Frames(body, film, row) for film in films for row in range(len(DISTURBANCES))]


def clearance_of(body: Creature) -> float:
    return CONFIGS[0].fitness.clearance * body.frame.hip_height


def sensed_of(frames: Frames) -> Sensed:
    """Sensed values as for a controller, [T, ...]; the statistics use no bias and no velocity."""
    count, nothing = len(frames.qpos), np.zeros((len(frames.qpos), 3))
    heights = np.zeros((count, frames.low.shape[1], 1))
    sensed = Sensed(
        joint_pos=frames.joints,
        joint_vel=frames.speeds,
        bias=nothing,
        trunk_pos=frames.trunk_pos,
        trunk_rot=frames.trunk_rot,
        trunk_vel=nothing,
        trunk_angvel=frames.spin,
        geom_pos=np.concatenate([frames.place, heights], axis=2),
        geom_low=frames.low,
    )
    return jax.tree.map(lambda leaf: jnp.asarray(leaf[:STEPS], jnp.float32), sensed)


@pytest.fixture(scope="module")
def evaluation(body: Creature, recordings: list[Frames]) -> tuple[TargetStats, jax.Array]:
    """Statistics [E, ...] of whole episodes, and the reason to end at each step, [E, T]."""
    ends = body.settings.termination
    evaluate, clearance = StatsRecorder(body, STEP, STEPS // 2), jnp.float32(clearance_of(body))

    def episode(sensed: Sensed, torque: jax.Array) -> tuple[TargetStats, jax.Array]:
        def step(stats: TargetStats, now: tuple) -> tuple[TargetStats, jax.Array]:
            after = evaluate.update(stats, *now, clearance)
            return target_updated(body, stats, after, now[0]), why_fallen(body, ends, now[0])

        return jax.lax.scan(step, target_stats(evaluate.init(), 4), (sensed, torque))

    sensed = jax.tree.map(lambda *rows: jnp.stack(rows), *map(sensed_of, recordings))
    torque = jnp.float32([frames.torque[:STEPS] for frames in recordings])
    return jax.device_get(jax.jit(jax.vmap(episode))(sensed, torque))


@pytest.fixture(scope="module")
def expected(body: Creature, recordings: list[Frames]) -> list[dict]:
    return [stats_of(frames, STEPS, STEPS // 2, clearance_of(body)) for frames in recordings]


@pytest.mark.parametrize("name", [name for name in FIELDS if name != "reason"])
def test_running_sums_match_the_recordings(
    evaluation: tuple[WalkStats, jax.Array], expected: list[dict], name: str
):
    rows = zip(EPISODES, getattr(evaluation[0], name), expected, strict=True)
    for episode, ours, stats in rows:
        theirs = np.asarray(stats[name], float)
        most = tolerance(name, theirs)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=most, err_msg=str(episode))


@pytest.mark.parametrize(("contact", "down"), [(CONTACT_GAP, 1), (0.0, 0)])
def test_a_near_foot_is_down_only_within_the_contact_gap(
    body: Creature, recordings: list[Frames], contact: float, down: int
):
    sensed = jax.tree.map(lambda leaf: leaf[0], sensed_of(recordings[0]))
    near = dataclasses.replace(sensed, geom_low=jnp.full_like(sensed.geom_low, 0.5 * CONTACT_GAP))
    evaluate = StatsRecorder(body, STEP, STEPS // 2, contact)
    stats = evaluate.update(
        evaluate.init(), near, jnp.zeros(len(body.joints.names)), jnp.float32(0.1)
    )
    assert np.all(stats.contact == down)
    assert stats.airborne == 1 - down


def test_reach_and_pitch_are_summed_from_the_same_moments(
    evaluation: tuple[TargetStats, jax.Array], recordings: list[Frames]
):
    statistics = evaluation[0]
    for row, frames in enumerate(recordings):
        nose = frames.trunk_rot[:STEPS] @ frames.creature.frame.forward
        level = nose[:, :2] / np.linalg.norm(nose[:, :2], axis=1, keepdims=True)
        place, low = frames.place[:STEPS, :4], frames.low[:STEPS, :4]
        ahead = ((place - frames.trunk_pos[:STEPS, None, :2]) * level[:, None]).sum(2)
        moved = (ahead - [x for x, _ in LEGS.values()]) * (low < CONTACT_GAP)
        np.testing.assert_allclose(statistics.reach[row], moved.sum(0), atol=0.02)
        np.testing.assert_allclose(statistics.pitch[row], -np.arcsin(nose[:, 2]).sum(), atol=0.02)
    assert np.abs(statistics.reach).max() > 0.2
    assert np.abs(statistics.pitch).max() > 0.2


def test_an_episode_ends_when_the_recording_does(
    evaluation: tuple[WalkStats, jax.Array], recordings: list[Frames]
):
    found = set()
    for episode, reasons, frames in zip(EPISODES, evaluation[1], recordings, strict=True):
        steps, why = end(frames)
        ends = np.flatnonzero(reasons)
        assert (ends[0] if len(ends) else STEPS) == min(steps, STEPS), episode
        if len(ends):
            assert reasons[ends[0]] == why, episode
            found.add(why)
    assert Reason.TIPPED in found
