"""Shapes of a creature: hulls of balls about points, copied from the file's geoms or added.

A geom of the editable model holds two marks: `conaffinity` says whether it touches the floor, and a
group below 3 that it is drawn. Lengths are in m.
"""

import contextlib
import dataclasses

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from mjxgait.creature.geometry import rotation

GEOM = mujoco.mjtGeom
SIZES = {
    GEOM.mjGEOM_SPHERE: 1,
    GEOM.mjGEOM_CAPSULE: 2,
    GEOM.mjGEOM_CYLINDER: 2,
    GEOM.mjGEOM_ELLIPSOID: 3,
    GEOM.mjGEOM_BOX: 3,
}
"""Copied kinds of geoms beside meshes, and how many numbers give the size of each."""
HIDDEN = 3
"""Group of geoms that are not drawn."""
LITTLE = 0.5
"""Share of a part's span below which its drawn shapes are not all of it."""
MOST_POINTS = 48
"""Most points of a mesh's hull."""
RINGS = 16
GREY = np.array([0.3, 0.3, 0.3, 1.0])


@dataclasses.dataclass(frozen=True, eq=False)
class Shape:
    """A geom of the editable model: the hull of balls about points.

    body: its place in the list of bodies. points: [n, 3] in the body's frame. radius: of the balls.
    """

    geom: mujoco.MjsGeom
    body: int
    points: np.ndarray
    radius: float

    @property
    def solid(self) -> bool:
        """True if it touches the floor, or in the file anything."""
        return bool(self.geom.conaffinity)

    @property
    def seen(self) -> bool:
        """True if it is drawn."""
        return bool(self.geom.group < HIDDEN)

    @property
    def kind(self) -> str:
        """Kind in words, such as "capsule"."""
        return str(self.geom.type.name).removeprefix("mjGEOM_").lower()


@dataclasses.dataclass(frozen=True, eq=False)
class Bar:
    """A ball about one point [1, 3], or a capsule between two [2, 3], that can be added to a body.

    body, radius: as in `Shape`. seen: whether it is drawn.
    """

    body: int
    points: np.ndarray
    radius: float
    seen: bool

    @property
    def kind(self) -> str:
        """Kind in words."""
        return "sphere" if len(self.points) == 1 else "capsule"

    def added(self, body: mujoco.MjsBody, name: str = "") -> mujoco.MjsGeom:
        """Add it to its body, where it touches the floor."""
        colour = body.geoms[0].rgba if body.geoms else GREY
        place = {"pos": self.points[0]}
        if len(self.points) == 2:
            place = {"fromto": self.points.ravel()}
        kind = GEOM.mjGEOM_SPHERE if len(self.points) == 1 else GEOM.mjGEOM_CAPSULE
        geom = body.add_geom(name=name, type=kind, size=[self.radius, 0, 0], rgba=colour, **place)
        mark(geom, True, self.seen)
        return geom


def bar(body: int, a: np.ndarray, b: np.ndarray, radius: float, seen: bool) -> Bar:
    """Return a capsule between two points [3] of the body's frame; a ball if they are one."""
    if np.linalg.norm(b - a) < 1e-6:
        return Bar(body, (a + b)[None] / 2, radius, seen)
    return Bar(body, np.stack([a, b]), radius, seen)


def mark(geom: mujoco.MjsGeom, solid: bool, seen: bool) -> None:
    """Set whether a geom touches the floor and whether it is drawn."""
    geom.conaffinity = int(solid)
    geom.group = HIDDEN if not seen else 0 if solid else 1


def is_drawn(body: mujoco.MjsBody) -> bool:
    """Return whether a body has a shape that is drawn."""
    return any(geom.group < HIDDEN for geom in body.geoms)


def copy_geoms(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, model: mujoco.MjModel, number: int, scale: float
) -> None:
    """Add the geoms of a compiled model's body, without planes and height fields.

    scale: m per unit of length. A mesh becomes its hull; a flat one, which has none, a box.
    """
    for g in np.flatnonzero(model.geom_bodyid == number):
        kind = GEOM(model.geom_type[g])
        if kind not in SIZES and kind != GEOM.mjGEOM_MESH:
            continue
        material = int(model.geom_matid[g])
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[g]
        pos, quat = scale * model.geom_pos[g], model.geom_quat[g]
        geom = body.add_geom(type=kind, pos=pos, quat=quat, rgba=np.round(np.clip(rgba, 0, 1), 3))
        mark(
            geom,
            bool(model.geom_contype[g] or model.geom_conaffinity[g]),
            bool(model.geom_group[g] < HIDDEN and rgba[3] > 0),
        )
        if kind in SIZES:
            geom.size = scale * model.geom_size[g]
            continue
        start, count = (
            int(a[model.geom_dataid[g]]) for a in (model.mesh_vertadr, model.mesh_vertnum)
        )
        points = scale * hull_points(model.mesh_vert[start : start + count].astype(float))
        if _has_volume(points):
            geom.meshname = f"{body.name}_mesh_{len(body.geoms) - 1}"
            mesh = spec.add_mesh(name=geom.meshname, uservert=points.ravel())
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        else:
            low, high = points.min(0), points.max(0)
            geom.type, geom.size = GEOM.mjGEOM_BOX, np.maximum((high - low) / 2, 1e-4)
            geom.pos = pos + rotation(quat) @ (low + high) / 2


def reveal(shapes: list[Shape]) -> None:
    """Draw all shapes of a body if those that are drawn span little of it.

    Some files draw only the foot of a shin. A body with nothing drawn is left to others.
    """
    drawn = [shape for shape in shapes if shape.seen]
    if drawn and _span(drawn) < LITTLE * _span(shapes):
        for shape in shapes:
            mark(shape.geom, shape.solid, True)


def _span(shapes: list[Shape]) -> float:
    """Diagonal in m of the box around some shapes."""
    low = np.min([shape.points.min(0) - shape.radius for shape in shapes], axis=0)
    high = np.max([shape.points.max(0) + shape.radius for shape in shapes], axis=0)
    return float(np.linalg.norm(high - low))


def shapes_of(spec: mujoco.MjSpec, body: mujoco.MjsBody, place: int) -> list[Shape]:
    """Shapes of a body of the editable model. place: of the body in the list."""
    shapes = []
    for geom in body.geoms:
        points, radius = _points(spec, geom)
        if np.isnan(geom.fromto[0]):
            points = geom.pos + points @ rotation(geom.quat).T
        shapes.append(Shape(geom, place, points, radius))
    return shapes


def _points(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> tuple[np.ndarray, float]:
    """Points [n, 3] and radius, in the geom's own frame; of a bar in the body's."""
    a, b, c = (float(s) for s in geom.size)
    turn = np.linspace(0, 2 * np.pi, RINGS, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1)
    match geom.type:
        case GEOM.mjGEOM_SPHERE:
            return np.zeros((1, 3)), a
        case GEOM.mjGEOM_CAPSULE:
            ends = np.array([[0, 0, -b], [0, 0, b]])
            return (ends if np.isnan(geom.fromto[0]) else geom.fromto.reshape(2, 3)), a
        case GEOM.mjGEOM_CYLINDER:
            return np.concatenate([ring * a + [0, 0, -b], ring * a + [0, 0, b]]), 0.0
        case GEOM.mjGEOM_ELLIPSOID:
            tilts = np.linspace(-np.pi / 2, np.pi / 2, 9)
            ball = np.concatenate([ring * np.cos(t) + [0, 0, np.sin(t)] for t in tilts])
            return ball * [a, b, c], 0.0
        case GEOM.mjGEOM_MESH:
            return np.array(spec.mesh(geom.meshname).uservert, float).reshape(-1, 3), 0.0
        case _:
            corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            return corners * [a, b, c], 0.0


def hull_points(points: np.ndarray) -> np.ndarray:
    """Return at most `MOST_POINTS` corners of the convex hull of points [n, 3]."""
    with contextlib.suppress(QhullError, ValueError):  # flat: all points stay
        points = points[ConvexHull(points).vertices]
    if len(points) <= MOST_POINTS:
        return points
    # Spread out: each next point is the farthest from the chosen ones.
    chosen = [int(np.argmin(points[:, 2]))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    for _ in range(MOST_POINTS - 1):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return points[chosen]


def _has_volume(points: np.ndarray) -> bool:
    if len(points) < 4:
        return False
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spread[2] > 0.02 * spread[0])
