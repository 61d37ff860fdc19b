"""Drawing of creatures on a floor with NumPy and Pillow alone: no GPU, no GL library, any machine.

Primitives are ray-cast and tested against a depth buffer; meshes are filled triangle by triangle.
Letters: `G` geoms.
"""

import dataclasses
from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from mjxgait.rendering.floor import LIGHT as TOWARDS_LAMP
from mjxgait.rendering.floor import SMOOTH, Camera, Relief
from mjxgait.rendering.shapes import Silhouettes, distances, fill_mesh, normals
from mjxgait.rendering.surroundings import (
    PLAIN,
    SHADE,
    Surroundings,
    backdrop,
    write_over,
)

LIGHT = TOWARDS_LAMP / np.linalg.norm(TOWARDS_LAMP)
"""Unit vector towards the lamp, as (forward, left, up) of the creature."""
SHADOW_GREY = 0.30
SHADOW_BLUR = 0.012
"""Half the width of a shadow's edge in m."""
Box = tuple[int, int, int, int]
"""Left, upper, right and lower pixel of a part of a picture."""
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
UNTURNED = np.eye(3)
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

    def rims(self, camera: Camera, pos: np.ndarray, rot: np.ndarray) -> np.ndarray:
        """Return the pixels [geoms, 4, 2] between which each geom lies; see `shadows`."""
        right, up, _ = camera.axes
        sides = np.stack([right, up, -right, -up])
        return camera.pixels(self.outlines.outermost(pos[self.geoms], rot[self.geoms], sides))

    def draw(self, canvas: "_Canvas", pos: np.ndarray, rot: np.ndarray, first: int = 0) -> None:
        """Draw onto a canvas, with bodies numbered from `first` on."""
        rims = self.rims(canvas.camera, pos, rot)
        pos, rot = pos[self.geoms], rot[self.geoms]
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

    Returns:
      RGB; RGBA if the surroundings are clear.
    """
    picture = backdrop(camera, origin, relief, around)
    if not around.water:
        shadows = [painter.shadows(pos, rot) for painter, pos, rot in creatures]
        _shade_floor(picture, camera, shadows, relief)
    rims = [painter.rims(camera, pos, rot).reshape(-1, 2) for painter, pos, rot in creatures]
    # Nothing is computed where no body is: it is most of the picture.
    if box := _box_of(rims, camera, 2):
        bodies = _bodies(camera.cropped(box), creatures)
        if around.clear:
            picture.alpha_composite(bodies, box[:2])
        else:
            picture.paste(bodies, box, bodies)
    write_over(picture, camera, around)
    return picture


def _bodies(
    camera: Camera, creatures: Sequence[tuple[Painter, np.ndarray, np.ndarray]]
) -> Image.Image:
    """Return the creatures on a transparent picture; see `paint`."""
    canvas, first = _Canvas(camera.enlarged(SMOOTH)), 0
    for painter, pos, rot in creatures:
        painter.draw(canvas, pos, rot, first)
        first += painter.model.nbody
    return canvas.image().reduce(SMOOTH)


def _box_of(pixels: Sequence[np.ndarray], camera: Camera, margin: int) -> Box | None:
    """Part of the picture around pixels, each [n, 2]; None if they lie outside."""
    if not sum(map(len, pixels)):
        return None
    points = np.concatenate(pixels)
    x0, y0 = np.maximum(np.floor(points.min(0)).astype(int) - margin, 0).tolist()
    most = [camera.width, camera.height]
    x1, y1 = np.minimum(np.ceil(points.max(0)).astype(int) + margin, most).tolist()
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def _shade_floor(
    picture: Image.Image, camera: Camera, shadows: Sequence[np.ndarray], relief: Relief | None
) -> None:
    """Darken the floor below the creatures, where the light from above does not reach it."""
    polygons = []
    for points in shadows:
        flat = 0.0 if relief is None else relief(points[..., 0], points[..., 1])
        level = np.broadcast_to(flat, points.shape[:-1])
        polygons += list(camera.pixels(np.concatenate([points[..., :2], level[..., None]], -1)))
    blur = max(camera.scale * SHADOW_BLUR, 0.5)
    box = _box_of(polygons, camera, int(blur) + 2)
    if box is None:
        return
    mask = Image.new("L", (box[2] - box[0], box[3] - box[1]))
    draw = ImageDraw.Draw(mask)
    for polygon in polygons:
        draw.polygon([tuple(p) for p in polygon - box[:2]], fill=round(255 * SHADOW_GREY))
    picture.paste(SHADE, box, mask.filter(ImageFilter.BoxBlur(blur)))


@dataclasses.dataclass(frozen=True, eq=False)
class _Paint:
    """Look of a geom. colour: [3] 0 to 1. far, soft: see `Painter`. body: id, for outlines."""

    colour: np.ndarray
    far: float
    body: int
    soft: bool = False


class _Canvas:
    """A transparent picture [height, width] with a depth buffer."""

    def __init__(self, camera: Camera) -> None:
        self.camera, shape = camera, (camera.height, camera.width)
        self.pixels = np.zeros((*shape, 3), dtype=np.float32)
        self.depth = np.full(shape, np.inf, dtype=np.float32)
        self.body = np.full(shape, -1, dtype=np.int32)
        self.face = np.zeros(shape, dtype=np.int8)
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
        into, size = self.camera.axes[2], size.astype(np.float32)
        # Rays begin at the geom's depth and in its frame, so single precision will do.
        depth = into @ (pos - self.camera.centre)
        start = (self.camera.centre + depth * into - pos) @ rot
        right, up, way = (self.camera.axes @ rot).astype(np.float32)
        a, b = self.camera.offsets(np.arange(x0, x1), np.arange(y0, y1))
        grid = np.empty((3, len(b), len(a)), dtype=np.float32)
        for i in range(3):
            np.add(start[i] + a * right[i], (b * up[i])[:, None], out=grid[i], casting="same_kind")
        rays = grid.reshape(3, -1)
        distance = distances(kind, size, rays.T, way)

        def normal(covered: np.ndarray) -> np.ndarray:
            points = rays[:, covered].T + distance[covered, None] * way
            return normals(kind, size, points, way)

        place = slice(y0, y1), slice(x0, x1)
        flat = paint.soft and kind == mujoco.mjtGeom.mjGEOM_BOX
        self.cover(place, (distance + depth).reshape(len(b), -1), normal, paint, rot, flat)

    def cover(
        self,
        place: tuple[slice, slice],
        distance: np.ndarray,
        normal: Callable[[np.ndarray], np.ndarray],
        paint: _Paint,
        rot: np.ndarray = UNTURNED,
        flat: bool = False,
    ) -> None:
        """Paint a rectangle's pixels that are nearer than the present ones.

        Args:
          distance: [h, w] m.
          normal: returns the normals [n or 1, 3] of pixels [n], in a frame that rot [3, 3] turns
            into the world.
          flat: whether it has three faces with lines between them.
        """
        nearer = distance < self.depth[place]
        covered = np.flatnonzero(nearer)
        if not len(covered):
            return
        own = normal(covered)
        np.copyto(self.depth[place], distance, where=nearer)
        np.copyto(self.body[place], paint.body, where=nearer)
        if paint.soft:
            # A camera sees at most one of two opposite faces.
            self.face[place][nearer] = 1 + np.abs(own).argmax(1) if flat else SMOOTH_FACE
        # A lamp, the sky above and a little light from the floor.
        shade, sun = SOFT_LIGHT if paint.soft else HARD_LIGHT
        lamp, up = (rot.T @ self.light).astype(np.float32), rot[2].astype(np.float32)
        bright = shade + sun * np.maximum(own @ lamp, 0) + 0.20 * (0.5 + 0.5 * (own @ up))
        full = (255 * (0.06 + 0.94 * paint.colour)).astype(np.float32)
        colour = np.minimum(bright[:, None] * full, 255)
        self.pixels[place][nearer] = colour + MOST_HAZE * paint.far * (HAZE - colour)

    def image(self) -> Image.Image:
        """Return the picture, with dark lines between bodies and, softer, between faces."""
        between, outside = _edges(self.body), self.body < 0
        lines = [(between, OUTLINE)]
        if self.face.any():
            soft = _edges(self.face > 0) | (self.face > 0)
            crease = _edges(self.face) & ~between
            lines = [(between & ~soft, OUTLINE), (between & soft, SOFT_OUTLINE), (crease, CREASE)]
        alpha = np.where(outside, np.uint8(0), np.uint8(255))
        for edge, light in lines:
            self.pixels[edge] *= light
            # Half of an outline lies beside its body and darkens what is behind.
            alpha[edge & outside] = round(255 * (1 - light))
        return Image.fromarray(np.dstack([self.pixels.astype(np.uint8), alpha]))


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
