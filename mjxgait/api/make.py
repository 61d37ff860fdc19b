"""New runs: training and refining, and the creatures that they begin with."""

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mjxgait.api.run import Place, Run
from mjxgait.config.layers import find_creature
from mjxgait.config.schema import Config
from mjxgait.config.tables import Table, build, merge, not_none, read_toml
from mjxgait.creature import Creature
from mjxgait.creature import load_creature as load_folder
from mjxgait.creature.load import creature_of
from mjxgait.creature.scale import at_step, facing, scaled
from mjxgait.errors import UserError
from mjxgait.files import path_of
from mjxgait.output import Tell, silent
from mjxgait.training.folder import check_run, create_run
from mjxgait.training.logs import Line

if TYPE_CHECKING:
    from mjxgait.training.screen import Screen

OnGeneration = Callable[[Line], object]
"""Called with the line of a generation in `metrics.jsonl`."""


def load_creature(
    env: Place,
    scale: Mapping[str, float] | None = None,
    tell: Tell = silent,
    way: str = "forward",
) -> Creature:
    """Load a shipped creature by name, a creature folder, a model file or `robot:NAME`.

    Args:
      scale: size factors of parts, by name pattern (docs/reference/creature-folder.md).
      tell: called with the notes of the import of a model file.
      way: forward, back, left or right: the side that becomes the front (docs/guide/gaits.md).

    Raises:
      UserError: not found or not usable, with the reason.
    """
    from mjxgait.importer import import_model, robot_name

    path = path_of(env)
    if not path.is_file() and robot_name(env) is None:
        creature = load_folder(find_creature(str(env)))
    else:
        imported = import_model(path)
        tell(imported.notes.text())
        creature = creature_of(imported.files)
    return facing(scaled(creature, scale or {}), way)


def train(
    env: Place = "tall_quadruped",
    *,
    out: Place | None = None,
    config: Place | None = None,
    controller: str | None = None,
    task: str | None = None,
    scale: Mapping[str, float] | None = None,
    way: str = "forward",
    speed: str | float | None = None,
    gait: str | None = None,
    turn: float | None = None,
    steer: float | None = None,
    style: Place | None = None,
    certificate: str | None = None,
    expressions: Place | None = None,
    source: Place | None = None,
    seed: int = 0,
    tries: int = 1,
    population: int | None = None,
    generations: int | None = None,
    settings: Table | None = None,
    quiet: bool = False,
    on_generation: OnGeneration | None = None,
) -> Run:
    """Evolve a creature, examine its champion, and return the run.

    Does the same as `mjxgait train`, without plots: the same settings give the same champion.

    Args:
      env: shipped creature, creature folder, or model file.
      out: the run folder, which must be empty or new; by default a new one under runs/.
      config: file with settings, or the name of a shipped config such as wilson.
      controller: a shipped name, or FILE.py:CLASS of your own (docs/guide/your-own-task.md).
      task: a shipped name, or FILE.py:CLASS of your own.
      scale: size factors of parts, such as {"*_shin": 1.2} (docs/reference/creature-folder.md).
      way: forward, back, left or right: direction in the creature's own frame.
      speed: target in m/s, or text such as "0.4bl/s" (all targets: docs/guide/gaits.md).
      gait: name of the gait that is asked for.
      turn: degrees per second to the left.
      steer: degrees per second to either side.
      style: name of a shipped style, or a file.
      certificate: walks, or anywhere (docs/reference/certificate.md).
      expressions: file of initial programs, for the controller program
        (docs/reference/expressions.md).
      source: an earlier run, or a folder of several (`mjxgait train --runs`); the last populations
        are the first of this one.
      seed: of all random numbers.
      tries: the most runs, with seeds from `seed` on, until one is certified; returns the last.
      population: individuals of a generation.
      generations: the most that are evolved.
      settings: any others, in tables as in a config file: {"rollout": {"seconds": 5.0}}.
      quiet: prints nothing; the logger "mjxgait" gets the progress (level INFO).
      on_generation: called after each generation with its line of `metrics.jsonl`, a dict with
        `generation`, `best`, `mean` and more. What it raises ends the run; `mjxgait train --resume`
        goes on.

    Raises:
      UserError: an invalid argument, explained in one sentence.
    """
    from mjxgait.controllers.expressions.written import with_expressions
    from mjxgait.tasks.walk.targets import WalkTargets, configured

    use = used(controller=controller, task=task)
    creature = load_creature(env, scale, way=way)
    requested = {
        "speed": speed,
        "gait": gait,
        "turn": turn,
        "steer": steer,
        "style": style,
        "certificate": certificate,
    }
    file = path_of(config) if config else None
    resolved = configured(creature, file, use, WalkTargets.of(requested))
    evolution = not_none(population=population, generations=generations)
    table = merge(dataclasses.asdict(resolved), {"seed": seed, "evolution": evolution})
    chosen = build(type(resolved), merge(table, settings or {}), "the settings given to train")
    creature = at_step(creature, chosen.rollout.step)
    if expressions is not None:
        chosen = with_expressions(creature, chosen, path_of(expressions))
    initial = path_of(source) if source else None
    for folder, one in attempts(path_of(out) if out else None, creature, chosen, tries):
        begin = partial(create_run, folder, creature, one)
        run = _evolved(folder, creature, one, quiet, begin, initial, on_generation)
        if run.certified:
            break
    return run


def attempts(
    out: Path | None, creature: Creature, config: Config, count: int
) -> list[tuple[Path, Config]]:
    """Return the free folder and the settings of each of several new runs. Writes nothing.

    Their seeds go from the config's on. The first folder is `out`; `-seedN` ends the others.

    Raises:
      UserError: there is none to make; see `check_run`.
    """
    if count < 1:
        raise UserError(f"tries = {count}: give 1 or more")
    found = []
    for seed in range(config.seed, config.seed + count):
        one = dataclasses.replace(config, seed=seed)
        name = f"{out.name}-seed{seed}" if out and seed > config.seed else None
        folder = out.with_name(name) if out and name else out
        found.append((check_run(folder, creature, one), one))
    return found


def refine(
    env: Place,
    keys: Place,
    *,
    out: Place | None = None,
    keep: float = 0.5,
    names: Mapping[str, str] | Place | None = None,
    begin: float | None = None,
    end: float | None = None,
    tolerance: float = 3.0,
    forward: str | None = None,
    config: Place | None = None,
    seed: int = 0,
    population: int | None = None,
    generations: int | None = None,
    settings: Table | None = None,
    quiet: bool = False,
    on_generation: OnGeneration | None = None,
) -> Run:
    """Evolve a walk near a hand-made or captured cycle, and return the run (docs/guide/refine.md).

    Does the same as `mjxgait refine`; `Run.departure` reports what physics changed.

    Args:
      env: as for `train`.
      keys: file with the cycle: GLB, FBX, BVH, CSV or JSON.
      out: as for `train`.
      keep: 1 fixes the poses, 0 lets each joint depart by 30 degrees and the period by 30 %.
      names: name in the file by part (CSV or JSON: joint), or a TOML file of these, where the
        guess is wrong.
      begin: s; start of the cycle in the file.
      end: s; its end.
      tolerance: degrees, largest root mean square error of the key poses.
      forward: z, -z, x or -x, the facing direction in the file, Y up; by default z, or as in the
        rig that the creature was imported from.
      config: as for `train`.
      seed: as for `train`.
      population: as for `train`.
      generations: as for `train`.
      settings: as for `train`.
      quiet: as for `train`.
      on_generation: as for `train`.

    Raises:
      UserError: an invalid argument or file, explained in one sentence.
    """
    from mjxgait.animation.keys import bring
    from mjxgait.animation.keys import refine as near

    creature, source = load_creature(env), path_of(keys)
    base = near.base_settings(
        creature, path_of(config) if config else None, seed, population, generations, settings
    )
    table = read_toml(path_of(names)) if isinstance(names, str | Path) else names
    tell: Tell = silent if quiet else print
    brought = bring(creature, source, table, (begin, end), np.radians(tolerance), forward, tell)
    chosen = near.refining(creature, base, brought, keep)
    folder = check_run(path_of(out) if out else None, creature, chosen)
    begins = partial(near.begin, folder, creature, chosen, source, brought)
    return _evolved(folder, creature, chosen, quiet, begins, on_generation=on_generation)


def _evolved(
    folder: Path,
    creature: Creature,
    config: Config,
    quiet: bool,
    begin: Callable[[], object],
    source: Path | None = None,
    on_generation: OnGeneration | None = None,
) -> Run:
    """Evolve and examine a run in a new folder; return it.

    begin: makes the folder. source: see `evolve`.
    """
    from rich.console import Console

    from mjxgait.training.screen import Screen
    from mjxgait.training.stages import prepare_devices

    prepare_devices()
    listeners = (on_generation,) if on_generation else ()
    screen = Screen(Console(quiet=True) if quiet else None, listeners=listeners)
    evolve(folder, creature, config, screen, begin=begin, source=source)
    return Run(folder)


def evolve(
    folder: Path,
    creature: Creature,
    config: Config,
    screen: "Screen",
    resume: bool = False,
    generation: int | None = None,
    cluster: str | None = None,
    begin: Callable[[], object] = lambda: None,
    source: Path | None = None,
) -> bool:
    """Evolve a run, here or on a cluster; return whether it came to its end.

    source: earlier run, or folder of several; the last populations are the first of the new one.

    For the arguments and errors see `training.loop.train` and `distributed.evolve.evolve`.
    """
    from mjxgait.experiments.ancestors import evolve_ancestors, settings_of_ancestors
    from mjxgait.experiments.multi_seed import folders_of, is_multi_seed
    from mjxgait.training.initial import united

    ancestors = None
    if config.evolution.ancestors.runs:
        settings_of_ancestors(creature, config)  # refuses before the folder is made
        ancestors = partial(evolve_ancestors, folder, creature, config, screen.say)
    elsewhere = cluster or config.evolution.islands.count > 1
    if source and elsewhere:
        raise UserError(
            f"--from {source}: not for islands, nor on a cluster; leave --from out, or --cluster "
            "and --evolution.islands.count"
        )
    if ancestors and config.evolution.islands.count > 1:
        raise UserError("islands begin with drawn individuals; give --evolution.ancestors.runs 0")
    if elsewhere:
        from mjxgait.distributed.evolve import evolve as across

        there = resume, generation, cluster, begin
        return across(folder, creature, config, screen, *there, ancestors)
    from mjxgait.training import loop

    initial = None
    if source:
        initial = united(folders_of(source) if is_multi_seed(source) else [source])
    at = resume, generation, None, begin
    return loop.train(folder, creature, config, screen, *at, initial, ancestors)


def used(**named: str | None) -> dict[str, str]:
    """Return the names of the given controller and task; load user-defined code."""
    given = not_none(**named)
    if not given:
        return {}
    from mjxgait.plugins.user_code import load

    return {kind: load(kind, text) for kind, text in given.items()}
