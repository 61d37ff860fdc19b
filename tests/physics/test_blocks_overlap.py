"""Overlap of blocks against MuJoCo's own collisions of boxes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from controllers.sims_brain.made_up import CAPACITY, LANES, bodies_of, genome_of, one, random_graphs

from mjxgait.controllers.sims_brain.phenotype import GrownBody
from mjxgait.controllers.sims_brain.reference_body import Part, grow
from mjxgait.controllers.sims_brain.reference_files import body_files
from mjxgait.creature.load import creature_of
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.physics.batched_trees.tree import Surroundings
from mjxgait.reference.grown import seen_grown
from mjxgait.reference.overlap import overlaps
from mjxgait.types import BodyState


def ours(bodies: GrownBody, bent: np.ndarray) -> np.ndarray:
    """Overlap [LANES] relative to the smaller block, for angles [LANES, links]."""
    tree = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), bodies.tree)
    root = np.tile([[0.0], [0], [0], [1], [0], [0], [0]], LANES)
    still = jnp.zeros((CAPACITY.links + 5, LANES))
    qpos = jnp.float32(np.concatenate([root, bent[:, 1:].T]))
    state = BodyState(qpos, still, still, still, jnp.ones(LANES), parameters=tree)
    return np.asarray(jax.jit(TreePlant(Surroundings(floor=False)).overlap)(state))


def theirs(body: GrownBody, parts: list[Part], bent: np.ndarray) -> tuple[float, float]:
    """Overlap, and depth of a far end in the next block, relative to the smaller block.

    bent: [links] angles.
    """
    creature = creature_of(body_files(parts, "blocks", 0.01, 0.0, None, "in water"))
    qpos = creature.stand_qpos.copy()
    for part in range(1, len(parts)):
        for hinge in range(len(parts[part].hinges)):
            link = np.flatnonzero(
                (body.part == part) & (body.hinge == hinge) & (body.tree.moves > 0)
            )
            qpos[creature.model.joint(f"part{part}_{hinge}").qposadr] = bent[link]
    found = overlaps(creature, qpos[None], excused=False)
    sizes = {f"part{number}": part.box.size for number, part in enumerate(parts)}
    least = np.array([min(sizes[one], sizes[other]) for one, other in found.pairs])
    still = np.zeros((1, creature.nv))
    folded = seen_grown(creature, qpos[None], still, 0.0).folded
    return float((found.depth[0] / least).max(initial=0.0)), float(folded[0])


@pytest.fixture(scope="module")
def depths() -> tuple[np.ndarray, ...]:
    """Depth here; overlap and far ends in MuJoCo; number of blocks; of bodies with a hinge."""
    graphs = random_graphs(7)
    bodies = bodies_of(graphs)
    bent = np.random.default_rng(7).uniform(-1.6, 1.6, (LANES, CAPACITY.links))
    bent = bent * np.asarray(bodies.tree.moves)
    found, expected, blocks = ours(bodies, bent), np.full((2, LANES), np.nan), np.zeros(LANES)
    for i in range(LANES):
        parts = grow(genome_of(one(graphs, i)), CAPACITY.parts, CAPACITY.links)
        blocks[i] = len(parts)
        if any(part.hinges for part in parts):
            expected[:, i] = theirs(one(bodies, i), parts, bent[i])
    known = np.isfinite(expected[0])
    return found[known], *expected[:, known], blocks[known]


def test_a_far_end_in_the_next_block_is_found(depths: tuple[np.ndarray, ...]):
    found, overlap, folded, blocks = depths
    assert (np.maximum(found, 0.0) >= folded - 1e-5).all()
    alone = folded > 2 * overlap + 1e-3
    assert set(blocks[alone]) > {2, 3}
    np.testing.assert_allclose(found[alone], folded[alone], atol=1e-5)


def test_no_overlap_is_missed(depths: tuple[np.ndarray, ...]):
    """MuJoCo reports the deepest corner along its normal, which may exceed the way out."""
    found, expected, *_ = depths
    assert (expected > 0.01).mean() > 0.15
    assert (found[expected > 1e-4] > 0).all()
    assert (np.maximum(found, 0) >= 0.65 * expected - 1e-4).all()


def test_most_overlaps_are_accurate(depths: tuple[np.ndarray, ...]):
    """Where only an axis along two edges separates the boxes, the result here is too large."""
    found, overlap, folded, _ = depths
    expected = np.maximum(overlap, folded)
    deep = expected > 0.01
    assert np.median(found[deep] / expected[deep]) < 1.2
    assert (found < 0).mean() > 0.1
    assert (found < 0)[expected == 0].mean() > 0.4
