"""Grid of a repertoire: target walks, their names and their neighbours."""

import dataclasses
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from mjxgait.config.tables import (
    STRICT,
    build,
    dump_toml,
    read_toml,
)
from mjxgait.errors import UserError

GRID = "repertoire.toml"


@dataclasses.dataclass(frozen=True, order=True)
class Cell:
    """One walk of the grid. speed: m/s. turn: deg/s, to the left."""

    speed: float
    turn: float

    @property
    def name(self) -> str:
        """Name of its run folder and clip; without dots, which engines do not allow in names."""
        side = "left" if self.turn > 0 else "right"
        turn = f"{side}{abs(self.turn):g}".replace(".", "p") if self.turn else "straight"
        return f"walk_{round(100 * self.speed):03d}_{turn}"

    @property
    def mirrored(self) -> "Cell":
        """Same walk to the other side."""
        return Cell(self.speed, -self.turn or 0.0)


@dataclasses.dataclass(frozen=True)
class Grid:
    """Target speeds and turns.

    Attributes:
      speeds: m/s, ascending.
      turns: deg/s to either side, ascending; straight on is always among them.
    """

    __pydantic_config__ = STRICT
    speeds: tuple[float, ...]
    turns: tuple[float, ...] = ()

    @classmethod
    def of(cls, speeds: Sequence[float], turns: Sequence[float]) -> "Grid":
        """Return the grid of speeds and turns in any order.

        Raises:
          UserError: there is no speed, or two walks would have one name.
        """
        if not speeds:
            raise UserError("--speeds: give at least one, such as --speeds 0.4 0.7 1.0")
        if bad := [turn for turn in turns if not 0 <= turn < 360]:
            raise UserError(
                f"--turns {bad[0]:g}: give degrees per second from 0 to 360; each is for both sides"
            )
        grid = cls(tuple(sorted(set(speeds))), tuple(sorted({turn for turn in turns if turn})))
        names = [cell.name for cell in grid.cells]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise UserError(
                f"two of these walks would be called {twice}: take speeds that are a cm/s apart"
            )
        return grid

    @classmethod
    def read(cls, folder: Path) -> "Grid":
        """Return the grid of a folder.

        Raises:
          UserError: the folder holds none.
        """
        if not (folder / GRID).is_file():
            raise UserError(f"{folder}: not the folder of a repertoire (it has no {GRID})")
        return build(cls, read_toml(folder / GRID), str(folder / GRID))

    @property
    def text(self) -> str:
        """Text of the file that `read` reads."""
        return dump_toml(self)

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """All cells, by speed, from right to left."""
        sides = (*(-turn for turn in reversed(self.turns)), 0.0, *self.turns)
        return tuple(Cell(speed, turn) for speed in self.speeds for turn in sides)

    def neighbours(self, cell: Cell) -> list[Cell]:
        """Return the cells next to a cell, in speed or in turn."""
        at, wide = self.cells.index(cell), 2 * len(self.turns) + 1
        row, column = divmod(at, wide)
        near = ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1))
        return [
            self.cells[r * wide + c] for r, c in near if 0 <= r < len(self.speeds) and 0 <= c < wide
        ]

    @property
    def pairs(self) -> list[tuple[Cell, Cell]]:
        """Each pair of neighbours, once."""
        return [(a, b) for a in self.cells for b in self.neighbours(a) if a < b]
