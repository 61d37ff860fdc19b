"""Blocks of two bodies that push each other, and the cube."""

import dataclasses
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from end_to_end.unevolved import embodied

from mjxgait.api import load_creature
from mjxgait.controllers.sims_brain.reference_body import CUBE, CUBE_DENSITY
from mjxgait.physics.batched_trees.arena import cube_tree, resting
from mjxgait.physics.batched_trees.collision import Boxes, gap, pushes
from mjxgait.physics.batched_trees.dynamics import weighed
from mjxgait.physics.lane_major.lanes import pinned_by
from mjxgait.plugins.registry import build_config
from mjxgait.reference.contest import contest_of
from mjxgait.simulation.episode import first_body
from mjxgait.training.experiment import build_experiment
from mjxgait.types import BodyState

LANES, STEP = 16, 0.01


def boxes(seed: int, count: int, apart: float = 0.3) -> Boxes:
    """Blocks [count, LANES] at random places within `apart` m, in random attitudes and motion."""
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(count, LANES, 3, 3)))[0]

    def vector(spread: float) -> tuple[jax.Array, jax.Array, jax.Array]:
        x, y, z = jnp.asarray(rng.uniform(-spread, spread, (3, count, LANES)), jnp.float32)
        return x, y, z

    def axis(number: int) -> tuple[jax.Array, jax.Array, jax.Array]:
        x, y, z = (jnp.asarray(axes[..., number, c], jnp.float32) for c in range(3))
        return x, y, z

    half = tuple(jnp.asarray(rng.uniform(0.05, 0.2, (count, LANES)), jnp.float32) for _ in range(3))
    mass = 8000 * half[0] * half[1] * half[2]
    return Boxes(
        vector(apart),
        (axis(0), axis(1), axis(2)),
        half,
        mass,
        jnp.ones((count, LANES)),
        vector(3.0),
        vector(1.0),
    )


PUSHES = jax.jit(lambda one, other: pushes(one, other, STEP, pinned_by(one.mass[0])))


def pushed(one: Boxes, other: Boxes) -> tuple[np.ndarray, np.ndarray]:
    """Moments and forces, [n, 6, L] and [m, 6, L]."""
    first, second = PUSHES(one, other)
    return np.asarray(first), np.asarray(second)


def test_two_bodies_push_each_other_alike():
    """Momentum and angular momentum stay: all forces cancel out, and so do all moments."""
    one, other = boxes(0, 3), boxes(1, 2)
    mine, its = pushed(one, other)
    assert (np.abs(mine[:, 3:]).max((0, 1)) > 1).mean() > 0.5
    np.testing.assert_allclose(mine[:, 3:].sum(0), -its[:, 3:].sum(0), rtol=1e-4, atol=1e-2)

    def about_origin(body: Boxes, force: np.ndarray) -> np.ndarray:
        middle = np.stack([np.asarray(c) for c in body.middle], axis=1)
        arms = np.cross(np.moveaxis(middle, 1, -1), np.moveaxis(force[:, 3:], 1, -1))
        return force[:, :3].sum(0) + np.moveaxis(arms, -1, 1).sum(0)

    total = about_origin(one, mine) + about_origin(other, its)
    assert np.abs(total).max() < 1e-4 * np.abs(mine).max()


def test_blocks_that_approach_are_pushed_apart_and_slowed():
    one, other = boxes(2, 1, 0.02), boxes(3, 1, 0.02)
    still = tuple(jnp.zeros((1, LANES)) for _ in range(3))
    place = (jnp.full((1, LANES), 0.15), *still[1:])
    one = dataclasses.replace(one, spin=still, drift=still)
    other = dataclasses.replace(other, middle=place, spin=still, drift=still)
    mine, _ = pushed(one, other)
    between = np.stack([np.asarray(a - b)[0] for a, b in zip(one.middle, place, strict=True)])
    touching = np.abs(mine[0, 3:]).max(0) > 0
    assert touching.mean() > 0.5
    assert ((mine[0, 3:] * between).sum(0)[touching] > 0).all()
    nearer = dataclasses.replace(one, drift=(jnp.full((1, LANES), 0.5), *still[1:]))
    faster, _ = pushed(nearer, other)
    assert (faster[0, 3] <= mine[0, 3] + 1e-3).all()
    assert (faster[0, 3] < mine[0, 3])[touching].all()


def test_blocks_that_are_apart_or_missing_push_nothing():
    one, other = boxes(4, 3, 0.1), boxes(5, 2, 0.1)
    far = dataclasses.replace(other, middle=(other.middle[0] + 3.0, *other.middle[1:]))
    assert not np.abs(pushed(one, far)[0]).any()
    missing = dataclasses.replace(other, solid=jnp.zeros((2, LANES)))
    mine, its = pushed(one, missing)
    assert not np.abs(mine).any()
    assert not np.abs(its).any()


def test_friction_stops_a_block_that_slides_on_another():
    """The force on it points against its slip, and is at most friction times the pressure."""
    still = tuple(jnp.zeros((1, LANES)) for _ in range(3))
    one = tuple(jnp.full((1, LANES), float(k)) for k in range(2))
    axes = (
        (one[1], one[0], one[0]),
        (one[0], one[1], one[0]),
        (one[0], one[0], one[1]),
    )
    half = tuple(jnp.full((1, LANES), 0.1) for _ in range(3))
    slab = Boxes(still, axes, half, 8 * one[1], one[1], still, still)
    above = (*still[:2], jnp.full((1, LANES), 0.19))
    slides = (jnp.linspace(-1, 1, LANES)[None], *still[1:])
    block = dataclasses.replace(slab, middle=above, drift=slides)
    force = pushed(block, slab)[0][0, 3:]
    speed = np.asarray(slides[0])[0]
    assert (force[2] > 0).all()
    assert (force[0] * speed <= 0).all()
    assert (np.abs(force[0]) <= 0.9 * force[2] * 1.001).all()
    assert np.abs(force[0][np.abs(speed) > 0.5]) == pytest.approx(0.9 * force[2][0], rel=1e-3)


def test_the_gap_is_the_distance_to_the_nearest_block():
    body, rng = boxes(6, 3, 0.6), np.random.default_rng(7)
    point = rng.uniform(-1, 1, (3, LANES)).astype(np.float32)
    found = np.asarray(gap(body, (point[0], point[1], point[2])))
    for lane in range(LANES):
        each = []
        for n in range(3):
            axes = np.array([[np.asarray(c)[n, lane] for c in axis] for axis in body.axes])
            middle = np.array([np.asarray(c)[n, lane] for c in body.middle])
            half = np.array([np.asarray(h)[n, lane] for h in body.half])
            local = axes @ (point[:, lane] - middle)
            each.append(np.linalg.norm(local - np.clip(local, -half, half)))
        assert found[lane] == pytest.approx(min(each), abs=1e-5)


def test_the_cube_weighs_as_any_body_of_its_shape():
    cube = cube_tree(CUBE, CUBE_DENSITY)
    known = jax.jit(weighed)(cube)
    np.testing.assert_allclose(cube.body_weight[:1], known.body_weight[:1], rtol=1e-5)
    np.testing.assert_allclose(cube.dof_weight[:1], known.dof_weight[:1], rtol=1e-5)
    assert float(cube.mass.sum()) == pytest.approx(CUBE_DENSITY * CUBE**3)
    assert resting(cube, jnp.zeros(8)).qvel.shape == (7,)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><freejoint/><geom type="box" size="{CUBE / 2} {CUBE / 2} {CUBE / 2}"'
        f' density="{CUBE_DENSITY}"/></body></worldbody></mujoco>'
    )
    np.testing.assert_allclose(cube.inertia[0], model.body_inertia[1], rtol=1e-5)


@pytest.fixture(scope="module")
def contest() -> SimpleNamespace:
    """A body and an opponent that grew, with their cube: evolution's plant, and MuJoCo's model."""
    table = {
        "use": {"controller": "brain", "task": "compete"},
        "controller": {"nodes": 2, "parts": 2, "links": 2, "local": 1, "central": 1},
        "evolution": {
            "population": 12,
            "survival": "children",
            "elite": 0.25,
            "forced": {"enabled": False},
        },
    }
    blocks = load_creature("blocks")
    experiment = build_experiment(blocks, build_config(table, "test"))
    state = embodied(experiment)
    one = jax.tree.map(lambda leaf: jnp.asarray(leaf[0]), state.genomes)
    met = dataclasses.replace(one, opponent=dataclasses.replace(one, opponent=None))
    own = jax.tree.map(lambda leaf: leaf[None], met)
    blank = np.zeros((1, 1, 3))
    known = dataclasses.replace(state, genomes=own, fitness=blank[0, 0], terms=blank, outcome=blank)
    creature = experiment.champion(known, {}).embodied(blocks)
    start = jax.tree.map(lambda leaf: leaf[0], experiment.starts)
    body = first_body(jax.jit(experiment.simulator.grow)(met, start))
    return SimpleNamespace(plant=experiment.simulator.plant, body=body, creature=creature)


SEEDS = range(3)


@pytest.fixture(scope="module")
def thrown(contest: SimpleNamespace) -> list[SimpleNamespace]:
    """Bodies and cube thrown into each other, once per seed: states, and evolution's step.

    after: the next states; alone: without the pushes; moved: the body's with them as torques.
    """
    states = [contest.body, contest.body.ground.opponent, contest.body.ground.cube]
    hinges = [np.flatnonzero(np.asarray(state.parameters.moves)[1:] > 0) for state in states]
    each = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        each.append([_thrown(rng, *pair) for pair in zip(states, hinges, strict=True)])
    lanes = [
        dataclasses.replace(
            own, ground=dataclasses.replace(contest.body.ground, opponent=other, cube=cube)
        )
        for own, other, cube in each
    ]
    lane = jax.tree.map(lambda *leaves: jnp.stack(leaves, axis=-1), *lanes)
    plant = contest.plant
    sensed, moment = jax.jit(plant.forward)(lane)
    advance, still = jax.jit(plant.advance), jnp.zeros_like(lane.qvel)
    loose = dataclasses.replace(moment, push=jax.tree.map(jnp.zeros_like, moment.push))
    found = {
        "sensed": sensed,
        "push": moment.push,
        "after": advance(lane, moment, still),
        "alone": advance(lane, loose, still),
        "moved": advance(lane, loose, moment.push[0]),
    }
    return [
        SimpleNamespace(
            states=own,
            hinges=hinges,
            **jax.tree.map(lambda leaf, at=seed: np.asarray(leaf)[..., at : at + 1], found),
        )
        for seed, own in zip(SEEDS, each, strict=True)
    ]


@pytest.mark.parametrize("seed", SEEDS)
def test_pushes_are_the_joints_forces_that_mujoco_computes_from_them(
    contest: SimpleNamespace, thrown: list[SimpleNamespace], seed: int
):
    """Bodies and cube thrown into each other: generalised forces, and distances from the cube."""
    model, own = contest.creature.model, thrown[seed]
    np.testing.assert_allclose(own.after.qvel, own.moved.qvel, rtol=1e-3, atol=1e-3)
    three = [(one, one.ground.opponent, one.ground.cube) for one in (own.after, own.alone)]
    for one, other, push in zip(*three, own.push, strict=True):
        assert (np.abs(one.qvel - other.qvel).max() > 0.01) == (np.abs(push).max() > 1)
    data = mujoco.MjData(model)
    places = [np.append(np.arange(7), 7 + moves) for moves in own.hinges]
    dofs = [np.append(np.arange(6), 6 + moves) for moves in own.hinges]
    pairs = zip(own.states, places, dofs, strict=True)
    poses, speeds = zip(*((s.qpos[p], s.qvel[d]) for s, p, d in pairs), strict=True)
    data.qpos[:], data.qvel[:] = np.concatenate(poses), np.concatenate(speeds)
    mujoco.mj_forward(model, data)
    found = contest_of(contest.creature)
    assert found is not None
    geoms = [*found.geoms, np.array([found.cube])]
    expected = _applied(model, data, geoms)
    mine = np.concatenate([p[d, 0] for p, d in zip(own.push, dofs, strict=True)])
    assert np.abs(expected).max() > 10
    np.testing.assert_allclose(mine, expected, atol=1e-4 * np.abs(expected).max())
    gaps = found.gaps(data.geom_xpos[None], data.geom_xmat[None])[0]
    np.testing.assert_allclose(own.sensed.body.gaps[:, 0], gaps, atol=1e-5)


def _thrown(rng: np.random.Generator, state: BodyState, hinges: np.ndarray) -> BodyState:
    """A state at a random place in the air, in any attitude, in motion."""
    qpos, qvel = np.zeros_like(state.qpos), np.zeros_like(state.qvel)
    turn = rng.normal(size=4)
    qpos[:7] = [*rng.uniform(-0.2, 0.2, 2), rng.uniform(0.8, 1.2), *turn / np.linalg.norm(turn)]
    qpos[7 + hinges] = rng.uniform(-0.4, 0.4, len(hinges))
    qvel[:6] = rng.uniform(-1, 1, 6)
    qvel[6 + hinges] = rng.uniform(-1, 1, len(hinges))
    return dataclasses.replace(state, qpos=qpos, qvel=qvel)


def _applied(model: mujoco.MjModel, data: mujoco.MjData, geoms: list[np.ndarray]) -> np.ndarray:
    """Generalised force of the pushes between three bodies, each force applied to its block."""
    each = [_seen(model, data, own) for own in geoms]
    force, found = [np.zeros((len(own), 6)) for own in geoms], np.zeros(model.nv)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        for k, more in zip((i, j), pushed(each[i], each[j]), strict=True):
            force[k] += more[:, :, 0]
    for own, pulls in zip(geoms, force, strict=True):
        for geom, pull in zip(own, pulls, strict=True):
            body, place = int(model.geom_bodyid[geom]), data.geom_xpos[geom]
            mujoco.mj_applyFT(model, data, pull[3:], pull[:3], place, body, found)
    return found


def _seen(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray) -> Boxes:
    """Blocks of MuJoCo's data, in one lane."""
    motion = np.zeros((len(geoms), 6))
    for row, geom in zip(motion, geoms, strict=True):
        kind = mujoco.mjtObj.mjOBJ_GEOM
        mujoco.mj_objectVelocity(model, data, kind, int(geom), row, 0)

    def vector(array: np.ndarray) -> tuple[jax.Array, jax.Array, jax.Array]:
        x, y, z = (jnp.asarray(array[:, c, None], jnp.float32) for c in range(3))
        return x, y, z

    axes, size = data.geom_xmat[geoms].reshape(-1, 3, 3), model.geom_size[geoms]
    mass = jnp.asarray(model.body_mass[model.geom_bodyid[geoms], None], jnp.float32)
    return Boxes(
        vector(data.geom_xpos[geoms]),
        (vector(axes[:, :, 0]), vector(axes[:, :, 1]), vector(axes[:, :, 2])),
        vector(size),
        mass,
        jnp.ones_like(mass),
        vector(motion[:, :3]),
        vector(motion[:, 3:]),
    )
