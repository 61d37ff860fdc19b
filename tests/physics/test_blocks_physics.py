"""Random modular bodies, a different one in each lane, against C MuJoCo on the model of each."""

import dataclasses
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from controllers.sims_brain.made_up import LANES, bodies_of, genome_of, one, random_graphs

from mjxgait.controllers.sims_brain.genotype import Capacity, Graph
from mjxgait.controllers.sims_brain.phenotype import GrownBody
from mjxgait.controllers.sims_brain.reference_body import grow
from mjxgait.controllers.sims_brain.reference_files import body_xml
from mjxgait.creature.geometry import DOWN, geom_reach, lowest
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.physics.batched_trees.tree import Medium, Surroundings
from mjxgait.tasks.modular.follow import Following, Light
from mjxgait.tasks.starts import NEVER
from mjxgait.types import BodyState

CAPACITY = Capacity(parts=6, links=6)
"""Half of the usual one: the compiler takes several times as long for a step of twelve links."""
ON_LAND = Surroundings(contact=0.01, iterations=20, line_iterations=20, lit=True)
IN_WATER = Surroundings(floor=False, gravity=0.0, drag=300.0)


@cache
def stepping(around: Surroundings) -> Callable[..., Any]:
    """Function of state and torques: sensed values, corner distances to the ground, next state."""
    plant = TreePlant(around)

    def step(state: BodyState, torque: jax.Array) -> Any:
        sensed, step_data = plant.forward(state)
        near = step_data.touch.distance if around.floor else None
        return sensed, near, plant.advance(state, step_data, torque)

    return jax.jit(step)


def looked_at(state: BodyState) -> tuple[Any, np.ndarray]:
    """Sensed values on land, and the distances of corners to the ground."""
    sensed, near, _ = stepping(ON_LAND)(state, jnp.zeros_like(state.qvel))
    return jax.tree.map(np.asarray, sensed), np.asarray(near)


@pytest.fixture(scope="module")
def graphs() -> Graph:
    return random_graphs(1)


@pytest.fixture(scope="module")
def bodies(graphs: Graph) -> GrownBody:
    return bodies_of(graphs, CAPACITY)


def model_of(graph: Graph, around: Surroundings) -> mujoco.MjModel:
    """MuJoCo model of parts grown without JAX; here blocks do not collide."""
    parts = grow(genome_of(graph), CAPACITY.parts, CAPACITY.links)
    friction = around.friction if around.floor else None
    model = mujoco.MjModel.from_xml_string(body_xml(parts, around.step, around.gravity, friction))
    model.geom_conaffinity[model.geom_bodyid > 0] = 0
    return model


def links_of(body: GrownBody, model: mujoco.MjModel) -> list[int]:
    """The link of each hinge of the model, in its order."""
    names = [model.joint(j).name.removeprefix("part").split("_") for j in range(1, model.njnt)]
    return [
        int(
            np.flatnonzero((body.part == int(p)) & (body.hinge == int(h)) & (body.tree.moves > 0))[
                0
            ]
        )
        for p, h in names
    ]


def moments(bodies: GrownBody, height: float, seed: int = 0) -> BodyState:
    """One state per lane: any attitude, joints beyond their ranges, everything in motion."""
    rng, moves = np.random.default_rng(seed), np.asarray(bodies.tree.moves)[:, 1:].T
    quat = rng.normal(size=(4, LANES))
    bent = rng.uniform(-1.2, 1.2, moves.shape) * moves
    place = np.array([0.3, -0.2, height])[:, None] * np.ones(LANES)
    qvel = np.concatenate([rng.normal(size=(6, LANES)), 3 * rng.normal(size=moves.shape) * moves])
    still = jnp.zeros(qvel.shape)
    return BodyState(
        qpos=jnp.float32(np.concatenate([place, quat / np.linalg.norm(quat, axis=0), bent])),
        qvel=jnp.float32(qvel),
        warmstart=still,
        constraint_force=still,
        friction=jnp.ones(LANES),
        parameters=jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), bodies.tree),
    )


def in_mujoco(
    graph: Graph, body: GrownBody, state: BodyState, lane: int, around: Surroundings
) -> tuple[mujoco.MjModel, mujoco.MjData, list[int]]:
    """The lane's body and state, and the links of its hinges."""
    model = model_of(graph, around)
    model.opt.tolerance, model.opt.iterations = 1e-12, 100
    data, links = mujoco.MjData(model), links_of(body, model)
    qpos, qvel = (np.asarray(x)[:, lane] for x in (state.qpos, state.qvel))
    data.qpos[:] = [*qpos[:7], *(qpos[6 + link] for link in links)]
    data.qvel[:] = [*qvel[:6], *(qvel[5 + link] for link in links)]
    return model, data, links


def test_masses_and_inverse_weights_match_mujoco(graphs: Graph, bodies: GrownBody):
    for lane in range(LANES):
        body = one(bodies, lane)
        model = model_of(one(graphs, lane), ON_LAND)
        links = links_of(body, model)
        parts = np.flatnonzero(body.parts.exists)
        assert model.nbody == 1 + len(parts)
        assert body.tree.mass.sum() == pytest.approx(model.body_mass.sum(), rel=1e-5)
        np.testing.assert_allclose(body.tree.dof_weight[links], model.dof_invweight0[6:], rtol=1e-3)
        weights = [model.body(f"part{part}").invweight0[0] for part in parts]
        np.testing.assert_allclose(
            body.tree.body_weight[body.parts.last[parts]], weights, rtol=1e-3
        )


AIR = pytest.param(
    Surroundings(floor=False),
    marks=pytest.mark.thorough("test_swimming.py compares whole swims, without a floor"),
)


@pytest.mark.parametrize("around", [ON_LAND, AIR], ids=["land", "air"])
def test_one_step_matches_c_mujoco(graphs: Graph, bodies: GrownBody, around: Surroundings):
    state = moments(bodies, 0.3)
    moves = np.concatenate([np.zeros((6, LANES)), np.asarray(bodies.tree.moves)[:, 1:].T])
    torque = np.random.default_rng(2).normal(size=moves.shape) * moves * 5
    after = stepping(around)(state, jnp.float32(torque))[2]
    wrong, touching = [], 0
    for lane in range(LANES):
        model, data, links = in_mujoco(one(graphs, lane), one(bodies, lane), state, lane, around)
        data.qfrc_applied[6:] = torque[[5 + link for link in links], lane]
        mujoco.mj_step(model, data)
        touching += data.ncon
        mine = np.asarray(after.qvel)[[*range(6), *(5 + link for link in links)], lane]
        wrong.append(np.abs(mine - data.qvel).max() / (1 + np.abs(data.qacc).max() * around.step))
    assert (touching > LANES) is around.floor
    assert np.median(wrong) < 1e-5
    assert np.max(wrong) < 2e-3
    still = np.asarray(after.qvel)[6:][moves[6:] == 0]
    assert not still.any(), "what is not there does not move"


def test_sensed_values_match_c_mujoco(graphs: Graph, bodies: GrownBody):
    state = moments(bodies, 0.3)
    sensed, _ = looked_at(state)
    for lane in range(LANES):
        body = one(bodies, lane)
        model, data, links = in_mujoco(one(graphs, lane), body, state, lane, ON_LAND)
        mujoco.mj_forward(model, data)
        parts = np.flatnonzero(body.parts.exists)
        last, blocks = body.parts.last[parts], [model.geom(f"block{part}").id for part in parts]
        lows = [-geom_reach(model, data, block, DOWN) for block in blocks]
        np.testing.assert_allclose(sensed.geom_low[last, lane], lows, atol=1e-5)
        np.testing.assert_allclose(
            sensed.geom_pos[last, :, lane], data.geom_xpos[blocks], atol=1e-5
        )
        nothing = np.setdiff1d(np.arange(CAPACITY.links), last)
        assert (sensed.geom_low[nothing, lane] > 100).all(), "what is not there touches nothing"
        hinges = np.array(links, int) - 1
        np.testing.assert_allclose(sensed.joint_pos[hinges, lane], data.qpos[7:], atol=1e-6)
        np.testing.assert_allclose(sensed.joint_vel[hinges, lane], data.qvel[6:], atol=1e-6)
        turned = data.xmat[1].reshape(3, 3)
        np.testing.assert_allclose(sensed.trunk_rot[..., lane], turned, atol=1e-5)
        spin = turned @ data.qvel[3:6]
        np.testing.assert_allclose(sensed.trunk_angvel[:, lane], spin, atol=1e-5)


def test_touching_corners_match_c_mujoco(graphs: Graph, bodies: GrownBody):
    """The four corners below a block's centre, however deep in the ground."""
    state = moments(bodies, 0.0)
    distance = looked_at(state)[1].reshape(-1, CAPACITY.links, LANES)
    for lane in range(LANES):
        body = one(bodies, lane)
        model, data, _ = in_mujoco(one(graphs, lane), body, state, lane, ON_LAND)
        mujoco.mj_forward(model, data)
        for part in np.flatnonzero(body.parts.exists):
            block = model.geom(f"block{part}").id
            touching = sorted(c.dist for c in data.contact if block in (c.geom1, c.geom2))
            mine = np.sort(distance[:, body.parts.last[part], lane])
            np.testing.assert_allclose(mine[mine < 0], touching, atol=1e-5)


def test_bodies_start_on_the_ground(graphs: Graph, bodies: GrownBody):
    """With straight joints at the height of their files; with bent joints on the lowest corner.
    In water they stay in place.
    """
    straight = np.zeros((LANES, 7 + CAPACITY.links - 1), np.float32)
    straight[:, 3] = 1.0
    bent = np.asarray(moments(bodies, 0.0).qpos).T
    plant, wet = TreePlant(ON_LAND), TreePlant(IN_WATER)
    rested = jax.jit(jax.vmap(plant.rested))
    for qpos in (straight, bent):
        low = np.asarray(rested(bodies.tree, qpos))
        np.testing.assert_array_equal(np.delete(low, 2, axis=1), np.delete(qpos, 2, axis=1))
        state = dataclasses.replace(moments(bodies, 0.0), qpos=jnp.asarray(low.T))
        sensed, _ = looked_at(state)
        np.testing.assert_allclose(np.asarray(sensed.geom_low).min(0), 0.0, atol=1e-6)
        np.testing.assert_allclose(sensed.body.depth, 0.0, atol=1e-4)
    low = np.asarray(rested(bodies.tree, straight))
    for lane in range(LANES):
        model = model_of(one(graphs, lane), ON_LAND)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        assert low[lane, 2] == pytest.approx(1.0 - lowest(model, data), abs=1e-5)
    same = jax.tree.map(lambda leaf: leaf[0], bodies.tree)
    np.testing.assert_array_equal(wet.rested(same, bent[0]), bent[0])


def test_each_lane_may_have_its_own_medium(bodies: GrownBody):
    """Lanes in water and on land move as in a program for their medium alone."""
    mixed = dataclasses.replace(ON_LAND, drag=IN_WATER.drag)
    state, wet = moments(bodies, 0.1), np.arange(LANES) % 2 == 0
    torque = jnp.zeros_like(state.qvel)
    both = dataclasses.replace(state, ground=Medium(jnp.float32(wet)))
    sensed, _, after = stepping(mixed)(both, torque)
    for around, lanes in ((IN_WATER, wet), (ON_LAND, ~wet)):
        alone, _, moved = stepping(around)(state, torque)
        for name in ("qpos", "qvel"):
            found, expected = (np.asarray(getattr(x, name))[:, lanes] for x in (after, moved))
            np.testing.assert_allclose(found, expected, rtol=2e-4, atol=2e-4)
        low, expected = (np.asarray(x.geom_low)[:, lanes] for x in (sensed, alone))
        np.testing.assert_allclose(low, expected, atol=1e-6)
    np.testing.assert_array_equal(after.ground.wet, wet)


def test_sinking_depth_is_relative_to_block_size(bodies: GrownBody):
    state = moments(bodies, 0.0)
    sensed, _ = looked_at(state)
    for lane in range(LANES):
        tree = one(bodies, lane).tree
        size = np.cbrt(8 * tree.half.prod(1))
        there = tree.solid > 0
        deepest = (-sensed.geom_low[:, lane] / size)[there].max()
        assert sensed.body.depth[lane] == pytest.approx(deepest, rel=1e-4, abs=1e-6)


def test_light_direction_is_in_each_blocks_own_axes(graphs: Graph, bodies: GrownBody):
    state, place = moments(bodies, 0.3), np.array([3.0, -4.0, 1.0])
    sensed, _ = looked_at(state)
    unused: Any = None
    light = Light(jnp.float32(place), jnp.zeros(3), jnp.array(NEVER))
    look = jax.vmap(partial(Following.observations, unused, light), in_axes=-1)
    seen = np.asarray(jax.jit(look)(sensed)["light"])
    for lane in range(LANES):
        body = one(bodies, lane)
        model, data, _ = in_mujoco(one(graphs, lane), body, state, lane, ON_LAND)
        mujoco.mj_kinematics(model, data)
        for part in np.flatnonzero(body.parts.exists):
            block = model.geom(f"block{part}").id
            there = data.geom_xmat[block].reshape(3, 3).T @ (place - data.geom_xpos[block])
            mine = seen[lane, body.parts.last[part]]
            np.testing.assert_allclose(mine, there / np.linalg.norm(there), atol=1e-5)
