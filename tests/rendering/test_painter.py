"""The renderer without GPU and GL: shapes where MuJoCo has them, lengths to scale."""

import mujoco
import numpy as np
import pytest
from rendering.made_up import treading

from mjxgait.rendering import painter
from mjxgait.rendering.floor import Camera, band_width
from mjxgait.rendering.painter import (
    Painter,
    geom_colours,
    paint,
    seen_geoms,
)
from mjxgait.rendering.shapes import Silhouettes, distances, normals
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.surroundings import Surroundings
from mjxgait.rendering.walk import record_walk

FORWARD = np.array([1.0, 0.0])
SHAPES = {
    "sphere": ("0.2", mujoco.mjtGeom.mjGEOM_SPHERE),
    "capsule": ("0.1 0.2", mujoco.mjtGeom.mjGEOM_CAPSULE),
    "ellipsoid": ("0.1 0.2 0.3", mujoco.mjtGeom.mjGEOM_ELLIPSOID),
    "cylinder": ("0.1 0.2", mujoco.mjtGeom.mjGEOM_CYLINDER),
    "box": ("0.1 0.2 0.3", mujoco.mjtGeom.mjGEOM_BOX),
}
MESH = '<asset><mesh name="m" vertex="0 0 0 0.4 0 0 0 0.4 0 0 0 0.4"/></asset>'


def one_shape(kind, size="", asset=""):
    data = 'type="mesh" mesh="m"' if kind == "mesh" else f'type="{kind}" size="{size}"'
    return mujoco.MjModel.from_xml_string(
        f'<mujoco>{asset}<worldbody><geom name="floor" type="plane" size="1 1 1"/>'
        f'<body pos="0 0 1"><freejoint/><geom {data} euler="20 40 60" rgba="1 0 0 1"/></body></worldbody></mujoco>'
    )


def view(scale=200.0):
    return Camera(np.array([0.0, 0.0, 1.0]), FORWARD, scale, 320, 240)


def rays_of(camera):
    """World points [height, width, 3] m in the picture's plane, at pixel middles."""
    right, up, _ = camera.axes
    a = (np.arange(camera.width) + 0.5 - camera.width / 2) / camera.scale
    b = (camera.height / 2 - np.arange(camera.height) - 0.5) / camera.scale
    return camera.centre + a[None, :, None] * right + b[:, None, None] * up


def painted(model):
    """Mask [240, 320] of the red shape, and its data."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    picture = paint(
        view(),
        [(Painter(model), data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3))],
        np.zeros(2),
    )
    colour = np.asarray(picture).astype(int)
    return colour[..., 0] - colour[..., 1] > 40, data


@pytest.mark.parametrize("kind", SHAPES)
def test_rays_hit_where_mujoco_says(kind):
    text, geom = SHAPES[kind]
    size = np.array([*map(float, text.split()), 0, 0])[:3]
    rng = np.random.default_rng(0)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    origins = rng.uniform(-0.35, 0.35, (400, 3)) - 2 * direction
    distance = distances(int(geom), size, origins, direction)
    here = np.eye(3).ravel()
    expected = [
        mujoco.mju_rayGeom(np.zeros(3), here, size, o, direction, int(geom), None) for o in origins
    ]
    expected = np.where(np.array(expected) < 0, np.inf, expected)
    assert np.isfinite(expected).sum() > 30
    np.testing.assert_allclose(distance, expected, atol=1e-6)
    met = np.isfinite(distance)
    points = origins[met] + distance[met, None] * direction
    outward = normals(int(geom), size, points, direction)
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1, atol=1e-6)
    assert (outward @ direction < 1e-6).all()
    # A step along the normal leaves the shape.
    beyond = distances(int(geom), size, points + 1e-4 * outward - 2 * direction, direction)
    assert (beyond > 2 - 1e-9).all()


@pytest.mark.parametrize("kind", [*SHAPES, "mesh"])
def test_every_shape_is_painted_where_it_is(kind):
    model = one_shape(kind, SHAPES.get(kind, ("",))[0], MESH if kind == "mesh" else "")
    mask, data = painted(model)
    rays = rays_of(view()).reshape(-1, 3)
    into = view().axes[2]
    ids = np.zeros(1, np.int32)
    seen = [
        mujoco.mj_ray(model, data, o - 5 * into, into, None, 1, -1, ids) >= 0 and ids[0] == 1
        for o in rays[::7]
    ]
    assert sum(seen) > 100
    assert (mask.ravel()[::7] == np.array(seen)).mean() > 0.985


def test_half_of_an_outline_darkens_what_is_behind(monkeypatch):
    """Else a body has no line on its left and upper side, as it has on the others."""
    monkeypatch.setattr(painter, "SMOOTH", 1)
    model = one_shape("box", "0.1 0.2 0.3")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    pose = (Painter(model), data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3))
    alone = Surroundings(water=True, clear=True)
    alpha = np.asarray(paint(view(), [pose], np.zeros(2), around=alone))[..., 3]
    line = round(255 * (1 - painter.OUTLINE))
    assert set(np.unique(alpha)) == {0, line, 255}
    across = alpha[120][alpha[120] > 0]
    assert (across[0], across[-1]) == (line, 255)


def test_nearer_shapes_hide_those_behind():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body pos="0 -0.5 1"><geom type="sphere" size="0.1" rgba="1 0 0 1"/></body>'
        '<body pos="0 0.5 1"><geom type="sphere" size="0.3" rgba="0 0 1 1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    camera = Camera(np.array([0.0, 0.0, 1.0]), FORWARD, 100, 200, 200, azimuth=0.0, elevation=0.1)
    for order in ([0, 1], [1, 0]):
        one = Painter(model)
        one.geoms, one.colours = one.geoms[order], one.colours[order]
        one.outlines = Silhouettes(model, one.geoms)
        picture = paint(
            camera, [(one, data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3))], np.zeros(2)
        )
        red, _, blue = picture.getpixel((100, 95))
        assert red > blue


def test_the_scale_on_the_floor_is_true():
    camera = view(150.0)
    one_metre = camera.pixels(np.array([[0, 0, 0], [1, 0, 0]], float))
    across = np.linalg.norm(one_metre[1] - one_metre[0])
    elsewhere = camera.pixels(np.array([[3, -2, 0], [4, -2, 0]], float))
    assert np.linalg.norm(elsewhere[1] - elsewhere[0]) == pytest.approx(across)
    assert band_width(150.0) == 0.5


def test_the_creature_walks_to_the_right_and_up_is_up():
    here, ahead, above = view().pixels(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]], float))
    assert ahead[0] > here[0]
    assert above[1] < here[1]


def test_only_geoms_that_mujoco_shows_are_drawn():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><material name="m" rgba="0 1 0 1"/></asset><worldbody><geom type="plane" size="1 1 1"/><body>'
        '<geom size="1" material="m"/><geom size="1" group="4"/><geom size="1" rgba="0 0 0 0"/></body></worldbody></mujoco>'
    )
    assert seen_geoms(model).tolist() == [1]
    assert geom_colours(model)[1].tolist() == [0, 1, 0, 1]


def test_every_shipped_creature_fills_its_picture(shipped):
    stage = Stage([record_walk(shipped, treading(shipped), 0.3)], 320, 180)
    with_creature = np.asarray(stage.picture(10), int)
    empty = np.asarray(paint(stage.camera(10), [], stage.origin), int)
    differs = np.abs(with_creature - empty).sum(2) > 30
    rows, columns = np.flatnonzero(differs.any(1)), np.flatnonzero(differs.any(0))
    assert differs.mean() > 0.05
    assert rows[0] > 2
    assert rows[-1] < 177
    assert columns[0] > 2
    assert columns[-1] < 317
    assert max(np.ptp(rows) / 180, np.ptp(columns) / 320) > 0.6


CROSSING = """<mujoco><worldbody>
<body pos="0 0 1"><geom type="box" size="0.30 0.12 0.12" euler="10 -20 30" rgba="1 0 0 1"/></body>
<body pos="0.05 -0.05 1.05"><geom type="box" size="0.10 0.25 0.22" euler="-30 15 5" rgba="0 0 1 1"/>
</body></worldbody></mujoco>"""
"""Two boxes of which each stands half inside the other, so that no order of boxes is right."""


def test_boxes_that_cross_are_split_where_they_meet():
    """Every pixel shows the box that MuJoCo's own ray meets first, apart from the dark lines."""
    model = mujoco.MjModel.from_xml_string(CROSSING)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = view(400.0)
    poses = data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3)
    colours = np.asarray(paint(camera, [(Painter(model), *poses)], np.zeros(2))).astype(int)
    rays, into = rays_of(camera), camera.axes[2]
    met = np.full((240, 320), -1)
    ids = np.zeros(1, np.int32)
    for place in np.ndindex(240, 320):
        if mujoco.mj_ray(model, data, rays[place] - 5 * into, into, None, 1, -1, ids) >= 0:
            met[place] = ids[0]
    red, blue = (colours[..., i] - colours[..., 2 - i] > 40 for i in (0, 2))
    for geom, shown in enumerate((red, blue)):
        assert (met == geom).sum() > 3000
        assert shown[met == geom].mean() > 0.96
        assert shown[met == 1 - geom].mean() < 0.02
