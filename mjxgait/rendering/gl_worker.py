"""Rendering with MuJoCo's own renderer in a separate process, so that a missing or crashing GL
library harms nothing else.

`python -m mjxgait.rendering.gl_worker SCENE.npz` writes raw RGB frames to its standard output.
Letters: `F` frames, `N` creatures.
"""

import sys

import mujoco
import numpy as np
from PIL import Image

from mjxgait.rendering.floor import Camera
from mjxgait.rendering.surroundings import tank

FLOOR_GREY = 0.86
BAND_GREY = 0.81
BAND_HEIGHT = 1e-3
"""m above the floor, so that the two do not flicker."""
SMOOTH = 2
"""Rendered pixels per pixel and direction: smoother than GL's own multisampling, and faster on a
CPU.
"""
SHADOW = 2048


def main(path: str) -> None:
    """Draw every frame of a scene file; see `gl.scene_file`."""
    with np.load(path) as scene:
        parts = {name: scene[name] for name in scene.files}
    model = _prepared(_compiled(parts), parts)
    width, height = (SMOOTH * int(n) for n in parts["size"])
    data = [mujoco.MjData(model) for _ in range(parts["qpos"].shape[1])]
    camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
    camera.azimuth, camera.elevation, camera.distance = (float(n) for n in parts["view"])
    with mujoco.Renderer(model, height, width, max_geom=20_000) as renderer:
        for poses, centre in zip(parts["qpos"], parts["centre"], strict=True):
            camera.lookat[:] = centre
            for one, qpos in zip(data, poses, strict=True):
                one.qpos[:] = qpos
                mujoco.mj_forward(model, one)
            renderer.update_scene(data[0], camera, option)
            moving = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
            for other in data[1:]:
                mujoco.mjv_addGeoms(
                    model, other, option, mujoco.MjvPerturb(), moving, renderer.scene
                )
            _add_lamp(renderer.scene, centre, parts["lamp"], 0.25 * camera.distance)
            _keep_floor_out_of_shadows(renderer.scene, model.geom("floor").id)
            _add_bands(renderer.scene, parts)
            pixels = renderer.render()
            if parts["water"]:
                pixels = _in_water(pixels, _camera_of(parts, centre))
            sys.stdout.buffer.write(Image.fromarray(pixels).reduce(SMOOTH).tobytes())


def _camera_of(parts: dict[str, np.ndarray], centre: np.ndarray) -> Camera:
    """The painter's camera of a frame, with all rendered pixels."""
    scale, azimuth, elevation = (float(n) for n in parts["angles"])
    width, height = (int(n) for n in parts["size"])
    camera = Camera(centre, parts["forward"], scale, width, height, azimuth, elevation)
    return camera.enlarged(SMOOTH)


def _in_water(pixels: np.ndarray, camera: Camera) -> np.ndarray:
    """The painter's water where GL has drawn nothing, which it leaves black."""
    empty = ~pixels.any(axis=-1, keepdims=True)
    return np.where(empty, np.asarray(tank(camera)), pixels)


def _compiled(parts: dict[str, np.ndarray]) -> mujoco.MjModel:
    """Model with a height field as floor if the ground is uneven."""
    if "heights" not in parts:
        return mujoco.MjModel.from_xml_string(str(parts["xml"]))
    heights, spec = parts["heights"], mujoco.MjSpec.from_string(str(parts["xml"]))
    low, span = heights.min(), max(np.ptp(heights), 1e-6)
    rows, columns = heights.shape
    spec.add_hfield(
        name="ground",
        nrow=rows,
        ncol=columns,
        size=[*parts["ground_half"], span, 1.0],
        userdata=np.zeros(heights.size),
    )
    floor, turn = spec.geom("floor"), np.arctan2(*parts["forward"][::-1]) / 2
    floor.type, floor.hfieldname = mujoco.mjtGeom.mjGEOM_HFIELD, "ground"
    floor.pos, floor.quat = [*parts["ground_at"], low], [np.cos(turn), 0, 0, np.sin(turn)]
    model = spec.compile()
    model.hfield_data[:] = ((heights - low) / span).ravel()
    return model


def _prepared(model: mujoco.MjModel, parts: dict[str, np.ndarray]) -> mujoco.MjModel:
    """Set parallel rays and a plain floor for the bands, and turn the model's own lamps off: all
    creatures are lit alike.
    """
    width, height = (SMOOTH * int(n) for n in parts["size"])
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    model.vis.global_.orthographic, model.vis.global_.fovy = 1, float(parts["extent"])
    model.vis.quality.offsamples, model.vis.quality.shadowsize = 0, SHADOW
    model.light_active[:] = 0
    head = model.vis.headlight
    head.active, head.ambient[:], head.diffuse[:], head.specular[:] = 1, 0.42, 0.18, 0.05
    floor = model.geom("floor").id
    model.geom_matid[floor] = -1
    model.geom_rgba[floor] = [*FLOOR_GREY * parts["tint"][0], 0 if parts["water"] else 1]
    if model.geom_type[floor] == mujoco.mjtGeom.mjGEOM_PLANE:
        model.geom_size[floor, :2] = 0
    return model


def _add_lamp(
    scene: mujoco.MjvScene, centre: np.ndarray, towards: np.ndarray, distance: float
) -> None:
    """Add a distant lamp that casts shadows. towards: [3] unit."""
    lamp = scene.lights[scene.nlight]
    lamp.type = int(mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    lamp.headlight, lamp.castshadow = 0, 1
    lamp.pos[:], lamp.dir[:] = centre + distance * towards, -towards
    lamp.ambient[:], lamp.diffuse[:], lamp.specular[:] = 0.0, 0.6, 0.1
    scene.nlight += 1


def _keep_floor_out_of_shadows(scene: mujoco.MjvScene, floor: int) -> None:
    """Make the floor decoration, which casts no shadow; else its own would speckle it."""
    for geom in scene.geoms[: scene.ngeom]:
        if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.objid == floor:
            geom.category = int(mujoco.mjtCatBit.mjCAT_DECOR)


def _add_bands(scene: mujoco.MjvScene, parts: dict[str, np.ndarray]) -> None:
    """Add bands across the direction of travel at points [n, 2] m."""
    middles, width, forward = parts["bands"], float(parts["band_width"]), parts["forward"]
    turn = np.array([[forward[0], -forward[1], 0], [forward[1], forward[0], 0], [0, 0, 1]])
    for middle in middles:
        geom = scene.geoms[scene.ngeom]
        size, colour = (
            np.array([width / 2, 50.0, BAND_HEIGHT / 2]),
            np.array([*BAND_GREY * parts["tint"][1], 1], np.float32),
        )
        mujoco.mjv_initGeom(
            geom,
            mujoco.mjtGeom.mjGEOM_BOX,
            size,
            np.append(middle, BAND_HEIGHT / 2),
            turn.ravel(),
            colour,
        )
        geom.category = int(mujoco.mjtCatBit.mjCAT_DECOR)
        scene.ngeom += 1


if __name__ == "__main__":
    main(sys.argv[1])
