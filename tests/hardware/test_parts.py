"""Printed parts: closed surfaces with the volume of their walls, and room for servos."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mjxgait.hardware.shells import Solid, block, packed, printed

HALF, WALL = np.array([0.10, 0.05, 0.03]), 0.002
MIDDLE = np.array([0.10, 0.0, 0.0])


def roof(swing: float, axis: np.ndarray) -> Solid:
    """A block cut clear of the plane at its joint, for all angles up to `swing` about an axis."""
    turns = Rotation.from_rotvec(np.linspace(-swing, swing, 7)[:, None] * axis)
    return block(HALF, MIDDLE).cut(-turns.apply([1.0, 0.0, 0.0]), -0.0005)


@pytest.mark.parametrize("swing", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("axis", [[0, 0, 1], [0, 1, 0], [0, 0.6, 0.8]])
def test_shell_and_lid_are_closed_and_hold_the_walls(swing: float, axis: list[float]):
    solid = roof(swing, np.array(axis))
    made = printed(solid, WALL, [np.zeros(3)])
    assert made.meshes.keys() == {"shell", "lid"}
    for mesh in made.meshes.values():
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.volume > 0
    assert made.cavity is not None
    assert made.volume == pytest.approx(solid.volume() - made.cavity.volume(), rel=1e-6)
    shell, up = made.meshes["shell"], solid.normals[made.opened]
    rim = np.abs(shell.triangles @ up - made.cavity.offsets[made.opened]).max(axis=1) < 1e-6
    top = made.cavity.offsets[made.opened]
    wall = area(solid, up, top) - area(made.cavity, up, top)
    assert shell.area_faces[rim].sum() == pytest.approx(wall, rel=0.05)


def area(solid: Solid, up: np.ndarray, top: float) -> float:
    """Area of a section, from the volume of a layer of a millimetre below it."""
    return solid.cut([up], top).cut([-up], 1e-3 - top).volume() / 1e-3


def test_all_walls_have_the_same_thickness():
    made = printed(block(HALF, MIDDLE), WALL, [])
    room = made.cavity.corners()
    assert np.ptp(room, axis=0) == pytest.approx(2 * (HALF - WALL), abs=1e-6)
    lid = made.meshes["lid"].vertices
    assert np.ptp(lid, axis=0) == pytest.approx([0.2, 0.1, WALL], abs=1e-6)


def test_a_block_of_walls_only_is_solid():
    made = printed(block(np.array([0.02, 0.02, 0.0019]), np.zeros(3)), WALL, [])
    assert made.cavity is None
    assert made.meshes.keys() == {"solid"}
    assert made.volume == pytest.approx(8 * 0.02 * 0.02 * 0.0019)


def test_the_side_of_a_joint_stays_closed():
    top = np.array([0.1, 0.0, 0.03])
    assert printed(block(HALF, MIDDLE), WALL, [top]).opened != 2
    assert printed(block(HALF, MIDDLE), WALL, []).opened == 2


def test_servos_are_packed_beside_each_other_near_the_joint():
    solid = roof(0.9, np.array([0.0, 0.0, 1.0]))
    cavity = printed(solid, WALL, [np.zeros(3)]).cavity
    assert cavity is not None
    servo, taken = np.array([0.010, 0.017, 0.013]), []
    for _ in range(3):
        place = packed(cavity, servo, np.zeros(3), taken)
        assert place is not None
        signs = np.stack(np.meshgrid(*[[-1, 1]] * 3), -1).reshape(-1, 3)
        assert all(cavity.holds(place.middle + sign * place.half) for sign in signs)
        apart = [np.abs(place.middle - o.middle) - (place.half + o.half) for o in taken]
        assert all(gaps.max() > -1e-9 for gaps in apart)
        taken.append(place)
    far = [np.linalg.norm(place.middle) for place in taken]
    assert far[0] == min(far)
    assert packed(cavity, 3 * servo, np.zeros(3), []) is None
