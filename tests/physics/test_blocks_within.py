"""Blocks of one body that push each other (`controller.collide`)."""

import dataclasses
from functools import cache

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from controllers.sims_brain.made_up import CALM, bodies_of, genome_of, one, random_graphs
from controllers.sims_brain.made_up import LANES as BODIES
from physics.test_blocks_physics import links_of

from mjxgait.controllers.observations import CONTACT_GAP, contacts
from mjxgait.controllers.sims_brain.genotype import Capacity, Graph
from mjxgait.controllers.sims_brain.phenotype import GrownBody, anatomy
from mjxgait.controllers.sims_brain.reference_body import grow
from mjxgait.controllers.sims_brain.reference_files import body_xml
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.physics.batched_trees.tree import ModularSensed, Surroundings
from mjxgait.reference.own_contact import OwnContact
from mjxgait.types import BodyState

CAPACITY = Capacity(parts=5, links=6)
ADRIFT = Surroundings(step=0.005, contact=0.01, floor=False, gravity=0.0)
"""Weightless, without a floor: blocks meet only each other."""


@cache
def folded(collide: bool) -> tuple[BodyState, ModularSensed]:
    """Random bodies after all of their hinges pulled for 1 s, and what is sensed of them."""
    plant = TreePlant(dataclasses.replace(ADRIFT, collide=collide, touch=collide))
    bodies = grown()[1]
    trees = jax.vmap(plant.prepared)(bodies.tree)
    tree = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), trees)
    still = jnp.zeros((CAPACITY.links + 5, BODIES))
    qpos = jnp.zeros((CAPACITY.links + 6, BODIES)).at[3].set(1.0)
    pulls = np.random.default_rng(3).choice([-0.5, 0.5], (CAPACITY.links - 1, BODIES))
    torque = jnp.concatenate([still[:6], bodies.strength.T[1:] * pulls])
    state = BodyState(qpos, still, still, still, jnp.ones(BODIES), parameters=tree)
    Carried = tuple[BodyState, BodyState, ModularSensed]

    def one_step(_: int, carried: Carried) -> Carried:
        state = carried[0]
        sensed, step_data = plant.forward(state)
        return plant.advance(state, step_data, torque), state, sensed.body

    seen = jax.eval_shape(plant.forward, state)[0].body
    none = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), seen)
    run = jax.jit(lambda state: jax.lax.fori_loop(0, 200, one_step, (state, state, none)))
    return run(state)[1:]


@cache
def grown() -> tuple[Graph, GrownBody]:
    """Random graphs, and the bodies that grow from them."""
    graphs = random_graphs(1)
    return graphs, bodies_of(graphs, CAPACITY)


def placed(state: BodyState, lane: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A lane's body and pose in C MuJoCo, with its contacts."""
    graphs, bodies = grown()
    parts = grow(genome_of(one(graphs, lane)), CAPACITY.parts, CAPACITY.links)
    model = mujoco.MjModel.from_xml_string(body_xml(parts, ADRIFT.step, 0.0, None))
    data, qpos = mujoco.MjData(model), np.asarray(state.qpos)[:, lane]
    assert np.isfinite(qpos).all()
    links = links_of(one(bodies, lane), model)
    data.qpos[:] = [*qpos[:7], *(qpos[6 + link] for link in links)]
    mujoco.mj_forward(model, data)
    return model, data


def depth(state: BodyState, lane: int) -> float:
    """Depth of the deepest contact in C MuJoCo, over the smaller block's size; 0 without one."""
    model, data = placed(state, lane)
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
    free, held = (
        np.array([depth(folded(collide)[0], lane) for lane in range(BODIES)])
        for collide in (False, True)
    )
    assert (free > 0.2).sum() > 5
    assert (held < 0.05).mean() > 0.95
    assert held.max() < 0.2


def test_blocks_that_push_each_other_move_no_body():
    """In m/s of the centre of mass: as much as rounding alone, times five."""
    slow = [folded(collide)[1].momentum for collide in (False, True)]
    mass = jnp.sum(folded(True)[0].parameters.mass, axis=0)
    free, held = (np.abs(np.asarray(momentum / mass)).max() for momentum in slow)
    assert held < 5 * free + 1e-3


def test_contact_is_that_with_the_ground_or_another_block():
    body, gap = anatomy(3), 0.5 * CONTACT_GAP
    low, near = jnp.array([gap, 1.0, 1.0]), jnp.array([1.0, gap, 1.0])
    for nearest, contact in ((None, [1, 0, 0]), (near, [1, 1, 0])):
        own = dataclasses.replace(CALM.body, nearest=nearest)
        sensed = dataclasses.replace(CALM, geom_low=low, body=own)
        np.testing.assert_array_equal(contacts(body, sensed), contact)


def test_blocks_sense_how_near_others_are():
    """As the examiner's, wherever blocks may push each other."""
    (state, sensed), touching = folded(True), 0
    near = np.asarray(sensed.nearest)
    for lane in range(BODIES):
        body = one(grown()[1], lane)
        model, data = placed(state, lane)
        parts = np.flatnonzero(body.parts.exists)
        own = OwnContact(model, np.array([model.geom(f"block{part}").id for part in parts]))
        gaps = own.gaps(data.geom_xpos[None], data.geom_xmat[None])[0]
        mine, alone = near[body.parts.last[parts], lane], np.isinf(gaps)
        np.testing.assert_allclose(mine[~alone], gaps[~alone], atol=2e-5)
        assert (mine[alone] > 100).all()
        touching += int((gaps < CONTACT_GAP).sum())
    assert touching > 20
