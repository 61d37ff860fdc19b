"""Blocks of one body that push each other (`controller.collide`)."""

import dataclasses
from functools import cache

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from controllers.sims_brain.made_up import CALM, bodies_of, genome_of, one, random_graphs
from controllers.sims_brain.made_up import LANES as BODIES
from physics.test_blocks_physics import links_of, moments

from mjxgait.controllers.observations import CONTACT_GAP, contacts
from mjxgait.controllers.sims_brain.genotype import Capacity, Graph
from mjxgait.controllers.sims_brain.phenotype import GrownBody, anatomy
from mjxgait.controllers.sims_brain.reference_body import grow
from mjxgait.controllers.sims_brain.reference_files import body_xml
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.physics.batched_trees.tree import Surroundings
from mjxgait.reference.own_contact import OwnContact
from mjxgait.types import BodyState

CAPACITY = Capacity(parts=5, links=6)
ADRIFT = Surroundings(step=0.005, contact=0.01, floor=False, gravity=0.0)
"""Weightless, without a floor: blocks meet only each other."""


@cache
def folded(collide: bool) -> tuple[np.ndarray, np.ndarray]:
    """What remains after all hinges pulled for 1 s.

    Deepest contact of each body's blocks over their size, and its momentum [3, BODIES] over its
    mass, in m/s.
    """
    plant = TreePlant(dataclasses.replace(ADRIFT, collide=collide))
    graphs = random_graphs(1)
    bodies = bodies_of(graphs, CAPACITY)
    trees = jax.vmap(plant.prepared)(bodies.tree)
    tree = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), trees)
    still = jnp.zeros((CAPACITY.links + 5, BODIES))
    qpos = jnp.zeros((CAPACITY.links + 6, BODIES)).at[3].set(1.0)
    pulls = np.random.default_rng(3).choice([-0.5, 0.5], (CAPACITY.links - 1, BODIES))
    torque = jnp.concatenate([still[:6], bodies.strength.T[1:] * pulls])
    state = BodyState(qpos, still, still, still, jnp.ones(BODIES), parameters=tree)

    @jax.jit
    def run(state: BodyState) -> BodyState:
        def one_step(_: int, state: BodyState) -> BodyState:
            return plant.advance(state, plant.forward(state)[1], torque)

        return jax.lax.fori_loop(0, 200, one_step, state)

    after = run(state)
    depths = [depth(one(graphs, k), one(bodies, k), after, k) for k in range(BODIES)]
    momentum = jax.jit(plant.forward)(after)[0].body.momentum / jnp.sum(tree.mass, axis=0)
    return np.array(depths), np.asarray(momentum)


def placed(
    graph: Graph, body: GrownBody, state: BodyState, lane: int
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The lane's body and pose in C MuJoCo, with its contacts."""
    parts = grow(genome_of(graph), CAPACITY.parts, CAPACITY.links)
    model = mujoco.MjModel.from_xml_string(body_xml(parts, ADRIFT.step, 0.0, None))
    data = mujoco.MjData(model)
    qpos = np.asarray(state.qpos)[:, lane]
    assert np.isfinite(qpos).all()
    data.qpos[:] = [*qpos[:7], *(qpos[6 + link] for link in links_of(body, model))]
    mujoco.mj_forward(model, data)
    return model, data


def depth(graph: Graph, body: GrownBody, state: BodyState, lane: int) -> float:
    """Depth of the deepest contact in C MuJoCo, over the smaller block's size; 0 without one."""
    model, data = placed(graph, body, state, lane)
    sizes = np.cbrt(8 * model.geom_size.prod(1))
    blocks = model.geom_bodyid > 0
    return max(
        (
            -contact.dist / sizes[contact.geom].min()
            for contact in data.contact
            if blocks[contact.geom].all()
        ),
        default=0.0,
    )


def test_bodies_that_fold_stay_out_of_themselves():
    free, held = folded(False)[0], folded(True)[0]

    assert (free > 0.2).sum() > 5
    assert (held < 0.05).mean() > 0.95
    assert held.max() < 0.2


def test_blocks_that_push_each_other_move_no_body():
    assert np.abs(folded(True)[1]).max() < 5 * np.abs(folded(False)[1]).max() + 1e-3


def test_contact_is_that_with_the_ground_or_another_block():
    body, gap = anatomy(3), 0.5 * CONTACT_GAP
    low, near = jnp.array([gap, 1.0, 1.0]), jnp.array([1.0, gap, 1.0])
    for nearest, contact in ((None, [1, 0, 0]), (near, [1, 1, 0])):
        own = dataclasses.replace(CALM.body, nearest=nearest)
        sensed = dataclasses.replace(CALM, geom_low=low, body=own)
        np.testing.assert_array_equal(contacts(body, sensed), contact)


def test_blocks_sense_how_near_others_are():
    """As the examiner's, wherever blocks may push each other."""
    graphs = random_graphs(1)
    bodies = bodies_of(graphs, CAPACITY)
    plant = TreePlant(dataclasses.replace(ADRIFT, collide=True, touch=True))
    trees = jax.vmap(plant.prepared)(bodies.tree)
    state = moments(bodies, 0.0, seed=4)
    lanes = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), trees)
    state = dataclasses.replace(state, parameters=lanes)
    near = np.asarray(jax.jit(plant.forward)(state)[0].body.nearest)
    inside = 0
    for lane in range(BODIES):
        body = one(bodies, lane)
        model, data = placed(one(graphs, lane), body, state, lane)
        names = [f"block{part}" for part in np.flatnonzero(body.parts.exists)]
        own = OwnContact(model, np.array([model.geom(name).id for name in names]))
        gaps = own.gaps(data.geom_xpos[None], data.geom_xmat[None])[0]
        mine = near[body.parts.last[np.flatnonzero(body.parts.exists)], lane]
        alone = np.isinf(gaps)
        np.testing.assert_allclose(mine[~alone], gaps[~alone], atol=2e-5)
        assert (mine[alone] > 100).all()
        inside += int((gaps < 0).sum())
    assert inside > 20
