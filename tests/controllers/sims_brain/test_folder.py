"""A grown body is an ordinary creature: its two files load, and it stands on the ground."""

import itertools

import mujoco
import numpy as np
import pytest
from controllers.sims_brain.made_up import CAPACITY, genome_of, one, random_graphs

from mjxgait.controllers.sims_brain.reference_body import THEIRS, grow
from mjxgait.controllers.sims_brain.reference_files import body_files
from mjxgait.creature.load import creature_of
from mjxgait.errors import UserError
from mjxgait.reference.overlap import neighbours, overlaps

COUNT = 60


@pytest.fixture(scope="module")
def grown_parts() -> list:
    graphs = random_graphs(8)
    every = (genome_of(one(graphs, place)) for place in range(COUNT))
    return [grow(genome, CAPACITY.parts, CAPACITY.links) for genome in every]


def test_grown_bodies_are_creatures(grown_parts: list):
    tried = 0
    for parts in grown_parts:
        hinges = [(part, h) for part in parts for h in range(len(part.hinges))]
        if not hinges:
            with pytest.raises(UserError, match="has no hinge"):
                body_files(parts, "grown", 0.005, 9.81, 0.9, "on land")
            continue
        creature = creature_of(body_files(parts, "grown", 0.005, 9.81, 0.9, "on land"))
        tried += 1
        assert len(creature.joints.names) == len(hinges)
        assert len(creature.feet.names) == len(parts)
        strengths = dict(zip(creature.joints.names, creature.gains.torque_limit, strict=True))
        for number, part in enumerate(parts):
            for hinge in range(len(part.hinges)):
                assert strengths[f"part{number}_{hinge}"] == pytest.approx(part.strength)
        data = mujoco.MjData(creature.model)
        mujoco.mj_resetDataKeyframe(creature.model, data, 0)
        data.qpos[2] -= 1e-3
        mujoco.mj_forward(creature.model, data)
        floor = creature.model.geom("floor").id
        deepest = min(contact.dist for contact in data.contact if floor in contact.geom)
        assert deepest == pytest.approx(-1e-3, abs=1e-6), "it rests on its lowest corner"
    assert tried > COUNT / 2


@pytest.mark.parametrize("step", [0.005, 0.01])
def test_contacts_are_as_stiff_as_the_time_step_allows(grown_parts: list, step: float):
    parts = next(p for p in grown_parts if sum(len(part.hinges) for part in p) > 3)
    model = creature_of(body_files(parts, "grown", step, 9.81, 0.9, "on land")).model
    assert model.opt.timestep == step
    assert np.allclose(model.geom_solref, [2 * step, 1.0])


def test_a_swimmer_has_no_contact_with_the_floor(grown_parts: list):
    parts = next(p for p in grown_parts if sum(len(part.hinges) for part in p) > 3)
    creature = creature_of(body_files(parts, "swimmer", 0.005, 0.0, None, "in water"))
    data = mujoco.MjData(creature.model)
    mujoco.mj_resetDataKeyframe(creature.model, data, 0)
    data.qpos[2] = 0.0
    mujoco.mj_forward(creature.model, data)
    assert not (data.contact.geom == creature.model.geom("floor").id).any()
    assert np.all(creature.model.opt.gravity == 0)


def test_blocks_of_a_grown_body_collide(grown_parts: list):
    """MuJoCo keeps all blocks without a common joint apart, in any pose."""
    rng, met = np.random.default_rng(0), 0
    for parts in (p for p in grown_parts if sum(len(part.hinges) for part in p) > 3):
        creature = creature_of(body_files(parts, "grown", 0.01, 9.81, 0.9, "on land"))
        data = mujoco.MjData(creature.model)
        data.qpos[:] = creature.stand_qpos
        data.qpos[2] = 10.0
        low, high = creature.model.jnt_range[1:].T
        data.qpos[7:] = rng.uniform(low, high)
        mujoco.mj_forward(creature.model, data)
        met += data.ncon
        found = overlaps(creature, data.qpos[None], excused=False)
        names = [creature.model.body(b).name for b in creature.model.geom_bodyid]
        touching = {tuple(sorted(names[g] for g in c.geom)) for c in data.contact}
        assert {tuple(sorted(pair)) for pair in found.pairs} == touching
    assert met > 10


def test_overlap_within_an_opponent_is_not_the_bodys(grown_parts: list):
    """Two bodies alike: of the blocks that are not joined, only the own ones can overlap."""
    parts = max(grown_parts, key=len)
    files = body_files(parts, "grown", 0.01, 9.81, 0.9, "on land", opponent=parts)
    creature = creature_of(files)
    model, apart = creature.model, {THEIRS: 0, "part": 0}
    left_out = {frozenset(pair) for pair in neighbours(model, creature)}
    for pair in itertools.combinations(range(1, model.nbody), 2):
        for beginning in apart:
            alike = all(model.body(body).name.startswith(beginning) for body in pair)
            apart[beginning] += alike and frozenset(pair) not in left_out
    assert apart["part"] > 3
    assert apart[THEIRS] == 0
