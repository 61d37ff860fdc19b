"""Place of a page's camera from which every frame of a loop is in the picture."""

import numpy as np

from mjxgait.animation.export.loop import WalkLoop
from mjxgait.animation.export.skeleton import gltf_axes
from mjxgait.rendering.painter import seen_geoms
from mjxgait.rendering.shapes import Silhouettes
from mjxgait.rendering.walk import poses_of

ORBITS = np.radians([[-62.0, 76.0], [-90.0, 86.0], [0.0, 84.0], [-90.0, 8.0]])
"""Azimuth and angle from the vertical of the page's views, as in `page.html`."""
FIELD = np.radians(30.0)
"""The viewer's vertical angle of view."""
ASPECT = 1.5
"""Smallest width over height of the page's picture."""
AROUND = 1.25
"""Distance of the camera over the smallest one: what is around a body shows its motion."""


def viewpoint(loop: WalkLoop) -> tuple[np.ndarray, float]:
    """Return the point [3] m that the camera looks at, in glTF's axes, and its distance in m.

    The camera looks at the middle of the motion; in all views of the page, no part leaves the
    picture.
    """
    reach = _Reach(loop)
    ends = reach.along(np.concatenate([np.eye(3), -np.eye(3)]))
    target = (ends[:3] - ends[3:]) / 2
    return target, AROUND * _distance(reach, target)


def _distance(reach: "_Reach", target: np.ndarray) -> float:
    """Smallest distance in m from which all views show everything."""
    needed = []
    steep = np.tan(FIELD / 2)
    for azimuth, polar in ORBITS:
        towards = np.array(
            [np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)]
        )
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        up = np.cross(towards, right)
        # A point is in the picture if it is not beyond the planes through the picture's edges.
        edges = [
            s * axis / slope
            for axis, slope in ((up, steep), (right, ASPECT * steep))
            for s in (1, -1)
        ]
        planes = towards + np.array(edges)
        needed.append((reach.along(planes) - planes @ target).max())
    return float(max(needed))


class _Reach:
    """How far the visible surface of a creature reaches in all frames of a loop."""

    def __init__(self, loop: WalkLoop) -> None:
        model = loop.walk.dressed
        geoms = seen_geoms(model)
        self.outlines = Silhouettes(model, geoms)
        self.axes = gltf_axes(loop.walk.forward)
        pos, rot = poses_of(model, loop.qpos, ("geom_xpos", "geom_xmat"))
        self.pos, self.rot = pos[:, geoms], rot[:, geoms]

    def along(self, directions: np.ndarray) -> np.ndarray:
        """Return the largest products [K] of points with directions [K, 3] in glTF's axes."""
        length = np.linalg.norm(directions, axis=1, keepdims=True)
        units = directions / length @ self.axes
        points = self.outlines.outermost(self.pos, self.rot, units)
        largest: np.ndarray = (points * units).sum(-1).max((0, 1)) * length[:, 0]
        return largest
