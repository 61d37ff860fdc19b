"""Settings and first population of a cell's run."""

import jax
import numpy as np
import pytest
from helpers import small_config

from mjxgait.config.traced import traced
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.experiments.repertoire.grid import (
    POSES,
    Cell,
    Grid,
    check,
    mirror_image,
    mirrored,
    planted,
    settings_of,
)
from mjxgait.training.checkpoint import Packed

STRAIGHT, LEFT = Cell(0.4, 0.0), Cell(0.4, 15.0)
GRID = Grid.of([0.4, 0.8], [15.0])


def population(creature: Creature) -> Packed:
    rng = np.random.default_rng(1)
    poses = rng.normal(size=(6, 2, len(creature.joints.names))).astype(np.float32)
    return Packed({POSES: poses, "genomes.tuning": rng.normal(size=(6, 7))}, "fry")


def test_straight_and_turning_cells_share_a_controller(stool: Creature):
    straight, left = (settings_of(cell, GRID, stool, small_config()) for cell in (STRAIGHT, LEFT))
    assert straight.wish == {"speed": 0.4}
    assert left.wish == {"speed": 0.4, "turn": 15.0}
    assert straight.controller == left.controller
    alone = settings_of(STRAIGHT, Grid.of([0.4], []), stool, small_config())
    assert alone.controller != straight.controller


def test_turning_cells_share_a_program(stool: Creature):
    shapes = {
        jax.tree.structure(traced(settings_of(cell, GRID, stool, small_config())))
        for cell in (LEFT, Cell(0.8, 15.0), Cell(0.4, -30.0))
    }
    assert len(shapes) == 1


def test_a_turning_cell_starts_from_the_straight_population(stool: Creature):
    slow, fast = population(stool), mirror_image(population(stool), stool)
    begin = planted([Cell(0.8, 15.0), LEFT], {0.4: slow, 0.8: fast})
    for row, straight in enumerate((fast, slow)):
        for name, arrays in begin.items():
            np.testing.assert_array_equal(arrays[row], straight.arrays[name])


def test_mirroring_twice_gives_the_population_back(shipped: Creature):
    before = population(shipped)
    once = mirror_image(before, shipped)
    twice = mirror_image(once, shipped)
    np.testing.assert_array_equal(twice.arrays[POSES], before.arrays[POSES])
    assert set(twice.arrays) == set(before.arrays)


def test_mirroring_a_pose_swaps_left_and_right(stool: Creature):
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
def test_unsuitable_settings_are_refused(tables: dict, said: str):
    with pytest.raises(UserError, match=said):
        check(small_config(**tables))
