"""Bars (capsules) inside a shape: a sphere or capsule is one bar, other shapes are filled."""

import dataclasses
import itertools

import mujoco
import numpy as np

GEOM = mujoco.mjtGeom
MAX_BARS = 5
"""Largest number of bars side by side in a flat shape."""
STATIONS = 65
UNCOVERED = 0.1
"""Share of a shape's length above which an uncovered end gets a bar of its own."""
RINGS = 24
SHARP = 0.25
"""Radius of the bars along a box's edges, in half thicknesses of the box."""


@dataclasses.dataclass(frozen=True, eq=False)
class Bar:
    """A capsule in its body's frame.

    centre: [3] m. half: [3] m, from the centre to one end of the axis; zero for a sphere.
    radius: m.
    """

    centre: np.ndarray
    half: np.ndarray
    radius: float


def bars_of(model: mujoco.MjModel, geom: int) -> list[Bar]:
    """Bars of a geom, in its body's frame."""
    rot = np.zeros(9)
    mujoco.mju_quat2Mat(rot, model.geom_quat[geom])
    turn, pos = rot.reshape(3, 3), model.geom_pos[geom]
    bars = _own_frame(model, geom)
    return [Bar(pos + turn @ bar.centre, turn @ bar.half, bar.radius) for bar in bars]


def _own_frame(model: mujoco.MjModel, geom: int) -> list[Bar]:
    """Bars of a geom, in its own frame."""
    size = model.geom_size[geom]
    match int(model.geom_type[geom]):
        case GEOM.mjGEOM_SPHERE:
            return [Bar(np.zeros(3), np.zeros(3), float(size[0]))]
        case GEOM.mjGEOM_CAPSULE:
            return [Bar(np.zeros(3), np.array([0.0, 0.0, size[1]]), float(size[0]))]
        case GEOM.mjGEOM_BOX:
            return _fill(_SIGNS * size) + _edges(size)
        case GEOM.mjGEOM_ELLIPSOID:
            return _fill(_BALL * size)
        case GEOM.mjGEOM_CYLINDER:
            return _fill(_DRUM * [size[0], size[0], size[1]])
        case GEOM.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            return _fill(model.mesh_vert[start : start + count].astype(float))
        case _:
            return []


def _grid(*sides: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(*sides, indexing="ij"), -1).reshape(-1, len(sides))


def _ring(count: int) -> np.ndarray:
    angle = np.arange(count) * 2 * np.pi / count
    return np.stack([np.cos(angle), np.sin(angle)], 1)


def _ball(rings: int) -> np.ndarray:
    """Points of the unit sphere."""
    tilt = np.linspace(0, np.pi, rings // 2 + 1)
    circles = [np.c_[np.sin(t) * _ring(rings), np.full(rings, np.cos(t))] for t in tilt[1:-1]]
    return np.concatenate([*circles, [[0, 0, 1], [0, 0, -1]]])


_SIGNS = _grid(*[np.array([-1.0, 1.0])] * 3)
_BALL = _ball(RINGS)
_DRUM = np.concatenate([np.c_[_ring(RINGS), np.full(RINGS, end)] for end in (-1.0, 1.0)])


def _fill(points: np.ndarray) -> list[Bar]:
    """Bars inside the hull of points [n, 3] along its longest axis; side by side where it is flat.

    The origin must lie inside. It does for primitive shapes; a mesh has its centre of mass there.
    """
    # Imported late: the import is slow, and inspecting a run needs no bars.
    from scipy.spatial import ConvexHull, QhullError

    low, high = points.min(0), points.max(0)
    size = (high - low) / 2
    thin, broad, long = np.argsort(size)
    try:
        faces = ConvexHull(points).equations
    except (QhullError, ValueError):  # a sheet or a needle
        return []
    reach = size[broad] - size[thin]
    count = min(1 + int(np.ceil(reach / max(0.6 * size[thin], 1e-9))), MAX_BARS)
    offsets = np.linspace(-reach, reach, count) if count > 1 else np.zeros(1)
    bars = []
    for offset in offsets:
        line = np.zeros((STATIONS, 3))
        line[:, long] = np.linspace(low[long], high[long], STATIONS)
        line[:, broad] = offset
        inside = -(line @ faces[:, :3].T + faces[:, 3]).max(1)
        if inside.max() > 0:
            bars += _along(line, inside)
    return bars


def _edges(size: np.ndarray) -> list[Bar]:
    """Thin bars along the four longest edges of a box, which the thick ones do not cover."""
    thin, broad, long = np.argsort(size)
    radius = SHARP * size[thin]
    half = np.zeros(3)
    half[long] = size[long] - radius
    bars = []
    for side in itertools.product((-1.0, 1.0), repeat=2):
        centre = np.zeros(3)
        centre[[thin, broad]] = side * (size[[thin, broad]] - radius)
        bars.append(Bar(centre, half, float(radius)))
    return bars


def _along(line: np.ndarray, inside: np.ndarray) -> list[Bar]:
    """The largest bar on a line of points [n, 3], and one at each end that it leaves uncovered.

    inside: [n] m, depth of each point in the shape.
    """
    bar = _largest(line, inside)
    covered = np.linalg.norm(line - bar.centre, axis=1) <= np.linalg.norm(bar.half) + bar.radius
    first, last = np.flatnonzero(covered)[[0, -1]]
    ends = [slice(0, first), slice(last + 1, len(line))]
    worth = [e for e in ends if len(line[e]) > UNCOVERED * len(line) and inside[e].max() > 0]
    return [bar, *(_largest(line[e], inside[e]) for e in worth)]


def _largest(line: np.ndarray, inside: np.ndarray) -> Bar:
    """The bar of the greatest volume on the line."""
    best, most = Bar(line[0], np.zeros(3), 0.0), -1.0
    for radius in np.linspace(0.4, 1.0, 25) * inside.max():
        span = np.flatnonzero(inside >= radius * (1 - 1e-9))
        half = (line[span[-1]] - line[span[0]]) / 2
        volume = radius**2 * (2 * np.linalg.norm(half) + 4 / 3 * radius)
        if volume > most:
            best, most = Bar((line[span[0]] + line[span[-1]]) / 2, half, float(radius)), volume
    return best
