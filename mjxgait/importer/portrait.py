"""Drawing of a creature in its standing pose with the contents of creature.toml, and its facts."""

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from mjxgait.creature import Creature
from mjxgait.importer.stand_test import Held
from mjxgait.rendering.floor import DARK_INK, Camera, font
from mjxgait.rendering.painter import Painter, paint
from mjxgait.rendering.shapes import Silhouettes

WIDTH, HEIGHT = 1100, 760
ROOM = 1.7
"""Size of the picture, in units of the creature."""
FOOT, FORWARD, LEFT, UP, GROUND = (
    (214, 84, 0),
    (200, 30, 30),
    (20, 140, 40),
    (30, 60, 200),
    (130, 90, 160),
)
PAIRS = (
    (0, 110, 160),
    (150, 80, 0),
    (120, 0, 120),
    (0, 120, 70),
    (160, 0, 50),
    (90, 90, 0),
    (60, 60, 60),
)
ALONE = (255, 255, 255)


def facts(creature: Creature, held: Held) -> list[str]:
    """Lines that report the loaded creature and how it stood."""
    state = "stands" if held.stands else "does not stand"
    touched = f', "{held.touched}" touches the floor' if held.touched else ""
    names = creature.joints.names
    pairs = [(a, int(b)) for a, b in enumerate(creature.mirror.partner) if a < b]
    own = [names[a] for a, b in enumerate(creature.mirror.partner) if a == b]
    mirror = (
        [
            f"  {names[a]} <-> {'-' if creature.mirror.sign[a] < 0 else ''}{names[b]}"
            for a, b in pairs
        ]
        if creature.mirror.symmetric
        else []
    )
    return [
        f"{creature.name}: {creature.frame.mass:.3g} kg, hip height "
        f"{creature.frame.hip_height:.3g} m, body length {creature.frame.body_length:.3g} m",
        f"joints: {len(names)}, feet: {', '.join(creature.feet.names)}",
        f"it {state} for 2 s: upright {held.up:.2f}, height {held.height:.2f} of the start, joints "
        f"sag {held.sag:.3f} rad{touched}",
        *(["mirror pairs:", *mirror] if mirror else ["no mirror image"]),
        *(
            [f"their own mirror image: {', '.join(own)}"]
            if creature.mirror.symmetric and own
            else []
        ),
    ]


def portrait(creature: Creature) -> Image.Image:
    """Draw the creature from its right side.

    Feet are ringed and axes drawn; joints with the same number mirror each other.
    """
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.stand_qpos
    mujoco.mj_forward(creature.model, data)
    painter = Painter(creature.model)
    places = (data.geom_xpos.copy(), data.geom_xmat.reshape(-1, 3, 3).copy())
    camera = _camera(creature, painter, places)
    picture = paint(camera, [(painter, *places)], data.xpos[creature.trunk][:2])
    draw = ImageDraw.Draw(picture)
    _mark_feet(draw, camera, creature, data)
    _mark_joints(draw, camera, creature, data)
    _mark_axes(draw, camera, creature, data)
    legend = (
        "red forward, green left, blue up; rings: feet; "
        "a number: joints that mirror each other (- with the opposite sign); white: alone"
    )
    draw.text((12, 10), f"{creature.name}\n{legend}", fill=DARK_INK, font=font(15))
    return picture


def _camera(creature: Creature, painter: Painter, places: tuple[np.ndarray, np.ndarray]) -> Camera:
    forward = (creature.frame.stand_rot @ creature.frame.forward)[:2]
    flat = Camera(
        np.zeros(3),
        forward / np.linalg.norm(forward),
        1.0,
        0,
        0,
        azimuth=np.radians(35.0),
        elevation=np.radians(22.0),
    )
    if not len(painter.geoms):
        corners = places[0]
    else:
        directions = np.concatenate([np.eye(3), -np.eye(3)])
        outline = Silhouettes(creature.model, painter.geoms)
        corners = outline.outermost(
            places[0][painter.geoms], places[1][painter.geoms], directions
        ).reshape(-1, 3)
    seen = flat.pixels(corners)
    size = np.maximum(np.ptp(seen, axis=0), 1e-3)
    scale = float(min(WIDTH / (ROOM * size[0]), HEIGHT / (ROOM * size[1])))
    centre = (corners.min(0) + corners.max(0)) / 2
    return Camera(
        centre, flat.forward, scale, WIDTH, HEIGHT, azimuth=flat.azimuth, elevation=flat.elevation
    )


def _mark_feet(
    draw: ImageDraw.ImageDraw, camera: Camera, creature: Creature, data: mujoco.MjData
) -> None:
    for g in creature.feet.stepping:
        _ring(draw, camera.pixels(data.geom_xpos[g]), 13, FOOT)
    for g in creature.feet.ground:
        _ring(draw, camera.pixels(data.geom_xpos[g]), 13, GROUND)
    for foot, name in enumerate(creature.feet.names):
        geom = creature.feet.geoms_of(foot)[0]
        x, y = camera.pixels(data.geom_xpos[geom])
        draw.text((x, y + 16), name, fill=FOOT, font=font(13), anchor="ma")


def _ring(
    draw: ImageDraw.ImageDraw, at: np.ndarray, radius: float, colour: tuple[int, int, int]
) -> None:
    x, y = at
    draw.ellipse([x - radius, y - radius, x + radius, y + radius], outline=colour, width=3)


def _mark_joints(
    draw: ImageDraw.ImageDraw, camera: Camera, creature: Creature, data: mujoco.MjData
) -> None:
    """Draw a numbered dot per joint; joints at one point stand side by side."""
    firsts = dict.fromkeys(
        min(j, int(partner)) for j, partner in enumerate(creature.mirror.partner)
    )
    numbers = {first: n for n, first in enumerate(firsts)}
    at_point: dict[tuple[int, int], int] = {}
    for j, name in enumerate(creature.joints.names):
        anchor = camera.pixels(data.xanchor[creature.model.joint(name).id])
        partner = int(creature.mirror.partner[j])
        number = numbers[min(j, partner)]
        spot = (round(anchor[0] / 12), round(anchor[1] / 12))
        beside = at_point.get(spot, 0)
        at_point[spot] = beside + 1
        x, y = anchor + np.array([22.0 * beside, 0.0])
        alone = partner == j
        fill = ALONE if alone or not creature.mirror.symmetric else PAIRS[number % len(PAIRS)]
        draw.ellipse([x - 9, y - 9, x + 9, y + 9], fill=fill, outline=DARK_INK)
        sign = "-" if creature.mirror.symmetric and creature.mirror.sign[j] < 0 else ""
        draw.text(
            (x, y),
            f"{sign}{number + 1}",
            fill=DARK_INK if fill == ALONE else (255, 255, 255),
            font=font(11),
            anchor="mm",
        )


def _mark_axes(
    draw: ImageDraw.ImageDraw, camera: Camera, creature: Creature, data: mujoco.MjData
) -> None:
    origin, length = (
        data.xpos[creature.trunk],
        min(0.6 * creature.frame.body_length, 0.9 * creature.frame.stand_height),
    )
    for axis, colour, name in (
        (creature.frame.forward, FORWARD, "forward"),
        (creature.frame.left, LEFT, "left"),
        (creature.frame.up, UP, "up"),
    ):
        a, b = camera.pixels(
            np.stack([origin, origin + length * (creature.frame.stand_rot @ axis)])
        )
        draw.line([tuple(a), tuple(b)], fill=colour, width=4)
        along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
        across = np.array([-along[1], along[0]])
        draw.polygon(
            [tuple(b + 12 * along), tuple(b + 6 * across), tuple(b - 6 * across)], fill=colour
        )
        draw.text(tuple(b + 26 * along), name, fill=colour, font=font(14), anchor="mm")
