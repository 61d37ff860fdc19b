"""Grid of requested walks: its cells, their settings, and their evolution.

Walks straight ahead evolve first, turns from them: two programs with a row per cell. In every
generation a cell evaluates, among its offspring, one of the best individuals of each neighbour.
Each cell has its own run folder.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated

import numpy as np
import pydantic

from mjxgait.config.schema import Config
from mjxgait.config.tables import STRICT, Positive, build, dump_toml, read_toml
from mjxgait.creature import Creature
from mjxgait.distributed.jobs import Advanced
from mjxgait.distributed.rows import Rows, RowsProgress
from mjxgait.distributed.scheduler import Scheduler
from mjxgait.errors import UserError
from mjxgait.tasks.walk.targets import WalkTargets, with_targets
from mjxgait.training.checkpoint import Packed

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
    speeds: Annotated[tuple[Positive, ...], pydantic.Field(min_length=1)]
    turns: tuple[Annotated[float, pydantic.Field(gt=0, lt=360)], ...] = ()

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
            raise UserError(
                f"{folder}: not the folder of a repertoire (it has no {GRID}); name the folder "
                "that `mjxgait repertoire` made"
            )
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


POSES = "genomes.key_poses"
GENOMES = (POSES, "genomes.tuning")


def check(config: Config) -> None:
    """Refuse settings that no repertoire can be made of.

    Raises:
      UserError: another task or controller, or a body that evolves.
    """
    if (config.use.task, config.use.controller) != ("walk", "poses"):
        raise UserError(
            f"a repertoire is of walks by key poses, and this is to {config.use.task} by "
            f"{config.use.controller}; name a creature that walks, or leave use.task and "
            "use.controller out"
        )
    if config.evolution.body != 1:
        raise UserError("evolution.body: the clips of a repertoire are of one body; leave it at 1")
    if {"speed", "turn", "steer"} & set(config.fitness.wish.requested):
        raise UserError("fitness.wish: the grid asks for speeds and turns; leave these out")


def has_mirror(creature: Creature) -> bool:
    """Return whether a right turn is the mirror image of a left turn."""
    return creature.mirror.symmetric


def settings_of(cell: Cell, grid: Grid, creature: Creature, base: Config) -> Config:
    """Return the settings of a cell's run.

    If the grid has turns, straight cells use the turning cells' controller settings: the turning
    cells begin with the straight populations.
    """
    speed = f"{cell.speed:.6f}"
    config = with_targets(base, creature, WalkTargets(speed=speed, turn=cell.turn or None))
    if grid.turns:
        turning = with_targets(base, creature, WalkTargets(speed=speed, turn=grid.turns[-1]))
        config = dataclasses.replace(config, controller=turning.controller)
    # The rows of a program advance together: none may stop early.
    return dataclasses.replace(config, evolution=config.evolution.unstopped())


def mirror_image(state: Packed, creature: Creature) -> Packed:
    """Return a population's mirror image: left turns become right turns."""
    return state.with_arrays({POSES: mirrored(state.arrays[POSES], creature)})


def mirrored(poses: np.ndarray, creature: Creature) -> np.ndarray:
    """Return poses [..., J] with left and right exchanged."""
    sign = creature.mirror.sign.astype(poses.dtype)
    swapped: np.ndarray = sign * poses[..., creature.mirror.partner]
    return swapped


def planted(cells: list[Cell], straight: Mapping[float, Packed]) -> dict[str, np.ndarray]:
    """Return the turning cells' first genomes, [B, P, ...]: the straight ones of the same speed."""
    return {
        name: np.stack([straight[cell.speed].arrays[name] for cell in cells]) for name in GENOMES
    }


Tell = Callable[[str, int, int, Advanced | None], object]
"""Callback with the evolved part, the generation, the last generation, and a result, if any."""


def evolve(
    folder: Path,
    creature: Creature,
    grid: Grid,
    scheduler: Scheduler,
    tell: Tell,
    stopped: Callable[[], bool],
) -> bool:
    """Evolve all cells of a folder, or resume them; return whether all were completed."""
    straight = [cell for cell in grid.cells if not cell.turn]
    both = not has_mirror(creature)
    turning = [cell for cell in grid.cells if cell.turn > 0 or (cell.turn and both)]
    first = _side(folder, creature, grid, straight, partial(tell, "straight on"))
    found = first.to_the_end(scheduler, stopped)
    if found is None or not turning:
        return found is not None
    by_speed = {cell.speed: found[row] for row, cell in enumerate(straight)}
    begin = planted(turning, by_speed)
    second = _side(folder, creature, grid, turning, partial(tell, "turning"), begin)
    return second.to_the_end(scheduler, stopped) is not None


def _side(
    folder: Path,
    creature: Creature,
    grid: Grid,
    cells: Sequence[Cell],
    tell: RowsProgress,
    begin: Mapping[str, np.ndarray] | None = None,
) -> Rows:
    """Return cells as rows of one program.

    A symmetric body's right turns are mirror images of its left turns; they have folders, too.
    """
    near = [[n for n in grid.neighbours(cell) if n in cells] for cell in cells]
    sources = [[cells.index(n) for n in known] for known in near]
    image = partial(mirror_image, creature=creature)
    images = {
        folder / cell.name: (folder / cell.mirrored.name, image)
        for cell in cells
        if cell.turn and has_mirror(creature)
    }
    folders = [folder / cell.name for cell in cells]
    return Rows(creature, folders, tell, sources, images, begin)
