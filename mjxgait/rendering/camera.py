"""A camera with parallel rays: lengths along the floor stay true, so the picture's scale can be
used to measure.
"""

import dataclasses

import numpy as np

UP = np.array([0.0, 0.0, 1.0])
VIEWS = {
    "side": (0.0, 8.0),
    "front": (75.0, 12.0),
    "top": (0.0, 80.0),
    "three-quarter": (45.0, 24.0),
    "follow": (-68.0, 24.0),
}
"""Azimuth and elevation in deg by name. None is exactly from ahead or above, where a floor has no
depth to measure with."""


def view_of(name: str) -> dict[str, float]:
    """Return azimuth and elevation of a view in rad."""
    azimuth, elevation = VIEWS[name]
    return {"azimuth": float(np.radians(azimuth)), "elevation": float(np.radians(elevation))}


@dataclasses.dataclass(frozen=True, eq=False)
class Camera:
    """View from a creature's right side, slightly from the front and from above: it walks to the
    right.

    centre: [3] m, in the middle of the picture. forward: [2] unit, the creature's direction. scale:
    pixels/m. width, height: pixels.
    azimuth: rad, from the side towards the front. elevation: rad.
    """

    centre: np.ndarray
    forward: np.ndarray
    scale: float
    width: int
    height: int
    azimuth: float = np.radians(22.0)
    elevation: float = np.radians(16.0)

    @property
    def axes(self) -> np.ndarray:
        """Unit rows [3, 3]: right in the picture, up in the picture, into the scene."""
        forward = np.append(self.forward, 0.0)
        left = np.cross(UP, forward)
        right = np.cos(self.azimuth) * forward + np.sin(self.azimuth) * left
        flat = np.cross(UP, right)
        into = np.cos(self.elevation) * flat - np.sin(self.elevation) * UP
        return np.stack([right, np.cross(right, into), into])

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Return the pixels [..., 2] (right, down) of world points [..., 3] m."""
        across = (points - self.centre) @ self.axes[:2].T * [self.scale, -self.scale]
        return across + np.array([self.width, self.height]) / 2

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Return the depth [...] in m of world points [..., 3]."""
        return (points - self.centre) @ self.axes[2]

    def rays(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return world points [rows, columns, 3] in the picture's plane, at pixel middles."""
        right, up, _ = self.axes
        a = (columns + 0.5 - self.width / 2) / self.scale
        b = -(rows + 0.5 - self.height / 2) / self.scale
        return self.centre + a[None, :, None] * right + b[:, None, None] * up

    def enlarged(self, factor: int) -> "Camera":
        """Return the same view with more pixels."""
        return dataclasses.replace(
            self, scale=self.scale * factor, width=self.width * factor, height=self.height * factor
        )
