"""Cells of the grid as runs: settings, and genomes made from other cells' genomes."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.experiments.repertoire.grid import Cell, Grid
from mjxgait.tasks.walk.targets import Wishes, wished
from mjxgait.training.packed import Packed

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
            f"{config.use.controller}"
        )
    if config.evolution.body != 1:
        raise UserError("evolution.body: the clips of a repertoire are of one body; leave it at 1")
    if config.fitness.wish.asked and {"speed", "turn", "steer"} & set(config.fitness.wish.asked):
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
    config = wished(base, creature, Wishes(speed=speed, turn=cell.turn or None))
    if grid.turns:
        turning = wished(base, creature, Wishes(speed=speed, turn=grid.turns[-1]))
        config = dataclasses.replace(config, controller=turning.controller)
    forced = dataclasses.replace(config.evolution.forced, patience=0)
    # The rows of a program advance together: none may stop early.
    evolution = dataclasses.replace(config.evolution, target=None, forced=forced)
    return dataclasses.replace(config, evolution=evolution)


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
