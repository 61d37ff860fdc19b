"""Bodies that grew have a colour for each node and two eyes, the same in all drawings and files."""

import json
import struct

import mujoco
import numpy as np
import pytest
from rendering.grown import graph, grown_walk, straight

from mjxgait.animation.export import build_glb, walk_take
from mjxgait.animation.export.surface import linear
from mjxgait.controllers.sims_brain.reference_body import grow
from mjxgait.rendering.dress import PALETTE, colour_of, face_of_eyes
from mjxgait.rendering.gl import scene_file
from mjxgait.rendering.painter import geom_colours
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import Walk

SPHERE = int(mujoco.mjtGeom.mjGEOM_SPHERE)


@pytest.fixture(scope="module")
def walk() -> Walk:
    return grown_walk("roam", straight(2.0, 0.0, 0.0))


def blocks(model: mujoco.MjModel) -> dict[str, tuple[int, ...]]:
    """Colour of each block, in hundredths."""
    colours = (100 * geom_colours(model)).round().astype(int).tolist()
    names = [model.geom(g).name for g in range(model.ngeom)]
    return {n: tuple(colours[g]) for g, n in enumerate(names) if n.startswith("block")}


def test_parts_of_a_node_share_a_colour_and_others_do_not(walk: Walk):
    parts = grow(graph(), 12, 12)
    assert [part.node for part in parts] == [0, 1, 1, 2, 2]
    hundredths = [(100 * colour_of(part.node)).round().astype(int).tolist() for part in parts]
    wanted = {f"block{n}": tuple(colour) for n, colour in enumerate(hundredths)}
    assert blocks(walk.shown) == blocks(walk.dressed) == wanted
    assert len(set(wanted.values())) == 3
    assert len(np.unique(PALETTE, axis=0)) == len(PALETTE)


def test_simulations_know_no_colours_and_no_eyes(walk: Walk):
    assert walk.creature.model.ngeom == 6
    assert walk.shown.ngeom == 6 + 4
    assert (walk.shown.nq, walk.shown.nbody) == (
        walk.creature.model.nq,
        walk.creature.model.nbody,
    )
    np.testing.assert_allclose(walk.shown.body_mass, walk.creature.model.body_mass)


@pytest.mark.parametrize(("way", "axis"), [((2.0, 0.0), (1, 0, 0)), ((-2.0, 0.0), (-1, 0, 0))])
def test_the_eyes_look_along_the_way(way: tuple[float, float], axis: tuple[int, int, int]):
    model = grown_walk("roam", straight(*way, 0.0)).shown
    eyes = np.flatnonzero(model.geom_type == SPHERE)
    assert (model.geom_bodyid[eyes] == model.body("part0").id).all()
    places = model.geom_pos[eyes] @ axis
    half = model.geom("block0").size[0]
    # Whites stand half out of the face, and pupils out of the whites.
    assert places[[0, 2]] == pytest.approx(half)
    assert (places[[1, 3]] > half).all()
    assert model.geom_pos[eyes][:, 2].min() > 0
    assert model.geom_pos[eyes][:2, 1] == pytest.approx(-model.geom_pos[eyes][2:, 1])


def test_no_eye_is_inside_a_limb():
    """A limb grows from each side of the root, so a body that goes aside looks up."""
    parts = grow(graph(), 12, 12)
    out, _ = face_of_eyes(parts, np.eye(3)[None], np.array([0.0, 1.0, 0.0]))
    np.testing.assert_array_equal(out, [0, 0, 1])


def test_gl_gets_the_same_colours(walk: Walk, tmp_path):
    scene_file(Stage([walk], 320, 180), [0], tmp_path / "scene.npz")
    with np.load(tmp_path / "scene.npz") as scene:
        model = mujoco.MjModel.from_xml_string(str(scene["xml"]))
    assert blocks(model) == blocks(walk.shown)
    assert model.ngeom == walk.shown.ngeom


def test_the_glb_has_the_same_colours(walk: Walk):
    """And the page, which holds a GLB."""
    data = build_glb(walk_take(walk))
    (length,) = struct.unpack_from("<I", data, 12)
    materials = json.loads(data[20 : 20 + length])["materials"]
    factors = [m["pbrMetallicRoughness"]["baseColorFactor"][:3] for m in materials]
    for node in range(3):
        wanted = linear(PALETTE[node])
        assert min(np.abs(np.array(f) - wanted).max() for f in factors) < 1e-6
    assert len(materials) == 3 + 2


def test_the_painter_draws_the_colours(walk: Walk):
    picture = np.asarray(Stage([walk], 320, 180).picture(50), float)
    for node in range(3):
        hue = PALETTE[node] / np.linalg.norm(PALETTE[node])
        near = picture @ hue / np.linalg.norm(picture, axis=-1) > 0.997
        assert near.sum() > 40


def test_faces_of_one_block_have_a_line_between_them(walk: Walk):
    """It is softer than the outline, and creatures that did not grow have none."""
    stage = Stage([walk], 320, 180)
    soft = np.asarray(stage.picture(50), int)
    stage.participants[0].painter.soft = False
    plain = np.asarray(stage.picture(50), int)
    darker = (soft.sum(-1) < plain.sum(-1) - 20).sum()
    lighter = (soft.sum(-1) > plain.sum(-1) + 20).sum()
    assert darker > 30
    assert lighter > 100
