"""Onion-skin pictures and expression trees: what is drawn, and where."""

import dataclasses

import numpy as np
import pytest
from rendering.made_up import treading

from mjxgait.controllers.expressions.text import Expression
from mjxgait.creature import Creature
from mjxgait.rendering import filmstrip, genomes
from mjxgait.rendering.curves import figure
from mjxgait.rendering.walk import Walk, record_walk

TREE: Expression = ("ifltz", ("-", "s0", 0.25), ("*", "a0", "a1"), "t")


def sent(walk: Walk, ways: np.ndarray) -> Walk:
    """The walk with its trunk moved ahead by `ways`, m in each frame."""
    qpos = np.repeat(walk.qpos[:1], len(ways), 0)
    qpos[:, :2] += ways[:, None] * walk.forward
    film = dataclasses.replace(walk.trajectory, qpos=qpos[None])
    return dataclasses.replace(walk, trajectory=film)


def test_moments_are_evenly_spaced_up_to_the_farthest_point(stool_walk: Walk):
    ways = np.concatenate([np.linspace(0, 1, 50) ** 2, np.linspace(1, 0.8, 20)])
    chosen = filmstrip.moments(sent(stool_walk, ways))
    steps = np.diff(ways[chosen])
    assert (chosen[0], chosen[-1]) == (0, 49)
    spacing = filmstrip.SPACING * stool_walk.creature.frame.body_length
    assert abs(steps - spacing).max() < 0.2 * spacing


def test_a_long_path_has_no_more_moments_than_a_picture_holds(stool_walk: Walk):
    assert (
        len(filmstrip.moments(sent(stool_walk, np.linspace(0, 100, 500)))) <= filmstrip.MAX_MOMENTS
    )


def test_a_stationary_walk_is_drawn_once(stool_walk: Walk):
    assert filmstrip.moments(sent(stool_walk, np.zeros(30))).tolist() == [0]


def test_the_whole_path_is_in_the_picture(stool: Creature):
    walk = record_walk(stool, dataclasses.replace(treading(stool), task="hop"), 0.2)
    short, long = (filmstrip.strobe(sent(walk, np.linspace(0, way, 40))) for way in (0.2, 1.5))
    assert (short.height, long.width > 1.5 * short.width) == (long.height, True)
    # Same floor, same scale, and a body at both ends of the long picture.
    pixels = np.asarray(long.convert("L"), int)
    columns = np.flatnonzero(pixels[: long.height // 2].std(0) > 10)
    assert columns[0] < 0.2 * long.width
    assert columns[-1] > 0.8 * long.width


def test_leaves_lie_side_by_side_and_functions_above_their_arguments():
    nodes, leaves = genomes.laid_out(TREE)
    assert (len(nodes), leaves) == (8, 5)
    at = {node.label: (node.place, node.depth, node.above) for node in nodes}
    assert at["s0"] == (0, 2, 0.5)
    assert at["0.25"] == (1, 2, 0.5)
    assert at["-"] == (0.5, 1, 2.25)
    assert at["*"] == (2.5, 1, 2.25)
    assert at["t"] == (4, 1, 2.25)
    assert at["ifltz"] == (2.25, 0, None)
    assert {node.kind for node in nodes} == {"function", "sense", "number"}


def test_every_joint_has_a_tree_with_all_its_nodes():
    found = {"knee": TREE, "hip": 0.5}
    with figure(genomes.shape(found)) as drawing:
        genomes.draw_trees(drawing, found)
        titles = [axes.get_title(loc="left") for axes in drawing.axes]
        labels = [text.get_text() for text in drawing.axes[0].texts]
    assert titles == ["knee: 8 nodes", "hip: 1 node"]
    assert sorted(labels) == sorted(["ifltz", "-", "s0", "0.25", "*", "a0", "a1", "t"])


@pytest.mark.parametrize("deep", [1, 12])
def test_a_figure_grows_with_its_trees(deep: int):
    tree: Expression = "t"
    for _ in range(deep):
        tree = ("+", tree, "t")
    width, height = genomes.shape({"knee": tree})
    assert height == pytest.approx((deep + 2.2) * genomes.LEVEL)
    assert width == max((deep + 1) * genomes.LEAF, genomes.NARROWEST)
