"""The rungs below a creature that walks in place pass at its speed, without a seam."""

import dataclasses

import numpy as np
import pygltflib as gltf
import pytest
from animation.test_glb import read
from rendering.made_up import treading

from mjxgait.animation.export import build_glb, walk_loop
from mjxgait.rendering.walk import record_walk


@pytest.fixture(scope="module")
def loop(stool):
    """A loop that advances the stool by two body lengths."""
    made = walk_loop(record_walk(stool, treading(stool, degrees=12.0), 4.0), 30)
    return dataclasses.replace(made, advance=2 * stool.frame.body_length)


def rungs(document, at: float) -> tuple[np.ndarray, np.ndarray]:
    """Place along the path, m, and relative width of each rung [n] at a time, s."""
    floor = next(node for node in document.nodes if node.name == "floor")
    moved = {(node, path): value for node, path, value in channels(document, at)}
    shift = moved[document.nodes.index(floor), "translation"][2]
    place = np.array([document.nodes[c].translation[2] for c in floor.children]) + shift
    width = np.array([moved.get((c, "scale"), [1.0])[0] for c in floor.children])
    return place, width


def channels(document, at: float):
    animation = document.animations[0]
    for channel in animation.channels:
        sampler = animation.samplers[channel.sampler]
        keys, values = read(document, sampler.input)[:, 0], read(document, sampler.output)
        yield (
            channel.target.node,
            channel.target.path,
            [np.interp(at, keys, column) for column in values.T],
        )


@pytest.mark.parametrize("way", [1, -1])
def test_rungs_pass_at_the_creatures_speed_without_a_seam(loop, way):
    loop = dataclasses.replace(loop, advance=way * loop.advance)
    document = gltf.GLTF2.load_from_bytes(build_glb(loop, floor=True))
    end = float(loop.times[-1])
    places, widths = rungs(document, 0.0)
    later, _ = rungs(document, 0.01)
    assert later - places == pytest.approx(-0.01 * loop.speed, rel=0.01)
    last, shrunk = rungs(document, end)
    # Each rung ends at the place and width of the one before it.
    assert last[1:] == pytest.approx(places[:-1], abs=1e-6)
    assert shrunk[1:] == pytest.approx(widths[:-1], abs=1e-6)
    assert (shrunk[0], widths[-1]) == (0.0, 0.0)


def test_a_stationary_walk_has_no_rungs(loop):
    document = gltf.GLTF2.load_from_bytes(
        build_glb(dataclasses.replace(loop, advance=0.0), floor=True)
    )
    assert all(node.name != "floor" for node in document.nodes)
