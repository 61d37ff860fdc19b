"""The pose cycle against its specification, docs/reference/controller.md."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import altered, pose_champion

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.key_poses.config import PoseConfig
from mjxgait.controllers.key_poses.controller import (
    PERIOD,
    PITCH,
    PITCH_RATE,
    READS,
    ROLL,
    ROLL_RATE,
    STEER,
    THRESHOLD,
    TUNING,
    GaitState,
    Genome,
    PoseTracker,
    corrections,
    interpolate,
    pose_cycle,
)
from mjxgait.controllers.key_poses.reference import PoseReference
from mjxgait.controllers.observations import sense
from mjxgait.creature import Creature
from mjxgait.types import Sensed


def random_poses(creature: Creature, count: int = 3) -> np.ndarray:
    return (
        np.random.default_rng(1)
        .uniform(
            creature.joints.pose_low, creature.joints.pose_high, (count, len(creature.joints.names))
        )
        .astype(np.float32)
    )


def sensed(
    creature: Creature,
    joints: np.ndarray,
    rotation: np.ndarray | None = None,
    offset: float = 0.0,
    spin: np.ndarray | None = None,
) -> dict[str, jax.Array]:
    """Observations of the controller."""
    nothing = jnp.zeros(3)
    moment = Sensed(
        joint_pos=jnp.asarray(joints, jnp.float32),
        joint_vel=jnp.zeros(len(joints)),
        bias=jnp.zeros(creature.model.nv),
        trunk_pos=jnp.asarray(np.add(creature.frame.stand_pos, [0, offset, 0]), jnp.float32),
        trunk_rot=jnp.asarray(np.eye(3) if rotation is None else rotation, jnp.float32),
        trunk_vel=nothing,
        trunk_angvel=nothing if spin is None else jnp.asarray(spin, jnp.float32),
        geom_pos=jnp.zeros((len(creature.feet.watched), 3)),
        geom_low=jnp.zeros(len(creature.feet.watched)),
    )
    return sense(creature, moment, jnp.zeros(()), READS)


def turned(axis: int, angle: float) -> np.ndarray:
    """Rotation about the world's x, y or z axis."""
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    rotation = np.eye(3)
    rotation[[i, j], [i, j]] = np.cos(angle)
    rotation[i, j], rotation[j, i] = -np.sin(angle), np.sin(angle)
    return rotation


def tracker(creature: Creature) -> PoseTracker:
    return PoseTracker(creature, 0.005)


def settings(**keys) -> PoseConfig:
    return dataclasses.replace(PoseConfig(key_poses=3, interpolation=4), **keys)


def tuning(**genes: float) -> jax.Array:
    values = dict.fromkeys(TUNING, 0.0) | {"threshold": 0.1, "period": 0.8} | genes
    return jnp.array([values[name] for name in TUNING])


@jax.jit
def target_at(cycle: jax.Array, position: int) -> jax.Array:
    """Target pose [J] at a position of a cycle of 6 poses with 4 steps between neighbours."""
    return interpolate(cycle, position, 4, 6)


def test_the_cycle_meets_key_poses_and_mirror_images_exactly(shipped: Creature):
    poses = random_poses(shipped)
    cycle = jax.jit(lambda own: pose_cycle(shipped, own))(poses)
    mirrored = (
        shipped.mirror.sign * poses[:, shipped.mirror.partner]
        if shipped.mirror.symmetric
        else poses[:0]
    )
    assert len(cycle) == len(poses) + len(mirrored)
    for i, pose in enumerate([*poses, *mirrored]):
        assert np.allclose(target_at(cycle, i * 4), pose, atol=1e-6)


def test_the_cycle_is_periodic_and_piecewise_linear(stool: Creature):
    cycle = pose_cycle(stool, jnp.asarray(random_poses(stool)))
    for s in range(24):
        a, f = s // 4, (s % 4) / 4
        expected = (1 - f) * np.asarray(cycle[a]) + f * np.asarray(cycle[(a + 1) % 6])
        assert np.allclose(target_at(cycle, s), expected, atol=1e-6)
        assert np.allclose(target_at(cycle, s + 24), expected, atol=1e-5)


def test_an_asymmetric_creature_is_not_mirrored(stool: Creature):
    lopsided = altered(stool, mirror={"symmetric": False})
    cycle = tracker(lopsided).prepare(
        Genome(jnp.asarray(random_poses(stool)), tuning()), settings()
    )
    assert cycle.poses.shape == (3, 4)
    assert int(cycle.count) == 3


def test_without_the_mirror_the_key_poses_are_the_whole_cycle(stool: Creature):
    poses = random_poses(stool)
    cycle = tracker(stool).prepare(
        Genome(jnp.asarray(poses), tuning(threshold=9.0)), settings(mirror=False)
    )
    for s in range(24):
        a, f = (s // 4) % 3, (s % 4) / 4
        expected = (1 - f) * poses[a] + f * poses[(a + 1) % 3]
        assert np.allclose(
            interpolate(cycle.poses, jnp.int32(s), 4, cycle.count), expected, atol=1e-6
        )


def test_in_phase_left_and_right_move_together(shipped: Creature):
    """Each new pose is its own mirror image, and children of two such parents are alike."""
    variation = tracker(shipped).variation(
        PoseConfig(mirror=False, key_poses=4, in_phase=True), EvolutionConfig()
    )

    @jax.jit
    def bred() -> tuple[Genome, Genome, Genome]:
        first = variation.create(jax.random.key(0), 2)
        mother, father = (jax.tree.map(lambda leaf, i=i: leaf[i], first) for i in range(2))
        mutant = variation.mutate(jax.random.key(1), mother)
        return mother, mutant, variation.cross(jax.random.key(2), mother, father)

    mother, mutant, child = jax.device_get(bred())
    assert np.any(mutant.key_poses != mother.key_poses)
    for genome in (mother, mutant, child):
        poses = np.asarray(genome.key_poses)
        assert np.ptp(poses, axis=0).max() > 0.1
        np.testing.assert_allclose(poses, shipped.mirror.image(poses), atol=1e-6)


def test_in_phase_keeps_what_relates_genes_already(stool: Creature):
    """Arms that swing with legs go on swinging with them."""
    joints = dataclasses.replace(stool.joints, swings=((1, 0, 0.5),))
    count = len(joints.names)
    alone = dataclasses.replace(
        stool.mirror, partners=tuple(range(count)), sign=np.ones(count), symmetric=True
    )
    body = dataclasses.replace(stool, joints=joints, mirror=alone)
    variation = tracker(body).variation(PoseConfig(mirror=False, in_phase=True), EvolutionConfig())
    poses = np.asarray(variation.create(jax.random.key(0), 3).key_poses)
    swung = joints.stand[1] + 0.5 * (poses[..., 0] - joints.stand[0])
    np.testing.assert_allclose(
        poses[..., 1], np.clip(swung, joints.pose_low[1], joints.pose_high[1]), atol=1e-6
    )


def test_the_cycle_advances_only_when_joints_follow(stool: Creature):
    control = tracker(stool)
    cycle = control.prepare(
        Genome(jnp.asarray(random_poses(stool)), tuning(threshold=0.1)), settings()
    )
    target = np.asarray(cycle.poses[0])
    _, blocked = control.act(cycle, control.init(), sensed(stool, target + 0.11))
    _, moved = control.act(cycle, control.init(), sensed(stool, target + 0.09))
    assert (int(blocked.position), int(moved.position)) == (0, 1)


def test_the_clock_advances_even_when_joints_are_blocked(stool: Creature):
    control = tracker(stool)
    cycle = control.prepare(
        Genome(jnp.asarray(random_poses(stool)), tuning(period=0.8)), settings(advance="clock")
    )
    state = GaitState(jnp.int32(0), jnp.int32(79))
    _, state = control.act(cycle, state, sensed(stool, stool.joints.stand + 1))
    assert int(state.position) == 12


@pytest.mark.parametrize("period", [0.8, 0.4, 0.64, 1.0, 0.35, 0.7123, 1.9, 0.2, 0.006])
@pytest.mark.parametrize(("interpolation", "mirror"), [(4, True), (7, False), (10, True)])
def test_the_clock_matches_the_reference_controller_on_every_step(
    stool: Creature, period: float, interpolation: int, mirror: bool
):
    """Over 8 s; exact arithmetic too where the step is a fraction of the period."""
    rules = settings(interpolation=interpolation, advance="clock", mirror=mirror)
    poses, genes = random_poses(stool), tuning(period=period)
    control = tracker(stool)
    cycle = control.prepare(Genome(jnp.asarray(poses), genes), rules)
    blocked = sensed(stool, stool.joints.stand + 1)

    def moved(state: GaitState, _: None) -> tuple[GaitState, jax.Array]:
        _, state = control.act(cycle, state, blocked)
        return state, state.position

    _, found = jax.lax.scan(moved, control.init(), length=1600)
    named = dict(zip(TUNING, map(float, genes), strict=True))
    examiner = PoseReference(stool, pose_champion(stool, poses, named, rules), 0.005)
    place, far = np.zeros(1601, int), np.ones((1601, 4))
    expected = examiner.advance(place, far, 0 * far, np.arange(1601))
    assert np.array_equal(found, expected[1:])
    if period in (0.8, 0.4, 0.64, 1.0, 0.35, 0.2):
        length = examiner.length
        exact = [k * length * 5 // round(1000 * period) % length for k in range(1, 1601)]
        assert np.array_equal(found, exact)


@pytest.mark.parametrize(
    ("gene", "rotation", "offset", "expected"),
    [
        (STEER, turned(2, 0.2), 0.0, ("steer_bend", 0.2)),
        (STEER, None, 0.1, ("steer_bend", 0.1)),
        (PITCH, turned(1, 0.2), 0.0, ("balance_pitch", 0.2)),
        (ROLL, turned(0, 0.2), 0.0, ("balance_roll", 0.2)),
        (STEER, turned(2, 2.0), 0.0, ("steer_bend", 0.5)),
    ],
    ids=[
        "turned left",
        "left of the line",
        "nose down",
        "right side down",
        "never more than half a radian",
    ],
)
def test_signs_of_the_corrections(
    stool: Creature,
    gene: int,
    rotation: np.ndarray | None,
    offset: float,
    expected: tuple[str, float],
):
    weight = {expected[0]: np.array([1.0, 0, 0, 0])}
    creature = altered(stool, corrections=weight, frame={"body_length": 0.5})
    genes = jnp.zeros(len(TUNING)).at[gene].set(1.0)
    change = corrections(
        creature,
        genes,
        jnp.asarray(stool.joints.stand, jnp.float32),
        sensed(stool, stool.joints.stand, rotation, offset),
    )
    assert np.allclose(change, [expected[1], 0, 0, 0], atol=1e-5)


@pytest.mark.parametrize(
    ("gene", "weight", "expected"),
    [(PITCH_RATE, "balance_pitch", 0.3), (ROLL_RATE, "balance_roll", 0.2)],
    ids=["nose falling", "right side falling"],
)
def test_trunk_rates_are_about_the_trunks_own_axes(
    stool: Creature, gene: int, weight: str, expected: float
):
    """The trunk faces left and also turns about the world's vertical."""
    creature = altered(stool, corrections={weight: np.array([1.0, 0, 0, 0])})
    left_turned = turned(2, np.pi / 2)
    moving = sensed(stool, stool.joints.stand, left_turned, spin=left_turned @ [0.2, 0.3, 5.0])
    genes, stand = (
        jnp.zeros(len(TUNING)).at[gene].set(1.0),
        jnp.asarray(stool.joints.stand, jnp.float32),
    )
    change = corrections(creature, genes, stand, moving)
    assert np.allclose(change, [expected, 0, 0, 0], atol=1e-5)


def test_steering_scales_the_stride(stool: Creature):
    """Offsets from the standing pose grow on the outer side of the turn."""
    creature = altered(stool, corrections={"steer_stride": np.array([1.0, -1.0, 0.5, 0])})
    genes, pose = jnp.zeros(len(TUNING)).at[STEER].set(1.0), np.array([0.3, 0.3, -0.2, 0.1])
    target = jnp.asarray(stool.joints.stand + pose, jnp.float32)
    change = corrections(creature, genes, target, sensed(stool, stool.joints.stand, turned(2, 0.2)))
    assert np.allclose(change, [0.06, -0.06, -0.02, 0], atol=1e-5)


def test_steering_gain_matches_the_reference_controller(stool: Creature):
    """The `steering` setting scales bend and stride alike."""
    weights = {"steer_bend": np.array([0.3, 0, 0, 0]), "steer_stride": np.array([0, -1.0, 0.5, 0])}
    creature, poses = altered(stool, corrections=weights), random_poses(stool)
    felt, genes = sensed(stool, stool.joints.stand, turned(2, 0.2)), tuning(steer=1.0)
    targets = []
    for rules in (settings(), settings(steering=2.0)):
        control = tracker(creature)
        cycle = control.prepare(Genome(jnp.asarray(poses), genes), rules)
        target, _ = control.act(cycle, control.init(), felt)
        named = dict(zip(TUNING, map(float, genes), strict=True))
        reference = PoseReference(creature, pose_champion(creature, poses, named, rules), 0.005)
        of_one = {name: np.asarray(value)[None] for name, value in felt.items()}
        np.testing.assert_allclose(
            target, reference.target(np.zeros(1, int), of_one, np.zeros(1, int))[0], atol=1e-5
        )
        targets.append(target - poses[0])
    np.testing.assert_allclose(targets[1], 2 * targets[0], atol=1e-5)


def test_targets_keep_to_the_joint_ranges(stool: Creature):
    narrow = altered(stool, joints={"low": np.full(4, -0.1), "high": np.full(4, 0.2)})
    control, poses = tracker(narrow), jnp.array([[3.0, -3.0, 0.1, 0.0]] * 2)
    cycle = control.prepare(Genome(poses, tuning()), settings(key_poses=2, mirror=False))
    target, _ = control.act(cycle, control.init(), sensed(stool, stool.joints.stand))
    assert np.allclose(target, [0.2, -0.1, 0.1, 0.0], atol=1e-6)


def test_without_genes_there_is_no_correction(shipped: Creature):
    @jax.jit
    def found(genes: jax.Array, target: np.ndarray) -> jax.Array:
        tipped = sensed(shipped, shipped.joints.stand, turned(0, 0.3) @ turned(2, 0.4), 0.3)
        return corrections(shipped, genes, target, tipped)

    target = np.asarray(shipped.joints.stand + 0.2, np.float32)
    assert not np.any(found(tuning(), target))
    assert np.any(found(tuning(steer=1.0, pitch=1.0, roll=1.0), target))


def test_genes_and_bounds_have_the_order_of_the_config(stool: Creature):
    low, high = tracker(stool).bounds(settings(key_poses=2))
    assert (TUNING[THRESHOLD], TUNING[PERIOD], TUNING[STEER]) == ("threshold", "period", "steer")
    assert np.allclose(low.key_poses, stool.joints.pose_low)
    assert bool(jnp.all(low.tuning <= high.tuning))
