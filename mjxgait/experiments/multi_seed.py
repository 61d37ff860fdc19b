"""Folders of several runs of one creature that differ by their seed."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from mjxgait.config.schema import Config
from mjxgait.config.tables import STRICT, Whole, build, dump_toml, read_toml
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.files import write_text
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import check_free, check_parts, create_run, new_run_folder
from mjxgait.training.logs import Line

SEEDS_FILE = "zoo.toml"


@dataclasses.dataclass(frozen=True)
class Seeds:
    """Seeds of a folder's runs, in order.

    together: number of runs per program, which affects their last bits; 0: all.
    """

    __pydantic_config__ = STRICT
    seeds: tuple[int, ...]
    together: Whole = 0

    def folders(self, parent: Path) -> list[Path]:
        """Return a run folder per seed."""
        return [parent / f"seed{seed}" for seed in self.seeds]


def is_multi_seed(folder: Path) -> bool:
    """Return whether a folder holds several runs, not one."""
    return (folder / SEEDS_FILE).is_file()


def read_seeds(parent: Path) -> Seeds:
    """Return the seeds of a folder.

    Raises:
      UserError: their file cannot be read, or names none.
    """
    seeds = build(Seeds, read_toml(parent / SEEDS_FILE), str(parent / SEEDS_FILE))
    if not seeds.seeds:
        raise UserError(
            f"{parent / SEEDS_FILE}: seeds: there is none; list the seed of each folder seedN"
        )
    return seeds


def folders_of(parent: Path) -> list[Path]:
    """Return the run folders; see `read_seeds`."""
    return read_seeds(parent).folders(parent)


def check_multi_seed(parent: Path | None, creature: Creature, config: Config, runs: int) -> Path:
    """Return the folder for several new runs, by default a new one under runs/; write nothing.

    Raises:
      UserError: fewer than two runs, or islands, which have rows of their own; see `check_parts`.
    """
    if runs < 2:
        raise UserError(f"--runs {runs}: give 2 or more, or leave it out for a single run")
    if config.evolution.islands.count > 1:
        raise UserError(
            "--runs: runs with islands do not go side by side; start them one by one,"
            " or give --evolution.islands.count 1"
        )
    check_parts(creature, config)
    parent = parent or new_run_folder(f"{creature.name}-zoo", config.seed)
    check_free(parent)
    return parent


def create_multi_seed(
    parent: Path | None, creature: Creature, config: Config, runs: int, together: int = 0
) -> Path:
    """Make a folder, by default under runs/, with a run folder per seed from the config's on.

    together: see `Seeds`.

    Raises:
      UserError: see `check_multi_seed` and `check_spec`; or the folder cannot be written.
    """
    from mjxgait.training.spec import check_spec  # JAX takes a second to import

    parent = check_multi_seed(parent, creature, config, runs)
    check_spec(creature, config)
    seeds = Seeds(tuple(range(config.seed, config.seed + runs)), together)
    for seed, folder in zip(seeds.seeds, seeds.folders(parent), strict=True):
        create_run(folder, creature, to_the_last(dataclasses.replace(config, seed=seed)))
    # Written last: a folder with this file is complete and can be resumed.
    with disk_errors(parent):
        write_text(parent / SEEDS_FILE, dump_toml(seeds))
    return parent


def to_the_last(config: Config) -> Config:
    """Return the config without early stopping: the rows of a program advance together."""
    examination = dataclasses.replace(config.examination, every=0)
    return dataclasses.replace(
        config, evolution=config.evolution.unstopped(), examination=examination
    )


def bests(lines: Sequence[Line]) -> str:
    """Return the best fitness of each run as text, from their log lines of one generation."""
    return " ".join("-" if line["best"] is None else f"{line['best']:.3g}" for line in lines)
