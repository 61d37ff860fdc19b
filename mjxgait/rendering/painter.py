"""Drawing of creatures on a floor with NumPy and Pillow alone: no GPU, no GL library, any machine.

Primitives are ray-cast and tested against a depth buffer; meshes are filled triangle by triangle.
Letters: `G` geoms.
"""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from mjxgait.rendering.floor import LIGHT as TOWARDS_LAMP
from mjxgait.rendering.floor import Camera, Relief
from mjxgait.rendering.shapes import Silhouettes, fill_mesh, hit
from mjxgait.rendering.surroundings import PLAIN, Surroundings, backdrop, write_over

SMOOTH = 2
"""Rays per pixel and direction."""
LIGHT = TOWARDS_LAMP / np.linalg.norm(TOWARDS_LAMP)
"""Unit vector towards the lamp, as (forward, left, up) of the creature."""
SHADOW_GREY = 0.30
OUTLINE, SOFT_OUTLINE, CREASE = 0.45, 0.62, 0.82
"""Brightness of the lines between bodies, between soft ones, and between faces of a soft box."""
HAZE = np.array([224, 226, 228], dtype=np.float32)
"""Colour that parts on the far side fade into, to distinguish left and right limbs."""
MOST_HAZE = 0.42
HARD_LIGHT, SOFT_LIGHT = (0.30, 0.52), (0.46, 0.36)
"""Brightness of the shade and of the lamp; soft bodies show their colours in the shade too."""
SMOOTH_FACE = 4
"""Number of the one face of a soft shape that is no box; a box has 1 to 3."""
COMPASS = np.stack(
    [
        np.cos(np.linspace(0, 2 * np.pi, 28, endpoint=False)),
        np.sin(np.linspace(0, 2 * np.pi, 28, endpoint=False)),
    ],
    1,
)
SEEN_GROUPS = 3
"""Number of visible geom groups: MuJoCo shows 0 to 2 by default."""


class Painter:
    """Data to draw one kind of creature, in any pose and place."""

    def __init__(self, model: mujoco.MjModel, soft: bool = False) -> None:
        """Read geoms, colours and outlines from the model.

        soft: draw softer lines, also along the edges of boxes.
        `far` [G] may be set: 1 for parts on the creature's far side, drawn paler; 0 for near ones.
        """
        self.model = model
        self.geoms = seen_geoms(model)
        self.colours = geom_colours(model)[self.geoms, :3]
        self.outlines = Silhouettes(model, self.geoms)
        self.far, self.soft = np.zeros(len(self.geoms)), soft

    def shadows(self, pos: np.ndarray, rot: np.ndarray) -> np.ndarray:
        """Return the outlines [geoms, points, 3] m that block light from straight above.

        pos, rot: world positions [ngeom, 3] m and rotations [ngeom, 3, 3] of its geoms.
        """
        directions = np.column_stack([COMPASS, np.zeros(len(COMPASS))])
        return self.outlines.outermost(pos[self.geoms], rot[self.geoms], directions)

    def draw(self, canvas: "_Canvas", pos: np.ndarray, rot: np.ndarray, first: int = 0) -> None:
        """Draw onto a canvas, with bodies numbered from `first` on."""
        pos, rot = pos[self.geoms], rot[self.geoms]
        right, up, _ = canvas.camera.axes
        rims = canvas.camera.pixels(
            self.outlines.outermost(pos, rot, np.stack([right, up, -right, -up]))
        )
        for i, geom in enumerate(self.geoms):
            body = first + int(self.model.geom_bodyid[geom])
            paint = _Paint(self.colours[i], float(self.far[i]), body, self.soft)
            kind = int(self.model.geom_type[geom])
            if kind == mujoco.mjtGeom.mjGEOM_MESH:
                fill_mesh(canvas, self.model, int(geom), pos[i], rot[i], paint)
            else:
                canvas.primitive(kind, self.model.geom_size[geom], pos[i], rot[i], rims[i], paint)


def paint(
    camera: Camera,
    creatures: Sequence[tuple[Painter, np.ndarray, np.ndarray]],
    origin: np.ndarray,
    relief: Relief | None = None,
    around: Surroundings = PLAIN,
) -> Image.Image:
    """Return one frame.

    Args:
      creatures: the painter of each, and world positions [ngeom, 3] m and rotations [ngeom, 3, 3]
        of its geoms.
      origin: [2] m, where the scale on the floor is zero.
      relief: heights of uneven ground.
      around: the medium, and the light.
    """
    fine = camera.enlarged(SMOOTH)
    picture = backdrop(camera, origin, relief, around).resize(
        (fine.width, fine.height), Image.Resampling.BICUBIC
    )
    if not around.water:
        rims = [painter.shadows(pos, rot) for painter, pos, rot in creatures]
        _shade_floor(picture, fine, rims, relief)
    canvas, first = _Canvas(np.asarray(picture, dtype=np.float32).copy(), fine), 0
    for painter, pos, rot in creatures:
        painter.draw(canvas, pos, rot, first)
        first += painter.model.nbody
    picture = canvas.image().reduce(SMOOTH)
    write_over(picture, camera, around)
    return picture


def _shade_floor(
    picture: Image.Image, camera: Camera, rims: Sequence[np.ndarray], relief: Relief | None
) -> None:
    """Darken the floor below the creatures, where the light from above does not reach it."""
    mask = Image.new("L", picture.size)
    draw = ImageDraw.Draw(mask)
    for points in rims:
        points[..., 2] = 0.0 if relief is None else relief(points[..., 0], points[..., 1])
        for polygon in camera.pixels(points):
            draw.polygon([tuple(p) for p in polygon], fill=round(255 * SHADOW_GREY))
    mask = mask.filter(ImageFilter.BoxBlur(max(camera.scale * 0.012, 1)))
    picture.paste((40, 44, 52), mask=mask)


@dataclasses.dataclass(frozen=True, eq=False)
class _Paint:
    """Look of a geom. colour: [3] 0 to 1. far, soft: see `Painter`. body: id, for outlines."""

    colour: np.ndarray
    far: float
    body: int
    soft: bool = False


class _Canvas:
    """A picture [height, width, 3] with a depth buffer."""

    def __init__(self, pixels: np.ndarray, camera: Camera) -> None:
        self.pixels, self.camera = pixels, camera
        self.depth = np.full(pixels.shape[:2], np.inf)
        self.body = np.full(pixels.shape[:2], -1, dtype=np.int32)
        self.face = np.zeros(pixels.shape[:2], dtype=np.int8)
        """Number of a soft body's face from 1; 0 elsewhere."""
        self.light = lamp_direction(camera.forward)

    def primitive(
        self,
        kind: int,
        size: np.ndarray,
        pos: np.ndarray,
        rot: np.ndarray,
        rim: np.ndarray,
        paint: _Paint,
    ) -> None:
        """Draw a geom; its outline lies between the pixels in rim [4, 2]."""
        x0, y0 = np.maximum(np.floor(rim.min(0)).astype(int) - 1, 0)
        x1, y1 = np.minimum(
            np.ceil(rim.max(0)).astype(int) + 2, [self.camera.width, self.camera.height]
        )
        if x0 >= x1 or y0 >= y1:
            return
        rays = self.camera.rays(np.arange(x0, x1), np.arange(y0, y1)).reshape(-1, 3)
        distance, normal = hit(kind, size, (rays - pos) @ rot, self.camera.axes[2] @ rot)
        shape = (y1 - y0, x1 - x0)
        flat = paint.soft and kind == mujoco.mjtGeom.mjGEOM_BOX
        self.cover(
            (slice(y0, y1), slice(x0, x1)),
            distance.reshape(shape),
            (normal @ rot.T).reshape(*shape, 3),
            paint,
            # A camera sees at most one of two opposite faces.
            1 + np.abs(normal).argmax(1).reshape(shape) if flat else None,
        )

    def cover(
        self,
        place: tuple[slice, slice],
        distance: np.ndarray,
        normal: np.ndarray,
        paint: _Paint,
        face: np.ndarray | None = None,
    ) -> None:
        """Paint a rectangle's pixels that are nearer than the present ones.

        distance: [h, w] m; normal: [h, w, 3] in the world. face: [h, w] numbers of faces, for lines.
        """
        nearer = distance < self.depth[place]
        self.depth[place][nearer] = distance[nearer]
        self.body[place][nearer] = paint.body
        if paint.soft:
            self.face[place][nearer] = SMOOTH_FACE if face is None else face[nearer]
        n = normal[nearer]
        # A lamp, the sky above and a little light from the floor.
        shade, sun = SOFT_LIGHT if paint.soft else HARD_LIGHT
        bright = shade + sun * np.maximum(n @ self.light, 0) + 0.20 * (0.5 + 0.5 * n[:, 2])
        colour = 255 * np.clip(bright[:, None] * (0.06 + 0.94 * paint.colour), 0, 1)
        self.pixels[place][nearer] = colour + MOST_HAZE * paint.far * (HAZE - colour)

    def image(self) -> Image.Image:
        """Return the picture, with dark lines between bodies and, softer, between faces."""
        between = _edges(self.body)
        soft = _edges(self.face > 0) | (self.face > 0)
        crease = _edges(self.face) & ~between
        for edge, light in (
            (between & ~soft, OUTLINE),
            (between & soft, SOFT_OUTLINE),
            (crease, CREASE),
        ):
            self.pixels[edge] *= light
        return Image.fromarray(self.pixels.astype(np.uint8))


def _edges(numbers: np.ndarray) -> np.ndarray:
    """Mask [height, width] of the pixels whose right or lower neighbour has another number."""
    edge = np.zeros(numbers.shape, dtype=bool)
    edge[:-1] |= numbers[:-1] != numbers[1:]
    edge[:, :-1] |= numbers[:, :-1] != numbers[:, 1:]
    return edge


def lamp_direction(forward: np.ndarray) -> np.ndarray:
    """Return the world's unit vector [3] towards the lamp. forward: [2] creature's direction."""
    return LIGHT @ np.array([[*forward, 0.0], [-forward[1], forward[0], 0.0], [0.0, 0.0, 1.0]])


def seen_geoms(model: mujoco.MjModel) -> np.ndarray:
    """Return the ids of a creature's visible geoms."""
    alpha = geom_colours(model)[:, 3] if model.ngeom else np.zeros(0)
    flat = np.isin(model.geom_type, [mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD])
    return np.flatnonzero(
        (model.geom_bodyid != 0) & (model.geom_group < SEEN_GROUPS) & ~flat & (alpha > 0)
    )


def geom_colours(model: mujoco.MjModel) -> np.ndarray:
    """Return red, green, blue and opacity [ngeom, 4], 0 to 1, of the material if a geom has one."""
    material = model.geom_matid
    return np.where(
        (material >= 0)[:, None],
        model.mat_rgba[np.maximum(material, 0)] if model.nmat else 0.0,
        model.geom_rgba,
    )
