"""What a cell of the grid is as a run: its settings, and its genomes made of others'."""

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
    """Refuses what no repertoire can be made of.

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
    """Whether a turn to the right is the mirror image of one to the left."""
    return creature.mirror.symmetric


def settings_of(cell: Cell, grid: Grid, creature: Creature, base: Config) -> Config:
    """The settings of a cell's run. Where there are turns, who walks straight on has the controller of
    who turns: its population is what those begin with.
    """
    speed = f"{cell.speed:.6f}"
    config = wished(base, creature, Wishes(speed=speed, turn=cell.turn or None))
    if grid.turns:
        turning = wished(base, creature, Wishes(speed=speed, turn=grid.turns[-1]))
        config = dataclasses.replace(config, controller=turning.controller)
    forced = dataclasses.replace(config.evolution.forced, patience=0)
    # All rows of a program go on together.
    evolution = dataclasses.replace(config.evolution, target=None, forced=forced)
    return dataclasses.replace(config, evolution=evolution)


def mirror_image(state: Packed, creature: Creature) -> Packed:
    """A population in a mirror: what turned to the left turns to the right."""
    return state.with_arrays({POSES: mirrored(state.arrays[POSES], creature)})


def mirrored(poses: np.ndarray, creature: Creature) -> np.ndarray:
    """Poses [..., J], left and right exchanged."""
    sign = creature.mirror.sign.astype(poses.dtype)
    swapped: np.ndarray = sign * poses[..., creature.mirror.partner]
    return swapped


def planted(cells: list[Cell], straight: Mapping[float, Packed]) -> dict[str, np.ndarray]:
    """What turning cells begin with, [B, P, ...]: who walks straight on at their speed."""
    return {
        name: np.stack([straight[cell.speed].arrays[name] for cell in cells]) for name in GENOMES
    }
