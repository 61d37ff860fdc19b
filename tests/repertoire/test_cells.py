"""What a cell is as a run, and what it begins with."""

import jax
import numpy as np
import pytest
from helpers import small_config

from mjxgait.control.poses import pose_cycle
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.repertoire.cells import POSES, check, mirror_image, mirrored, planted, settings_of
from mjxgait.repertoire.grid import Cell
from mjxgait.runs.packed import Packed
from mjxgait.settings.traced import traced

STRAIGHT, LEFT = Cell(0.4, 0.0), Cell(0.4, 15.0)


def population(creature: Creature) -> Packed:
    rng = np.random.default_rng(1)
    poses = rng.normal(size=(6, 2, len(creature.joints.names))).astype(np.float32)
    return Packed({POSES: poses, "genomes.tuning": rng.normal(size=(6, 7))}, "fry")


def test_who_turns_has_a_cycle_of_its_own_poses(stool: Creature):
    straight, left = (settings_of(cell, stool, small_config()) for cell in (STRAIGHT, LEFT))
    assert (straight.controller.mirror, straight.controller.key_poses) == (True, 2)
    assert (left.controller.mirror, left.controller.key_poses) == (False, 4)
    assert straight.wish == {"speed": 0.4}
    assert left.wish == {"speed": 0.4, "turn": 15.0}


def test_all_that_turn_share_a_program(stool: Creature):
    shapes = {
        jax.tree.structure(traced(settings_of(cell, stool, small_config())))
        for cell in (LEFT, Cell(0.8, 15.0), Cell(0.4, -30.0))
    }
    assert len(shapes) == 1


def test_it_begins_with_the_cycles_of_who_walks_straight_on(stool: Creature):
    straight = population(stool)
    begin = planted([LEFT], {0.4: straight}, stool, settings_of(STRAIGHT, stool, small_config()))
    assert begin[POSES].shape == (1, 6, 4, len(stool.joints.names))
    for one, poses in zip(begin[POSES][0], straight.arrays[POSES], strict=True):
        np.testing.assert_array_equal(one, pose_cycle(stool, poses))
    np.testing.assert_array_equal(begin["genomes.tuning"][0], straight.arrays["genomes.tuning"])


def test_the_mirror_image_of_a_mirror_image_is_the_population(shipped: Creature):
    before = population(shipped)
    once = mirror_image(before, shipped)
    twice = mirror_image(once, shipped)
    np.testing.assert_array_equal(twice.arrays[POSES], before.arrays[POSES])
    assert set(twice.arrays) == set(before.arrays)


def test_a_pose_in_the_mirror_has_left_and_right_exchanged(stool: Creature):
    names = list(stool.joints.names)
    left, right = (
        next(i for i, name in enumerate(names) if name.startswith(f"front_{side}"))
        for side in ("left", "right")
    )
    pose = np.zeros(len(names))
    pose[left] = 0.3
    assert np.flatnonzero(mirrored(pose, stool)).tolist() == [right]


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"evolution": {"body": 1.2}}, "clips of a repertoire are of one body"),
        ({"fitness": {"wish": {"speed": 0.4}}}, "the grid asks for speeds and turns"),
    ],
)
def test_what_no_repertoire_can_be_made_of_is_refused(tables: dict, said: str):
    with pytest.raises(UserError, match=said):
        check(small_config(**tables))
