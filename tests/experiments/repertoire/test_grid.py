"""The walks of a repertoire, their names and their neighbours."""

from pathlib import Path

import pytest

from mjxgait.errors import UserError
from mjxgait.experiments.repertoire.grid import GRID, Cell, Grid

THREE = Grid.of([1.0, 0.5, 0.75], [15.0])


def test_turns_are_on_both_sides_and_straight_is_always_included():
    assert THREE.speeds == (0.5, 0.75, 1.0)
    assert [cell.turn for cell in THREE.cells] == [-15.0, 0.0, 15.0] * 3
    assert Grid.of([0.5], [0.0]).cells == (Cell(0.5, 0.0),)


def test_names_give_cm_per_second_and_the_side_without_a_dot():
    assert Cell(0.5, 0.0).name == "walk_050_straight"
    assert Cell(1.25, 15.0).name == "walk_125_left15"
    assert Cell(0.05, -22.5).name == "walk_005_right22p5"


def test_neighbours_differ_in_one_step_of_speed_or_turn():
    near = THREE.neighbours(Cell(0.5, 15.0))
    assert near == [Cell(0.75, 15.0), Cell(0.5, 0.0)]
    assert len(THREE.neighbours(Cell(0.75, 0.0))) == 4
    assert len(THREE.pairs) == 12
    assert all(b in THREE.neighbours(a) and a in THREE.neighbours(b) for a, b in THREE.pairs)


def test_a_mirrored_cell_turns_to_the_other_side():
    assert Cell(0.5, 15.0).mirrored == Cell(0.5, -15.0)
    assert Cell(0.5, 0.0).mirrored.name == "walk_050_straight"


def test_the_grid_is_read_back_from_its_file(tmp_path: Path):
    (tmp_path / GRID).write_text(THREE.text)
    assert Grid.read(tmp_path) == THREE


@pytest.mark.parametrize(
    ("speeds", "turns", "said"),
    [
        ([], [], "at least one"),
        ([0.5], [-10.0], "each is for both sides"),
        ([0.5], [float("nan")], "degrees per second"),
        ([0.5, 0.501], [], "two of these walks would be called walk_050_straight"),
    ],
)
def test_an_invalid_grid_is_refused(speeds, turns, said: str):
    with pytest.raises(UserError, match=said):
        Grid.of(speeds, turns)


def test_a_folder_without_a_grid_is_refused(tmp_path: Path):
    with pytest.raises(UserError, match="not the folder of a repertoire"):
        Grid.read(tmp_path)
