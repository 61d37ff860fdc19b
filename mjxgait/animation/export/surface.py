"""Surface of a creature as triangles, one piece per colour, and bones along its limbs.

Axes are glTF's: Y up, forward +Z, left +X. A joint's Y axis leads to the next joint, and its X axis
is the axis of the part's hinge. A glTF joint has no tail; programs use the way to its child
instead, so the last joint of a limb gets a child at its tip, the end for inverse kinematics.
Letters: `V` vertices or points, `F` triangles, `B` joints.
"""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.animation.export.skeleton import Skeleton, world_poses
from mjxgait.creature.geometry import posed
from mjxgait.rendering.painter import geom_colours, seen_geoms
from mjxgait.rendering.shapes import mesh_of

GEOM = mujoco.mjtGeom
AROUND, RINGS = 20, 10
"""Number of parts of a round shape about its axis, and from pole to pole."""
FAR = 0.98
"""Share of the greatest distance from which points count among the farthest."""

Surface = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Points [V, 3] m, unit normals [V, 3], triangles [F, 3] counterclockwise from outside."""


def geom_surface(model: mujoco.MjModel, geom: int) -> Surface:
    """The surface of a geom in its own frame."""
    size = np.asarray(model.geom_size[geom], float)
    match int(model.geom_type[geom]):
        case GEOM.mjGEOM_SPHERE:
            return _ellipsoid(np.repeat(size[:1], 3))
        case GEOM.mjGEOM_ELLIPSOID:
            return _ellipsoid(size)
        case GEOM.mjGEOM_CAPSULE:
            return _capsule(size[0], size[1])
        case GEOM.mjGEOM_CYLINDER:
            return _cylinder(size[0], size[1])
        case GEOM.mjGEOM_MESH:
            return _mesh(*mesh_of(model, geom))
        case _:
            return _box(size)


def ball(radius: float) -> Surface:
    """The surface of a ball."""
    return _ellipsoid(np.repeat(radius, 3))


def disc(radius: float) -> Surface:
    """A level disc that is seen from above."""
    around = np.linspace(0, 2 * np.pi, 4 * AROUND, endpoint=False)
    rim = radius * np.stack([np.sin(around), np.zeros(len(around)), np.cos(around)], 1)
    fan = np.array([[0, i, i + 1] for i in range(1, len(around) - 1)])
    return rim, np.tile([0.0, 1.0, 0.0], (len(rim), 1)), fan


def far_end(model: mujoco.MjModel, body: int, qpos: np.ndarray) -> np.ndarray:
    """Vector [3] in m, in the world, from a body's origin to the mean of its farthest points."""
    data = posed(model, qpos)
    points = [np.zeros((1, 3))]
    for geom in np.flatnonzero(model.geom_bodyid == body):
        local, _, _ = geom_surface(model, int(geom))
        turned = local @ data.geom_xmat[geom].reshape(3, 3).T
        points.append(turned + data.geom_xpos[geom] - data.xpos[body])
    cloud = np.concatenate(points)
    far = np.linalg.norm(cloud, axis=1)
    middle: np.ndarray = cloud[far >= FAR * far.max()].mean(0)
    return middle


def _globe() -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors [V, 3] in rings from the south to the north pole, and triangles."""
    tilt = np.linspace(-np.pi / 2, np.pi / 2, RINGS + 1)
    around = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around), np.zeros(AROUND)], 1)
    points = (
        np.cos(tilt)[:, None, None] * circle + np.sin(tilt)[:, None, None] * [0.0, 0.0, 1.0]
    ).reshape(-1, 3)
    return points, _rings(RINGS + 1)


def _rings(count: int) -> np.ndarray:
    """Triangles between rings of `AROUND` vertices.

    The caller removes those without area at the poles.
    """
    ring, step = np.meshgrid(np.arange(count - 1), np.arange(AROUND), indexing="ij")
    a, b = ring * AROUND + step, ring * AROUND + (step + 1) % AROUND
    c, d = a + AROUND, b + AROUND
    return np.concatenate(
        [np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)]
    )


def _with_area(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = points[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return faces[area > 1e-12 + 1e-6 * area.max()]


def _ellipsoid(radii: np.ndarray) -> Surface:
    unit, faces = _globe()
    points, normals = unit * radii, unit / radii
    return (
        points,
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        _with_area(points, faces),
    )


def _capsule(radius: float, half: float) -> Surface:
    unit, _ = _globe()
    # The equator's ring occurs twice: once for each end.
    south, north = unit[: (RINGS // 2 + 1) * AROUND], unit[RINGS // 2 * AROUND :]
    normals = np.concatenate([south, north])
    points = np.concatenate([south * radius - [0, 0, half], north * radius + [0, 0, half]])
    return points, normals, _with_area(points, _rings(RINGS + 2))


def _cylinder(radius: float, half: float) -> Surface:
    around = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around), np.zeros(AROUND)], 1)
    top = np.array([0.0, 0.0, half])
    fan = np.array([[0, i, i + 1] for i in range(1, AROUND - 1)])
    points = np.concatenate([radius * circle - top, radius * circle + top] * 2)
    normals = np.concatenate(
        [
            circle,
            circle,
            np.tile([0.0, 0.0, -1.0], (AROUND, 1)),
            np.tile([0.0, 0.0, 1.0], (AROUND, 1)),
        ]
    )
    return points, normals, np.concatenate([_rings(2), fan[:, ::-1] + 2 * AROUND, fan + 3 * AROUND])


def _box(half: np.ndarray) -> Surface:
    points: list[list[np.ndarray]] = []
    normals: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = side
            u, v = np.roll([1.0, 0.0, 0.0], axis + 1), np.roll([1.0, 0.0, 0.0], axis + 2) * side
            faces.append(np.array([[0, 1, 2], [0, 2, 3]]) + 4 * len(faces))
            points.append(
                [(normal + a * u + b * v) * half for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            )
            normals.append(np.tile(normal, (4, 1)))
    return (
        np.concatenate([np.array(side) for side in points]),
        np.concatenate(normals),
        np.concatenate(faces),
    )


def _mesh(points: np.ndarray, faces: np.ndarray) -> Surface:
    """The surface of a mesh with flat shading: every triangle has its own vertices."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    keep = length > 1e-14
    normals = np.repeat(normals[keep] / length[keep, None], 3, axis=0)
    return corners[keep].reshape(-1, 3), normals, np.arange(3 * int(keep.sum())).reshape(-1, 3)


TIP = "_tip"
"""Suffix to a part's name for the joint at its end."""
CLEAR = 0.25
"""Share of the way to the farthest child; if the mean way is shorter, the bone keeps its axes."""
ALONG = 0.8
"""Cosine; an axis nearer than that to the bone is not used as its X axis."""
LIKED = np.array([1.0, 0.01, 0.1])
"""Side that a bone's X axis points to: left, else ahead, else up."""
LEFT, AHEAD = np.eye(3)[0], np.eye(3)[2]


def along_limbs(
    model: mujoco.MjModel, skeleton: Skeleton, rest: np.ndarray, axes: np.ndarray
) -> Skeleton:
    """The skeleton with its bones along the limbs of a pose [nq], and with their tips.

    The root keeps its axes, and so does a part with children all around it.
    """
    pos, rot = (each[0] for each in world_poses(model, skeleton, rest[None], axes))
    turn, hinges = skeleton.turn.copy(), _hinges(model, rest, axes)
    # From the world to a body's own axes.
    back = skeleton.turn @ rot.transpose(0, 2, 1)
    tips: dict[int, np.ndarray] = {}
    for b in range(1, len(skeleton.names)):
        body = skeleton.bodies[b]
        below = [c for c, parent in enumerate(skeleton.parent) if parent == b]
        if not below:
            tips[b] = axes @ far_end(model, body, rest)
        ways = pos[below] - pos[b] if below else tips[b][None]
        way, reach = ways.mean(0), np.linalg.norm(ways, axis=1).max()
        if np.linalg.norm(way) > CLEAR * reach:
            turn[b] = back[b] @ _frame(way, hinges.get(body))
    return _tipped(dataclasses.replace(skeleton, turn=turn), tips, back, axes)


def _tipped(
    skeleton: Skeleton, tips: Mapping[int, np.ndarray], back: np.ndarray, axes: np.ndarray
) -> Skeleton:
    """The skeleton with joints at its tips, which look ahead.

    tips: [3] m from the joint above, by its place.
    """
    ahead = np.stack([LEFT, AHEAD, np.cross(LEFT, AHEAD)], 1)
    offset = [axes.T @ back[b] @ way for b, way in tips.items()]
    return Skeleton(
        names=(*skeleton.names, *(skeleton.names[b] + TIP for b in tips)),
        parent=(*skeleton.parent, *tips),
        bodies=(*skeleton.bodies, *(skeleton.bodies[b] for b in tips)),
        offset=np.concatenate([skeleton.offset, offset]),
        turn=np.concatenate([skeleton.turn, back[list(tips)] @ ahead]),
    )


def _hinges(model: mujoco.MjModel, rest: np.ndarray, axes: np.ndarray) -> dict[int, np.ndarray]:
    """Axis [3] of each body's last hinge: a turn about it changes only the hinge's angle."""
    data = posed(model, rest)
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    return {int(model.jnt_bodyid[j]): axes @ data.xaxis[j] for j in hinges}


def _frame(way: np.ndarray, hinge: np.ndarray | None) -> np.ndarray:
    """Axes [3, 3] with Y along a way [3] and X along the hinge.

    Without a usable hinge X points to the left, or ahead if the way leads to a side.
    """
    y = way / np.linalg.norm(way)
    sides = [LEFT, AHEAD] if hinge is None else [hinge, LEFT, AHEAD]
    side = next(axis for axis in sides if abs(axis @ y) < ALONG)
    x = side - (side @ y) * y
    x /= np.copysign(np.linalg.norm(x), x @ LIKED)
    return np.stack([x, y, np.cross(x, y)], 1)


@dataclasses.dataclass(frozen=True, eq=False)
class Piece:
    """A surface of one colour.

    name: of its material. colour: sRGB [4]. points: [V, 3] m. normals: [V, 3]. faces: [F, 3]
    counterclockwise from outside. joints: [V] places in the skeleton.
    """

    name: str
    colour: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    joints: np.ndarray


def pieces_of(
    model: mujoco.MjModel, skeleton: Skeleton, axes: np.ndarray, rest: np.ndarray
) -> list[Piece]:
    """The visible surface of the skeleton's bodies in a pose [nq]."""
    data = posed(model, rest)
    colours = geom_colours(model)
    geoms = [int(g) for g in seen_geoms(model) if int(model.geom_bodyid[g]) in skeleton.bodies]
    return [
        _piece(model, data, skeleton, axes, [g for g in geoms if tuple(colours[g]) == colour])
        for colour in dict.fromkeys(tuple(colours[g]) for g in geoms)
    ]


def linear(colour: np.ndarray) -> np.ndarray:
    """Convert sRGB [3] to the linear colours of glTF and USD."""
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def _piece(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    skeleton: Skeleton,
    axes: np.ndarray,
    geoms: list[int],
) -> Piece:
    """The piece made of geoms of one colour."""
    points, normals, faces, joints, count = [], [], [], [], 0
    for g in geoms:
        own, facing, triangles = geom_surface(model, g)
        turn = axes @ data.geom_xmat[g].reshape(3, 3)
        points.append(own @ turn.T + axes @ data.geom_xpos[g])
        normals.append(facing @ turn.T)
        faces.append(triangles + count)
        joints.append(np.full(len(own), skeleton.bodies.index(int(model.geom_bodyid[g]))))
        count += len(own)
    arrays = (np.concatenate(each) for each in (points, normals, faces, joints))
    return Piece(_name(model, geoms[0]), geom_colours(model)[geoms[0]], *arrays)


def _name(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom's material, else of its body."""
    material, body = int(model.geom_matid[geom]), int(model.geom_bodyid[geom])
    called = model.mat(material).name if material >= 0 else model.body(body).name
    return str(called) or f"body_{body}"
