"""Growth of graphs into bodies: against a plain list, within capacity, with mirror images."""

import dataclasses
import itertools
from functools import cache
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from controllers.sims_brain.made_up import genome_of, one

from mjxgait.controllers.sims_brain.genotype import (
    Capacity,
    Graph,
    Ranges,
    random_graph,
)
from mjxgait.controllers.sims_brain.growth import Parts, grown
from mjxgait.controllers.sims_brain.operators import Genotype
from mjxgait.controllers.sims_brain.phenotype import GrownBody, body_of
from mjxgait.controllers.sims_brain.reference_body import JOINTS, ROOM, grow
from mjxgait.controllers.sims_brain.reference_files import body_xml
from mjxgait.evolution.chance import key_of
from mjxgait.tasks.starts import Starts
from mjxgait.training.grown_spec import GraphGrowth

CAPACITY, COUNT = Capacity(), 1000
CREATE = jax.jit(jax.vmap(lambda key: random_graph(key, CAPACITY, Ranges())))
GROW = jax.jit(jax.vmap(lambda graph: grown(graph, CAPACITY)))
EMBODY = jax.jit(lambda graph: body_of(graph, CAPACITY))


def grown_alone(graph: Graph) -> Parts:
    """Parts of one graph, by the program that all tests of single bodies share."""
    return jax.device_get(EMBODY(graph).parts)


@cache
def drawn() -> Graph:
    return jax.device_get(CREATE(jax.random.split(key_of(0), COUNT)))


@pytest.fixture(scope="module")
def graphs() -> Graph:
    return drawn()


@pytest.fixture(scope="module")
def parts(graphs: Graph) -> Parts:
    return jax.tree.map(np.asarray, GROW(graphs))


def test_growth_matches_a_plain_list(graphs: Graph, parts: Parts):
    sizes = set()
    for place in range(COUNT):
        mine, genome = one(parts, place), genome_of(one(graphs, place))
        plain = grow(genome, CAPACITY.parts, CAPACITY.links)
        count = len(plain)
        sizes.add(count)
        assert mine.exists.tolist() == [True] * count + [False] * (CAPACITY.parts - count)
        assert mine.node[:count].tolist() == [part.node for part in plain]
        assert mine.parent[1:count].tolist() == [part.parent for part in plain[1:]]
        assert mine.copies[:count].tolist() == [part.mirrored for part in plain]
        links = np.cumsum([max(len(part.hinges), 1) for part in plain]) - 1
        assert mine.last[:count].tolist() == links.tolist()
        for name in ("half", "place"):
            expected = np.stack([getattr(part, name) for part in plain])
            np.testing.assert_allclose(getattr(mine, name)[:count], expected, atol=1e-5)
        columns = np.stack([part.axes for part in plain])
        np.testing.assert_allclose(mine.turn[:count], np.swapaxes(columns, 1, 2), atol=1e-5)
    assert {1, 2, 3, 4, 5, 6} < sizes


def test_a_body_stays_within_capacity(parts: Parts):
    assert parts.exists.sum(1).max() <= CAPACITY.parts
    assert (parts.last * parts.exists).max() < CAPACITY.links
    rows = parts.turn[parts.exists]
    np.testing.assert_allclose(
        np.swapaxes(rows, 1, 2) @ rows, np.tile(np.eye(3), (len(rows), 1, 1)), atol=1e-5
    )
    np.testing.assert_allclose(np.linalg.det(rows), 1, atol=1e-5)


def test_the_same_graph_grows_into_the_same_body(graphs: Graph, parts: Parts):
    for a, b in zip(jax.tree.leaves(parts), jax.tree.leaves(GROW(graphs)), strict=True):
        np.testing.assert_array_equal(a, b)


def star(
    mirror: int, recursion: int = 0, joint: str = "universal", terminal: bool = False
) -> Graph:
    """A root with one kind of limb on its side, which may repeat itself."""
    base = one(drawn(), 0)
    each = (CAPACITY.nodes, CAPACITY.connections)
    node, order = np.indices(each)
    away = np.where(node[..., None] == 0, [0.2, 1.0, 0.3], [1.0, 0.2, 0.3])
    return dataclasses.replace(
        base,
        half=jnp.full((CAPACITY.nodes, 3), 0.1),
        joint=jnp.full(CAPACITY.nodes, JOINTS.index(joint)),
        recursion=jnp.full(CAPACITY.nodes, recursion),
        target=jnp.ones(each, int),
        used=jnp.asarray((node < 2) & (order == 0)),
        place=jnp.asarray(away),
        turn=jnp.tile(jnp.array([0.3, 0.4, -0.2]), (*each, 1)),
        scale=jnp.full(each, 0.9),
        mirror=jnp.asarray(np.where(node == 0, mirror, 0)),
        terminal=jnp.asarray((node == 1) & terminal),
    )


@pytest.mark.parametrize(("recursion", "parts"), [(0, 2), (1, 3), (3, 5)])
def test_a_node_repeats_up_to_its_recursion_limit(recursion: int, parts: int):
    found = grown_alone(star(mirror=0, recursion=recursion, joint="twist"))
    assert int(found.exists.sum()) == parts
    assert found.depth[:parts].tolist() == [0, 0, *range(1, recursion + 1)]


def test_nothing_grows_into_an_existing_block():
    """A limb that turns back would end inside the root. A pair without space on one side has no
    limbs.
    """
    back = star(mirror=0, recursion=1)
    back = dataclasses.replace(back, place=back.place.at[1, :, 0].set(-1.0))
    assert int(grown_alone(back).exists.sum()) == 2
    pair = star(mirror=2)
    close = dataclasses.replace(pair, place=jnp.full_like(pair.place, 0.1).at[..., 0].set(1.0))
    assert int(grown_alone(close).exists.sum()) == 1
    alone = dataclasses.replace(close, mirror=jnp.zeros_like(close.mirror))
    assert int(grown_alone(alone).exists.sum()) == 2


def test_grown_blocks_are_apart(graphs: Graph):
    """By MuJoCo's geometry: only parent and child are closer than the allowed gap."""
    seen = 0
    for place in range(200):
        parts = grow(genome_of(one(graphs, place)), CAPACITY.parts, CAPACITY.links)
        model = mujoco.MjModel.from_xml_string(body_xml(parts, 0.01, 0.0, None))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        for a, b in itertools.combinations(range(len(parts)), 2):
            if parts[b].parent == a:
                continue
            one_geom, other = (model.geom(f"block{n}").id for n in (a, b))
            gap = mujoco.mj_geomDistance(model, data, one_geom, other, 1.0, None)
            size = min(parts[a].box.size, parts[b].box.size)
            assert gap > -1.5 * ROOM * size
            seen += 1
    assert seen > 200


def test_a_child_is_attached_to_its_parents_surface(graphs: Graph):
    hanging = 0
    for place in range(100):
        parts = grow(genome_of(one(graphs, place)), CAPACITY.parts, CAPACITY.links)
        for part in parts[1:]:
            parent = parts[part.parent]
            reach = np.abs(part.place - parent.middle) / parent.half
            assert reach.max() == pytest.approx(1.0)
            hanging += part.parent > 0
    assert hanging > 50


def test_a_terminal_connection_grows_only_at_the_end():
    """The limb's own connection leads to itself; at its end it may not repeat."""
    assert int(grown_alone(star(mirror=0, recursion=2, terminal=True)).exists.sum()) == 2


def test_a_pair_grows_together_or_not_at_all():
    """Each limb has three hinges: eleven links suffice for three limbs."""
    body = EMBODY(star(mirror=2, recursion=1, joint="spherical"))
    assert int(body.parts.exists.sum()) == 4
    few = dataclasses.replace(CAPACITY, parts=2)
    pairs = jax.jit(lambda graph: grown(graph, few))(star(mirror=2))
    assert int(pairs.exists.sum()) == 1


def test_a_pair_of_limbs_is_mirrored():
    body = EMBODY(star(mirror=2, recursion=1, joint="universal"))
    places, axes = joints_in_the_world(body)
    copies = np.asarray(body.parts.copies)[np.asarray(body.part)]
    left, right = (np.flatnonzero((copies == image) & moving(body)) for image in (0, 1))
    assert len(left) == len(right) == 4
    flip, sign = np.array([1.0, -1.0, 1.0]), np.asarray(body.sign)[:, None]
    np.testing.assert_allclose(places[right], places[left] * flip, atol=1e-6)
    # A mirrored rotation is the opposite rotation about the mirrored axis.
    np.testing.assert_allclose((sign * axes)[right], -(sign * axes)[left] * flip, atol=1e-6)
    assert np.asarray(body.strength)[left].tolist() == np.asarray(body.strength)[right].tolist()


def test_rigid_joints_start_unbent():
    """A start bends every possible hinge; a rigid joint would stay bent for ever."""
    nobody: Any = None
    weightless: Any = SimpleNamespace(prepared=lambda tree: tree, rested=lambda tree, qpos: qpos)
    bent = jnp.full(7 + CAPACITY.links - 1, 0.3)
    start = Starts(bent, *[jnp.zeros(1)] * 6)
    embody = jax.jit(lambda genome: GraphGrowth(CAPACITY).body(weightless, genome, start).qpos)
    for joint, hinges in (("rigid", 0), ("universal", 2)):
        qpos = np.asarray(embody(Genotype(star(mirror=0, joint=joint), nobody, nobody)))
        np.testing.assert_allclose(qpos, [0.3] * (7 + hinges) + [0] * (11 - hinges), atol=1e-7)


def moving(body: GrownBody) -> np.ndarray:
    return np.asarray(body.tree.moves) > 0


def joints_in_the_world(body: GrownBody) -> tuple[np.ndarray, np.ndarray]:
    """Places and axes [n, 3] of all links, with all angles at 0."""
    tree = jax.tree.map(np.asarray, body.tree)
    places, frames = [np.zeros(3)], [np.eye(3)]
    for link in range(1, tree.links):
        parent = int(tree.parent[link].argmax())
        places.append(places[parent] + tree.place[link] @ frames[parent])
        frames.append(tree.turn[link] @ frames[parent])
    return np.stack(places), np.stack(frames)[:, 2]
