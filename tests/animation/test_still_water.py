"""The water of a page with physics: particles that can move on by a cell without being seen to."""

import numpy as np
import pygltflib as gltf
import pytest

from mjxgait.animation.export.gltf import Buffer
from mjxgait.animation.export.scenery import CELLS, EACH, add_still_water


def test_moved_by_a_cell_the_block_looks_the_same_but_at_its_ends():
    document = gltf.GLTF2(scenes=[gltf.Scene(nodes=[])])
    apart = add_still_water(document, Buffer(document), 2.0)
    block = document.nodes[-1]
    assert block.name == "floor"
    assert document.scenes[0].nodes == [len(document.nodes) - 1]
    places = np.array([document.nodes[i].translation for i in block.children])
    across = 2 * CELLS + 1
    assert len(places) == EACH * across**3
    assert np.abs(places).max() == pytest.approx(apart * across / 2, rel=0.3)
    for way in apart * np.eye(3):
        away = np.linalg.norm(places[:, None] + way - places, axis=2).min(1)
        assert (away < 1e-6).mean() == pytest.approx((across - 1) / across)
