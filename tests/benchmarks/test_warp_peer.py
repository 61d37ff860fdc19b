"""The body that MuJoCo Warp steps in `benchmarks/accelerator.py`, in C MuJoCo."""

import mujoco
from peers.warp_peer import CONTACTS, held_model

from mjxgait.creature import Creature


def test_springs_hold_the_body_up(shipped: Creature):
    """It stands for an episode of the benchmark, within the contacts that are allocated."""
    model = held_model(shipped)
    data = mujoco.MjData(model)
    data.qpos = shipped.stand_qpos
    mujoco.mj_forward(model, data)
    begun = data.xpos[shipped.trunk, 2]
    for _ in range(round(0.8 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        assert data.ncon <= CONTACTS
    assert abs(data.xpos[shipped.trunk, 2] - begun) < 0.1 * begun
