"""Blocks at rest, and their overlap."""

import dataclasses
import itertools

import numpy as np


@dataclasses.dataclass(frozen=True)
class Box:
    """Block at rest in the root's frame. middle, half: [3] m. axes: [3, 3], columns."""

    middle: np.ndarray
    half: np.ndarray
    axes: np.ndarray

    @property
    def size(self) -> float:
        """Cube root of its volume, in m."""
        return float(np.cbrt(8 * self.half.prod()))

    @property
    def corners(self) -> np.ndarray:
        """Corners [8, 3] in m."""
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        return self.middle + (signs * self.half) @ self.axes.T


def inside(one: Box, other: Box) -> float:
    """Return the overlap depth over the smaller one's size; negative if a face separates them."""
    deep = min(_behind(one, other), _behind(other, one))
    return deep / min(one.size, other.size)


def _behind(one: Box, other: Box) -> float:
    """Return the smallest depth in m of the other's corners behind a face of `one`.

    The depth behind a face is that of the deepest corner.
    """
    corners = (other.corners - one.middle) @ one.axes
    return float(min((one.half - corners.min(0)).min(), (one.half + corners.max(0)).min()))
