"""Water of the reference simulator and of evolution: two implementations that agree."""

import jax
import mujoco
import numpy as np
import pytest
from controllers.sims_brain.made_up import LANES, bodies_of, one, random_graphs
from physics.test_blocks_physics import CAPACITY, IN_WATER, in_mujoco, moments

from mjxgait.controllers.sims_brain.genotype import Graph
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.reference.bodies import Water


@pytest.fixture(scope="module")
def graphs() -> Graph:
    return random_graphs(11)


def test_the_reference_water_equals_that_of_evolution(graphs: Graph):
    bodies = bodies_of(graphs, CAPACITY)
    state = moments(bodies, 1.0)
    wet = np.asarray(jax.jit(lambda s: TreePlant(IN_WATER).forward(s)[1].bias)(state))
    for lane in range(LANES):
        model, data, links = in_mujoco(one(graphs, lane), one(bodies, lane), state, lane, IN_WATER)
        mujoco.mj_forward(model, data)
        seen = (data.geom_xpos, data.geom_xmat, data.cvel, data.subtree_com, data.xipos)
        pushed = Water(model, IN_WATER.drag).forces(*(x[None] for x in seen))[0]
        force = np.zeros(model.nv)
        for body in range(1, model.nbody):
            push, moment = pushed[body, :3], pushed[body, 3:]
            mujoco.mj_applyFT(model, data, push, moment, data.xipos[body], body, force)
        rows = [*range(6), *(5 + link for link in links)]
        # C MuJoCo's forces of motion, damping and limits; it has no such water.
        dry = data.qfrc_bias - data.qfrc_passive
        found = dry - wet[rows, lane]
        np.testing.assert_allclose(found, force, atol=1e-4 * np.abs(force).max() + 1e-4)


def test_a_block_that_only_turns_is_slowed_and_not_pushed():
    xml = """<mujoco><worldbody><body><freejoint/><geom type="box" size="0.1 0.2 0.3"/></body>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qvel[3:] = 0, 0, 2.0
    mujoco.mj_forward(model, data)
    seen = (data.geom_xpos, data.geom_xmat, data.cvel, data.subtree_com, data.xipos)
    force, moment = np.split(Water(model, 100.0).forces(*(x[None] for x in seen))[0, 1], 2)
    np.testing.assert_allclose(force, 0, atol=1e-9)
    # 8/3 drag a (b^3 + c^3) times the spin, a along the axis of the turn.
    np.testing.assert_allclose(
        moment, [0, 0, -8 / 3 * 100 * 0.3 * (0.1**3 + 0.2**3) * 2], atol=1e-9
    )
