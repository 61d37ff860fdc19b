"""Printed parts: convex blocks, cut where they would meet their parent, as shells with a lid.

All lengths in m. Letters: `F` faces, `V` corners.
"""

import dataclasses
import itertools
from collections.abc import Iterable, Sequence

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

NEAR = 1e-7
"""m; nearer points are one."""


@dataclasses.dataclass(frozen=True, eq=False)
class Solid:
    """Convex block: all points with normals · point <= offsets.

    normals: [F, 3] unit vectors, the first six along the block's own axes: +x +y +z -x -y -z.
    offsets: [F] m.
    """

    normals: np.ndarray
    offsets: np.ndarray

    def cut(self, normals: Iterable[np.ndarray], offset: float) -> "Solid":
        """Return what of it is below planes with these normals. offset: m, of all of them."""
        more = np.array([*normals]).reshape(-1, 3)
        offsets = np.append(self.offsets, np.full(len(more), offset))
        return Solid(np.vstack([self.normals, more]), offsets)

    def moved_faces(self, by: np.ndarray | float) -> "Solid":
        """Return it with faces moved outward. by: m, for all or [F]."""
        return Solid(self.normals, self.offsets + by)

    def holds(self, point: np.ndarray) -> bool:
        """Return whether a point [3] is inside or on the surface."""
        return bool((self.normals @ point <= self.offsets + NEAR).all())

    def corners(self) -> np.ndarray | None:
        """Return the corners [V, 3]; None if nothing is left."""
        # The largest ball inside gives the inner point that the intersection of planes needs.
        ball = linprog(
            [0, 0, 0, -1],
            A_ub=np.column_stack([self.normals, np.ones(len(self.normals))]),
            b_ub=self.offsets,
            bounds=[(None, None)] * 3 + [(0, None)],
        )
        if ball.status != 0 or ball.x[3] < 1e3 * NEAR:
            return None
        planes = np.column_stack([self.normals, -self.offsets])
        found = HalfspaceIntersection(planes, ball.x[:3]).intersections
        return np.unique(np.round(found / NEAR), axis=0) * NEAR

    def volume(self) -> float:
        """Return the volume in m³."""
        corners = self.corners()
        return 0.0 if corners is None else float(ConvexHull(corners).volume)


def block(half: np.ndarray, middle: np.ndarray) -> Solid:
    """Return a box from its half sides [3] and its middle [3]."""
    return Solid(np.vstack([np.eye(3), -np.eye(3)]), np.append(half + middle, half - middle))


@dataclasses.dataclass(frozen=True, eq=False)
class Print:
    """Printed block: a shell that is open on one side, and its lid.

    solid: the block from outside. cavity: room inside; None for a block without, printed solid.
    meshes: by name, such as shell and lid. opened: number of the open side, as in `Solid.normals`.
    """

    solid: Solid
    cavity: Solid | None
    meshes: dict[str, trimesh.Trimesh]
    opened: int

    @property
    def volume(self) -> float:
        """Volume of plastic in m³."""
        return float(sum(mesh.volume for mesh in self.meshes.values()))


def printed(solid: Solid, wall: float, kept: Sequence[np.ndarray]) -> Print:
    """Return a block with walls of this thickness, open on its largest side.

    kept: joints [3] on its surface; their sides stay closed if another side can be opened.
    """
    side = _side_to_open(solid, kept)
    top = solid.offsets[side] - wall
    body = Solid(solid.normals, np.where(np.arange(len(solid.offsets)) == side, top, solid.offsets))
    moved = np.where(np.arange(len(solid.offsets)) == side, 0.0, -wall)
    cavity = body.moved_faces(moved)
    inner, outer = cavity.corners(), body.corners()
    lid = solid.cut([-solid.normals[side]], -top).corners()
    if inner is None or outer is None or lid is None:
        corners = solid.corners()
        assert corners is not None, "a block without volume is never printed"
        return Print(solid, None, {"solid": trimesh.convex.convex_hull(corners)}, side)
    shell = _open_shell(outer, inner, solid.normals[side], top)
    return Print(solid, cavity, {"shell": shell, "lid": trimesh.convex.convex_hull(lid)}, side)


def _side_to_open(solid: Solid, kept: Sequence[np.ndarray]) -> int:
    """Return the largest of the six sides, of those without a joint if there are any."""
    corners = solid.corners()
    assert corners is not None, "a block without volume is never printed"
    areas = np.array([_area(corners, solid.normals[k], solid.offsets[k]) for k in range(6)])
    used = [
        any(abs(solid.normals[k] @ joint - solid.offsets[k]) < 1e3 * NEAR for joint in kept)
        for k in range(6)
    ]
    free = np.where(used, 0.0, areas)
    return int(np.argmax(free if free.any() else areas))


def _area(corners: np.ndarray, normal: np.ndarray, offset: float) -> float:
    """Return the area in m² of a side."""
    on = corners[np.abs(corners @ normal - offset) < 10 * NEAR]
    flat = on[:, np.abs(normal) < 0.5]
    try:
        return float(ConvexHull(flat).volume) if len(flat) > 2 else 0.0
    except QhullError:
        return 0.0


def _open_shell(
    outer: np.ndarray, inner: np.ndarray, normal: np.ndarray, top: float
) -> trimesh.Trimesh:
    """Return the surface between two convex bodies that share the plane of the open side.

    outer, inner: corners [V, 3]. normal: [3], of the plane normal · point = top.
    """
    outside, rim = _without_side(trimesh.convex.convex_hull(outer), normal, top)
    inside, edge = _without_side(trimesh.convex.convex_hull(inner), normal, top)
    count = len(outside.vertices)
    points = np.vstack([outside.vertices, inside.vertices])
    ring = _ring(points, rim, [count + place for place in edge], normal)
    faces = np.vstack([outside.faces, inside.faces[:, ::-1] + count, ring])
    return trimesh.Trimesh(points, faces, process=False)


def _without_side(
    hull: trimesh.Trimesh, normal: np.ndarray, top: float
) -> tuple[trimesh.Trimesh, list[int]]:
    """Return a convex body without the triangles of one side, and the loop around that side."""
    on = np.abs(hull.vertices @ normal - top) < 10 * NEAR
    flat = on[hull.faces].all(axis=1)
    edges = {
        (int(a), int(b))
        for face in hull.faces[flat]
        for a, b in zip(face, np.roll(face, -1), strict=True)
    }
    after = {a: b for a, b in edges if (b, a) not in edges}
    loop = [next(iter(after))]
    while after[loop[-1]] != loop[0]:
        loop.append(after[loop[-1]])
    return trimesh.Trimesh(hull.vertices, hull.faces[~flat], process=False), loop


def _ring(
    points: np.ndarray, rim: Sequence[int], edge: Sequence[int], normal: np.ndarray
) -> np.ndarray:
    """Return triangles [n, 3] between two loops in a plane, one around the other.

    Both run counter-clockwise around the normal. The loop with the nearer next corner, in angle
    around the inner loop's middle, advances.
    """
    middle = points[list(edge)].mean(axis=0)
    across = np.linalg.svd(normal[None])[2][1:]
    across[1] = np.cross(normal, across[0])

    def angles(loop: Sequence[int]) -> tuple[list[int], np.ndarray]:
        flat = (points[list(loop)] - middle) @ across.T
        turn = np.mod(np.arctan2(flat[:, 1], flat[:, 0]), 2 * np.pi)
        first = int(np.argmin(turn))
        order = [*loop[first:], *loop[:first]]
        turns = np.roll(turn, -first)
        return [*order, order[0]], np.append(turns, turns[0] + 2 * np.pi)

    (rim_loop, rim_turn), (edge_loop, edge_turn) = angles(rim), angles(edge)
    i = j = 0
    faces = []
    while i < len(rim) or j < len(edge):
        advance = j >= len(edge) or (i < len(rim) and rim_turn[i + 1] <= edge_turn[j + 1])
        if advance:
            faces.append((rim_loop[i], rim_loop[i + 1], edge_loop[j]))
            i += 1
        else:
            faces.append((rim_loop[i], edge_loop[j + 1], edge_loop[j]))
            j += 1
    return np.array(faces)


@dataclasses.dataclass(frozen=True, eq=False)
class Packed:
    """Box inside a block, its sides parallel to the block's. middle, half: [3] m."""

    middle: np.ndarray
    half: np.ndarray


def packed(
    cavity: Solid, half: np.ndarray, near: np.ndarray, taken: Sequence[Packed]
) -> Packed | None:
    """Return the place of a box in a cavity that is nearest to a point; None if it does not fit.

    half: [3] m, in any order. near: [3] m. taken: boxes that are there already.
    """
    best: tuple[float, Packed] | None = None
    for sides in sorted(set(itertools.permutations(half.tolist()))):
        box = np.array(sides)
        room = Solid(cavity.normals, cavity.offsets - np.abs(cavity.normals) @ box)
        best = _packed_beside(room, box, near, taken, best)
    return None if best is None else best[1]


def _packed_beside(
    room: Solid,
    box: np.ndarray,
    near: np.ndarray,
    taken: Sequence[Packed],
    best: tuple[float, Packed] | None,
) -> tuple[float, Packed] | None:
    """Return the nearest place of a box beside others, with its distance in m; else the best known.

    room: in which the box's middle may be. Each other box is on one of its six sides, and each side
    that is chosen leaves less room. So a choice that is no nearer than the best is given up.
    """
    place = _nearest(room, near)
    if place is None:
        return best
    distance = float(np.abs(place - near).sum())
    if best is not None and distance >= best[0]:
        return best
    if not taken:
        return distance, Packed(place, box)
    other, *rest = taken
    for way in np.vstack([np.eye(3), -np.eye(3)]):
        free = room.cut([-way], -way @ other.middle - np.abs(way) @ (box + other.half))
        best = _packed_beside(free, box, near, rest, best)
    return best


def _nearest(solid: Solid, near: np.ndarray) -> np.ndarray | None:
    """Return the point [3] of a block nearest to another, in the sum over the axes; None if empty."""
    zero, one = np.zeros((len(solid.normals), 3)), np.eye(3)
    rows = np.vstack(
        [np.hstack([solid.normals, zero]), np.hstack([one, -one]), np.hstack([-one, -one])]
    )
    most = np.concatenate([solid.offsets, near, -near])
    free = [(None, None)] * 3 + [(0, None)] * 3
    found = linprog([0, 0, 0, 1, 1, 1], A_ub=rows, b_ub=most, bounds=free)
    return found.x[:3] if found.status == 0 else None
