"""A stance's feet are brought level, where a tilt of the trunk can do that."""

from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mjxgait.importer.stance import level


class Feet:
    """Two rigid soles [4, 3] in m that the trunk carries."""

    def __init__(self, y: float, roll: float, higher: float) -> None:
        """y: of the left foot's centre. roll: rad, each outwards. higher: the right one's."""
        corners = np.array([[x, side, 0.0] for x in (-0.05, 0.1) for side in (-0.03, 0.03)])
        self.soles = [
            corners @ Rotation.from_euler("x", sign * roll).as_matrix().T + [0.0, sign * y, up]
            for sign, up in ((1, 0.0), (-1, higher))
        ]

    def pose(self, q: np.ndarray) -> tuple[()]:
        return ()

    def sole_points(self) -> list[np.ndarray]:
        return self.soles

    def turn(self, matrix: np.ndarray) -> None:
        self.soles = [sole @ matrix.T for sole in self.soles]

    @property
    def apart(self) -> float:
        """Difference in m of the heights of the two lowest points."""
        return float(abs(self.soles[0][:, 2].min() - self.soles[1][:, 2].min()))


def test_feet_of_different_heights_are_brought_level():
    feet = Feet(y=0.04, roll=0.0, higher=0.01)
    level(cast(Any, feet), np.zeros(0))
    assert feet.apart < 1e-3


@pytest.mark.parametrize("y", [0.04, 0.035])
def test_a_tilt_that_makes_other_points_the_lowest_is_taken_back(y: float):
    """Soles on their inner edges: these are near each other, so a small step asks for a steep
    tilt, after which both stand on their outer edges.
    """
    feet = Feet(y=y, roll=0.05, higher=0.0015)
    before = [sole.copy() for sole in feet.soles]
    level(cast(Any, feet), np.zeros(0))
    np.testing.assert_allclose(feet.soles, before, atol=1e-12)
