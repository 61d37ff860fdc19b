"""Overlap of parts matches C MuJoCo: without neighbours, and beyond the standing pose."""

import dataclasses
import itertools
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from helpers import STOOL, small_config

from mjxgait.creature import Creature, load_creature
from mjxgait.creature.bars import bars_of
from mjxgait.creature.overlap import (
    bar_distance,
    bar_places,
    find_crossings,
    neighbours,
    pair_depths,
)
from mjxgait.physics.derived import observation_layout
from mjxgait.physics.lane_major import lane_major_plant
from mjxgait.physics.mjx import mjx_plant
from mjxgait.simulation.episode import Lane
from mjxgait.simulation.rollout import CHECK_EVERY, Simulator
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.terms import DEEP, TOUCHING
from mjxgait.tasks.walk.config import WalkConfig
from mjxgait.tasks.walk.fitness import fitness_terms
from mjxgait.tasks.walk.stats import StatsRecorder, WalkStats
from mjxgait.types import BodyState

LANES = 6
SLIM = {"xla_backend_optimization_level": 0}
"""Most of the time here is compilation."""


def depth_in_c(creature: Creature, qpos: np.ndarray) -> float:
    """Deepest overlap in m beyond the standing pose, without parent-child pairs."""
    model, data = creature.model, mujoco.MjData(creature.model)

    def depths(qpos: np.ndarray) -> np.ndarray:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        return np.array(
            [-mujoco.mj_geomDistance(model, data, a, b, 1.0, None) for a, b in strangers]
        )

    body, parent = model.geom_bodyid, model.body_parentid
    strangers = [
        (a, b)
        for a in range(model.ngeom)
        for b in range(a)
        if 0 not in (body[a], body[b])
        and body[a] != body[b]
        and body[a] != parent[body[b]]
        and body[b] != parent[body[a]]
    ]
    return float((depths(qpos) - np.maximum(depths(creature.stand_qpos), 0)).max())


def crossed(creature: Creature, rng: np.random.Generator) -> np.ndarray:
    """A pose [nq] in which the legs of each side cross, anywhere in the world."""
    qpos = creature.stand_qpos.copy()
    qpos[:3] += rng.normal(size=3)
    turn = rng.normal(size=4)
    qpos[3:7] = turn / np.linalg.norm(turn)
    toward = {"front": 1.0, "hind": -1.0}
    signs = np.array([toward[name.split("_")[0]] for name in creature.joints.names])
    qpos[creature.joints.qpos_adr] = signs * rng.uniform(0.7, 0.8, len(signs))
    return qpos


@pytest.fixture(scope="module")
def poses(stool: Creature) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.array([crossed(stool, rng) for _ in range(LANES)])


def edited(tmp_path: Path, *changes: tuple[str, str]) -> Creature:
    shutil.copytree(STOOL, tmp_path / "stool")
    file = tmp_path / "stool" / "creature.xml"
    text = file.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file.write_text(text)
    return load_creature(tmp_path / "stool")


@pytest.mark.parametrize("kinds", [("capsule", "capsule"), ("capsule", "sphere")])
def test_the_distance_of_two_bars_matches_c_mujoco(kinds: tuple[str, str]):
    """Bars that cross, lie side by side or end to end, are far apart, or are parallel."""
    geoms = "".join(
        f'<body mocap="true"><geom type="{kind}" size="0.05 {half}"/></body>'
        for kind, half in zip(kinds, (0.3, 0.2), strict=True)
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
    data, rng = mujoco.MjData(model), np.random.default_rng(1)
    halves = [0.3 * (kinds[0] == "capsule"), 0.2 * (kinds[1] == "capsule")]
    for trial in range(200):
        data.mocap_pos[:] = rng.uniform(-0.3, 0.3, (2, 3))
        data.mocap_quat[:] = rng.normal(size=(2, 4))
        if trial % 5 == 0:
            data.mocap_quat[1] = data.mocap_quat[0]
        data.mocap_quat /= np.linalg.norm(data.mocap_quat, axis=1, keepdims=True)
        mujoco.mj_kinematics(model, data)
        axes = data.geom_xmat.reshape(2, 3, 3)[:, :, 2]
        first, second = axes[0] * halves[0], axes[1] * halves[1]
        squared = (np.array(halves[0] ** 2), np.array(halves[1] ** 2))
        apart = data.geom_xpos[0] - data.geom_xpos[1]
        ours = bar_distance(tuple(apart), tuple(first), tuple(second), squared)
        theirs = mujoco.mj_geomDistance(model, data, 0, 1, 9.0, None)
        assert ours - 0.1 == pytest.approx(theirs, abs=1e-6)


@pytest.mark.parametrize("make", [lane_major_plant, mjx_plant], ids=["fast", "mjx"])
def test_both_plants_match_the_overlap_of_c_mujoco(make: Any, stool: Creature, poses: np.ndarray):
    plant = make(stool.evolution_model, observation_layout(stool), find_crossings(stool))
    state = states(stool, poses)
    if plant.lane_axis:
        state = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), state)
    depth = jax.jit(plant.overlap).lower(state).compile(compiler_options=SLIM)(state)
    expected = [depth_in_c(stool, qpos) for qpos in poses]
    assert min(expected) > 0.01
    assert np.ptp(expected) > 0.005
    np.testing.assert_allclose(depth, expected, atol=1e-6)


def states(creature: Creature, poses: np.ndarray) -> BodyState:
    """States in poses [L, nq], lanes first."""
    still = jnp.zeros((len(poses), creature.model.nv))
    return BodyState(jnp.asarray(poses, jnp.float32), still, still, still, jnp.ones(len(poses)))


def test_overlap_in_the_standing_pose_is_allowed(tmp_path: Path):
    """Front feet that overlap by 1 cm when standing do not count."""
    wide = edited(
        tmp_path,
        (
            '<geom name="front_left_foot" type="sphere" pos="0 0 -0.27" size="0.03"',
            '<geom name="front_left_foot" type="sphere" pos="0 -0.19 -0.27" size="0.03"',
        ),
    )
    pairs = find_crossings(wide)
    names = [wide.model.body(b).name for b in pairs.body]
    feet = [
        k
        for k in range(len(pairs.first))
        if {names[pairs.first[k]], names[pairs.second[k]]} == {"front_left", "front_right"}
    ]
    assert pairs.allowed[feet].max() == pytest.approx(0.01, abs=1e-6)
    assert pair_depths(pairs, *bar_places(wide.model, wide.stand_qpos, pairs)).max() <= 1e-9


MORE = pytest.mark.thorough("the crab and the lamp show it")
OTHERS = ("alien", "duck", "short_quadruped", "tall_quadruped")


@pytest.mark.parametrize(
    "shipped", ["crab", "luxo", *(pytest.param(n, marks=MORE) for n in OTHERS)], indirect=True
)
def test_pairs_are_reproducible_and_exclude_neighbours(shipped: Creature):
    pairs, again = find_crossings(shipped), find_crossings(shipped)
    assert 0 < len(pairs.first) <= 256
    for field in dataclasses.fields(pairs):
        assert np.array_equal(getattr(pairs, field.name), getattr(again, field.name))
    parent = shipped.model.body_parentid
    first, second = pairs.body[pairs.first], pairs.body[pairs.second]
    assert (first != second).all()
    assert (first != parent[second]).all()
    assert (second != parent[first]).all()


def test_the_crabs_claws_can_overlap_its_front_legs():
    from mjxgait.config.layers import find_creature

    crab = load_creature(find_creature("crab"))
    qpos = crab.stand_qpos.copy()
    for side in ("left", "right"):
        for joint, degrees in (("swing", 30), ("lift", 0), ("knee", -30)):
            index = crab.joints.names.index(f"front_{side}_{joint}")
            qpos[crab.joints.qpos_adr[index]] += np.radians(degrees)
    pairs = find_crossings(crab)
    assert pair_depths(pairs, *bar_places(crab.model, qpos, pairs)).max() > 0.02


CHAIN = """
<mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1"/>
  <body name="ring"><joint axis="0 0 1"/><geom size="0.01"/>
    <body name="hip"><joint axis="1 0 0" pos="0.005 0 0"/><geom size="0.01"/>
      <body name="thigh"><joint axis="0 1 0"/><geom size="0.01" pos="0 0 -0.2"/>
        <body name="plate"><geom size="0.01" pos="0 0 -0.3"/>
          <body name="shin" pos="0 0 -0.4"><joint axis="0 1 0"/><geom size="0.01"/></body>
        </body></body></body></body>
  <body name="tail" pos="-0.3 0 0"><joint axis="0 1 0"/><geom size="0.01"/></body>
</body></worldbody></mujoco>"""


def test_neighbours_meet_at_one_joint():
    model = mujoco.MjModel.from_xml_string(CHAIN)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    near = neighbours(model, data, 0.02)

    def joined(a: str, b: str) -> bool:
        return bool(near[model.body(a).id, model.body(b).id])

    for pair in (("trunk", "thigh"), ("trunk", "plate"), ("thigh", "shin"), ("plate", "shin")):
        assert joined(*pair), pair
    for pair in (("trunk", "shin"), ("hip", "shin"), ("tail", "thigh")):
        assert not joined(*pair), pair
    assert joined("tail", "trunk")


@pytest.mark.parametrize(
    ("shape", "least"),
    [
        ('type="box" size="0.3 0.2 0.05"', 3),
        ('type="ellipsoid" size="0.2 0.06 0.05"', 1),
        ('type="cylinder" size="0.03 0.2"', 1),
        ('type="cylinder" size="0.2 0.02"', 3),
        ('type="mesh" mesh="wedge"', 1),
    ],
)
def test_bars_lie_inside_their_shape_and_fill_it(shape: str, least: int):
    """No point on a bar's surface is outside the shape; the bars span most of its length."""
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><asset><mesh name="wedge"
        vertex="0 0 0 .3 0 0 .3 .1 0 0 .1 0 0 0 .1 0 .1 .1 .3 0 .02 .3 .1 .02"/></asset>
      <worldbody><body><geom {shape}/></body>
      <body mocap="true"><geom size="0.001"/></body></worldbody></mujoco>""")
    data, rng = mujoco.MjData(model), np.random.default_rng(2)
    bars = bars_of(model, 0)
    assert len(bars) >= least
    for bar in bars:
        for _ in range(50):
            way = rng.normal(size=3)
            at = bar.centre + rng.choice([-1, 1]) * bar.half
            data.mocap_pos[0] = at + bar.radius * 0.98 * way / np.linalg.norm(way)
            mujoco.mj_kinematics(model, data)
            assert mujoco.mj_geomDistance(model, data, 0, 1, 1.0, None) < 1e-3
    ends = [bar.centre + sign * bar.half for bar in bars for sign in (-1, 1)]
    size = 2 * model.geom_aabb[0, 3:].max()
    assert np.ptp(ends, axis=0).max() + 2 * min(bar.radius for bar in bars) > 0.65 * size


@pytest.mark.parametrize("size", ["0.3 0.2 0.05", "0.04 0.3 0.05", "0.2 0.03 0.02"])
def test_bars_nearly_cover_the_long_edges_of_a_box(size: str):
    """Round bars as thick as the box would leave two fifths of its half thickness uncovered at the
    edges. Legs hang at the sides of a trunk.
    """
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><geom type="box" size="{size}"/></body></worldbody></mujoco>'
    )
    half, bars = model.geom_size[0], bars_of(model, 0)
    for side in itertools.product((-1.0, 1.0), repeat=3):
        edge = np.array(side) * half
        edge[half.argmax()] *= 0.5
        apart = [tuple(edge - bar.centre) for bar in bars]
        points = (0.0, 0.0, 0.0)
        bare = [
            bar_distance(to, points, tuple(bar.half), (0.0, bar.half @ bar.half)) - bar.radius
            for to, bar in zip(apart, bars, strict=True)
        ]
        assert -1e-9 < min(bare) < 0.12 * half.min()


def test_statistics_keep_the_deepest_counted_overlap(stool: Creature):
    """Lanes whose episode has ended, or whose state is not a number, do not count."""
    evaluate = StatsRecorder(stool, 0.005, 8)
    steps = jnp.array([CHECK_EVERY, CHECK_EVERY, 100, CHECK_EVERY, CHECK_EVERY])
    reasons = [Reason.FINISHED, Reason.FINISHED, Reason.FINISHED, Reason.TIPPED, Reason.FINISHED]
    stats = jax.tree.map(lambda leaf: jnp.stack([leaf] * 5), evaluate.init())
    stats = dataclasses.replace(
        stats,
        steps=steps,
        reason=jnp.array(reasons),
        overlap=jnp.array([0.0, 0.04, 0.0, 0.0, 0.01]),
    )
    depth = jnp.array([0.03, 0.03, 0.03, 0.03, jnp.nan])
    simulator = cast(
        Any, SimpleNamespace(plant=SimpleNamespace(overlap=lambda _: depth), steps=100)
    )
    fields = dict.fromkeys(field.name for field in dataclasses.fields(Lane))
    lane = cast(Any, Lane)(**(fields | {"stats": stats}))
    found = Simulator._look_for_overlap(simulator, lane).stats
    np.testing.assert_allclose(found.overlap, [0.03, 0.04, 0.0, 0.0, 0.01])


def term(creature: Creature, stats: WalkStats, forward: float) -> float:
    config = WalkConfig(speed=1.0)
    stats = dataclasses.replace(
        stats, forward=jnp.float32(forward * creature.frame.body_length), steps=jnp.int32(200)
    )
    return float(fitness_terms(creature, config, 0.005, 200, stats)["overlap"])


def test_the_overlap_term_grows_with_depth_and_distance_walked(stool: Creature):
    empty = StatsRecorder(stool, 0.005, 8).init()

    def at(depth: float, forward: float = 1.0) -> float:
        metres = jnp.float32(depth * stool.frame.hip_height)
        return term(stool, dataclasses.replace(empty, overlap=metres), forward)

    assert at(0.0) == at(0.9 * TOUCHING) == 0.0
    assert at(TOUCHING + DEEP) == pytest.approx(0.5, abs=1e-5)
    assert 0.5 < at(0.2) < at(0.5) < 1.0
    assert at(TOUCHING + DEEP, forward=0.5) == pytest.approx(0.25, abs=1e-5)
    assert at(0.5, forward=0.0) == 0.0


def test_only_the_individual_with_crossing_legs_has_overlap(stool: Creature):
    """Fewer lanes than individuals: one with crossing legs among others that stand still."""
    from mjxgait.training.experiment import build_experiment

    experiment = build_experiment(stool, small_config(rollout={"lanes": 3}))
    low, high = experiment.simulator.controller.bounds(experiment.config.controller)
    signs = np.array([1.0 if "front" in name else -1.0 for name in stool.joints.names])
    standing = np.broadcast_to(stool.joints.stand, low.key_poses.shape)
    poses = np.stack([standing] * 7)
    poses[2] = np.where(signs > 0, high.key_poses, low.key_poses)
    genomes = dataclasses.replace(
        low,
        **{
            field.name: jnp.stack([getattr(low, field.name)] * 7)
            for field in dataclasses.fields(low)
        },
    )
    genomes = dataclasses.replace(genomes, key_poses=jnp.asarray(poses, jnp.float32))
    # The same program as in test_rollout.py.
    depth = jax.jit(experiment.simulate)(genomes, experiment.starts).stats.overlap
    assert (depth[2] > 0.001).all()
    assert (np.delete(np.asarray(depth), 2, axis=0) == 0).all()
