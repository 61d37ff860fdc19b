"""Where blocks are at rest, and how deep they are in each other."""

import dataclasses
import itertools

import numpy as np


@dataclasses.dataclass(frozen=True)
class Box:
    """A block at rest in the root's frame. middle, half: [3] m. axes: [3, 3], columns."""

    middle: np.ndarray
    half: np.ndarray
    axes: np.ndarray

    @property
    def size(self) -> float:
        """m, the cube root of its volume."""
        return float(np.cbrt(8 * self.half.prod()))

    @property
    def corners(self) -> np.ndarray:
        """[8, 3] m."""
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        return self.middle + (signs * self.half) @ self.axes.T


def inside(one: Box, other: Box) -> float:
    """How deep two are in each other, of the smaller one's size; negative where a face separates them."""
    deep = min(_behind(one, other), _behind(other, one))
    return deep / min(one.size, other.size)


def _behind(one: Box, other: Box) -> float:
    """m that the nearest corner of the other is behind the face of one that it is behind the least."""
    corners = (other.corners - one.middle) @ one.axes
    return float(min((one.half - corners.min(0)).min(), (one.half + corners.max(0)).min()))
