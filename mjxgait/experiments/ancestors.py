"""Small runs that come before a run: the best of each begin it (two-step evolution)."""

import dataclasses
import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from mjxgait.config.evolution import AncestorsConfig
from mjxgait.config.schema import Config
from mjxgait.config.traced import shape_settings
from mjxgait.creature import Creature
from mjxgait.distributed.evolve import scheduler_at
from mjxgait.distributed.jobs import Advanced
from mjxgait.distributed.rows import Rows
from mjxgait.errors import UserError
from mjxgait.experiments.multi_seed import bests, create_multi_seed, folders_of, is_multi_seed
from mjxgait.kinds import skills_of
from mjxgait.tasks.walk.targets import WalkTargets, configured
from mjxgait.training.disk import disk_errors
from mjxgait.training.experiment import build_experiment
from mjxgait.training.folder import ANCESTORS, check_parts, open_run
from mjxgait.training.initial import (
    GENOMES,
    Initial,
    check_initial,
    has_begun,
    keep_initial,
    read_initial,
    united,
)
from mjxgait.training.loop import interruptible

Say = Callable[[str], object]


def evolve_ancestors(folder: Path, creature: Creature, config: Config, say: Say) -> Initial | None:
    """Evolve the ancestors of a run in its folder, or go on with them; None if interrupted.

    Raises:
      UserError: the folder cannot be written, or a stored run of it is damaged.
    """
    ancestors, place = config.evolution.ancestors, folder / ANCESTORS
    if not is_multi_seed(place):
        if place.exists():  # of a run killed while it made this folder
            with disk_errors(place):
                shutil.rmtree(place)
        create_multi_seed(place, creature, settings_of_ancestors(creature, config), ancestors.runs)
    say(
        f"First {ancestors.runs} runs of the task {ancestors.task}, of "
        f"{ancestors.generations} generations: their best begin this run."
    )
    try:
        runs = folders_of(place)
        rows = Rows(creature, runs, partial(_tell, say))
    except UserError as error:
        raise UserError(f"{error}; take {place} away to evolve these small runs anew") from None
    with interruptible() as interrupted, scheduler_at(None) as scheduler:
        if rows.to_the_end(scheduler, interrupted.is_set) is None:
            return None
    return united(runs)


def first_genomes(
    folders: Sequence[Path], creature: Creature, say: Say
) -> dict[str, np.ndarray] | None:
    """Return what the rows of several runs begin with, [B, N, ...] by name in a state.

    Empty if they have no ancestors, None if interrupted. The ancestors of one run after another
    evolve where that is still to be done.
    """
    kept = []
    for folder in folders:
        config = open_run(folder)[1]
        if not config.evolution.ancestors.runs:
            return {}
        if not has_begun(folder):
            initial = evolve_ancestors(folder, creature, config, say)
            if initial is None:
                return None
            check_initial(initial, build_experiment(creature, config))
            keep_initial(folder, initial)
        kept.append(read_initial(folder) or {})
    size = config.evolution.population
    count = min(size, *(len(array) for genomes in kept for array in genomes.values()))
    return {
        f"{GENOMES}{name}": np.stack([genomes[name][:count] for genomes in kept])
        for name in kept[0]
    }


def settings_of_ancestors(creature: Creature, config: Config) -> Config:
    """Return the settings of a run's ancestors with the first seed.

    They are the creature's for that task, with genomes and physics of the run. A skill of the run
    is evolved by its own effectors.

    Raises:
      UserError: the task is unknown, or does not fit.
    """
    ancestors, use = config.evolution.ancestors, config.use
    chosen = {"controller": use.controller, "task": ancestors.task}
    own = configured(creature, None, chosen, WalkTargets())
    check_parts(creature, own)
    names = shape_settings(type(config.controller))
    shape = {name: getattr(config.controller, name) for name in names}
    skills = skills_of(use.task)
    if own.use.task in skills:
        shape["skill"] = skills.index(own.use.task)
    evolution = dataclasses.replace(
        own.evolution,
        population=ancestors.population,
        generations=ancestors.generations,
        initial_choice=ancestors.initial_choice or own.evolution.initial_choice,
        body=config.evolution.body,
        ancestors=AncestorsConfig(),
    )
    rollout = dataclasses.replace(
        own.rollout,
        physics=config.rollout.physics,
        step=config.rollout.step,
        starts=ancestors.starts or own.rollout.starts,
    )
    return dataclasses.replace(
        own,
        seed=config.seed * ancestors.runs,
        controller=dataclasses.replace(own.controller, **shape),
        evolution=evolution,
        rollout=rollout,
        checkpoint_every=config.checkpoint_every,
    )


def _tell(say: Say, generation: int, last: int, done: Advanced | None) -> None:
    if done is None or not done.lines:
        return
    say(f"  generation {generation} of {last}, best fitness of each: {bests(done.lines[-1])}")
