"""`mjxgait refine`: evolve a walk near a hand-made cycle."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from mjxgait.api import Run, load_creature
from mjxgait.api.make import evolve
from mjxgait.api.requests import check_resumed
from mjxgait.cli.options import Verbosity, parsed
from mjxgait.config.schema import Config, Physics
from mjxgait.config.tables import read_toml
from mjxgait.creature import Creature
from mjxgait.errors import INTERRUPTED, UserError
from mjxgait.output import silent
from mjxgait.training.folder import check_parts, check_run, command, new_run_folder, open_run


@dataclasses.dataclass(frozen=True)
class RefineOptions(Verbosity):
    """Make a hand-made or captured cycle walk: its key poses change only within --keep.

    Attributes:
      env: Name of a shipped creature, path of a creature folder, or a model file.
      keys: The cycle: .glb, .fbx, .bvh, or .csv or .json of joint angles (docs/guide/refine.md).
      out: Folder for the run; by default a new one under runs/.
      keep: Share to keep: 1 fixes the poses, 0 lets every joint depart by 30 degrees and the period
        by 30 %. Several values make a run each, below --out, and a picture of all.
      names: TOML file with the name in the file of each part (CSV or JSON: joint), where the guess
        is wrong.
      begin: Second at which the cycle begins.
      end: Second at which it ends.
      tolerance: Largest root mean square error of the key poses against the cycle, in degrees.
      forward: Direction that the creature in the file faces, Y up; by default z, or as in the rig
        that the creature was imported from.
      only_show: Show names, errors, cycle and key poses, and evolve nothing.
      config: TOML file with settings, or the name of a shipped config.
      seed: Random seed.
      population: Population size.
      generations: Maximum number of generations.
      physics: mjx simulates with MJX itself instead of this program's faster step.
      resume: Run folder of a refine to continue, or the folder of several.
    """

    env: str = "tall_quadruped"
    keys: Path | None = None
    out: Path | None = None
    keep: tuple[float, ...] = (0.5,)
    names: Path | None = None
    begin: Annotated[float | None, tyro.conf.arg(name="from")] = None
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    tolerance: float = 3.0
    forward: Literal["z", "-z", "x", "-x"] | None = None
    only_show: bool = False
    config: Path | None = None
    seed: int = 0
    population: int | None = None
    generations: int | None = None
    physics: Physics | None = None
    resume: Path | None = None


def refine_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(RefineOptions, "refine", arguments)
    quiet = options.quiet and not options.only_show
    from mjxgait.animation.keys import bring, refine
    from mjxgait.animation.keys.refine import base_settings, begin, refining

    if options.resume:
        kept = "a resumed cycle keeps its settings"
        check_resumed(options, options.resume, ("quiet", "verbose"), kept)
        runs = refine.runs_in(options.resume)
        return _front(options.resume, runs, quiet) if runs else _resumed(options.resume, quiet)
    if not options.keep:
        raise UserError("--keep: give at least one share")
    if options.keys is None:
        raise UserError("name the file with the cycle: mjxgait refine --env duck --keys walk.glb")
    creature = load_creature(options.env)
    numbers = options.seed, options.population, options.generations
    others = {"rollout": {"physics": options.physics}} if options.physics else None
    base = base_settings(creature, options.config, *numbers, others)
    brought = bring(
        creature,
        options.keys,
        read_toml(options.names) if options.names else None,
        (options.begin, options.end),
        np.radians(options.tolerance),
        options.forward,
        silent if quiet else print,
    )
    configs = [refining(creature, base, brought, keep) for keep in options.keep]
    if options.only_show:
        return 0
    if len(configs) == 1:
        folder = check_run(options.out, creature, configs[0])
        write = partial(begin, folder, creature, configs[0], options.keys, brought)
        return _run(folder, creature, configs[0], write, quiet)
    out = options.out or new_run_folder(creature.name, options.seed)
    refine.check_front(out, options.keep)
    _check(creature, configs[0])
    for keep, config in zip(options.keep, configs, strict=True):
        begin(refine.folder_of(out, keep), creature, config, options.keys, brought)
    return _front(out, refine.runs_in(out), quiet)


def _check(creature: Creature, config: Config) -> None:
    """Refuse an invalid creature or config before anything is written."""
    from mjxgait.training.spec import check_spec
    from mjxgait.training.stages import prepare_devices

    check_parts(creature, config)
    prepare_devices()
    check_spec(creature, config)


def _front(out: Path, runs: Sequence[Path], quiet: bool) -> int:
    """Finish all runs of a trade-off plot, the most faithful first, and draw it."""
    from mjxgait.animation.keys import refine

    for run in runs:
        print(f"{run}:")
        if not refine.finished(run) and _resumed(run, quiet) == INTERRUPTED:
            print(f"To go on: {command('refine', '--resume', out, run=run)}")
            return INTERRUPTED
    print(f"Side by side: {refine.draw(out)}")
    return 0


def _resumed(folder: Path, quiet: bool) -> int:
    """Continue a run; see `_run`."""
    from mjxgait.animation.keys.refine import read_original
    from mjxgait.training.ended import nothing_left

    creature, config = open_run(folder)
    read_original(folder, creature)  # refuses other kinds of run before the work
    if over := nothing_left(folder, creature, config, config):
        print(over)
        _tell(folder, creature)
        return 0
    return _run(folder, creature, config, quiet=quiet)


def _run(
    folder: Path,
    creature: Creature,
    config: Config,
    write: Callable[[], object] | None = None,
    quiet: bool = False,
) -> int:
    """Evolve near the cycle, examine the champion, and print its departure.

    write: makes the folder of a new run.
    """
    from mjxgait.training.screen import Screen
    from mjxgait.training.stages import prepare_devices

    prepare_devices()
    screen = Screen(quiet=quiet)
    begin = write or (lambda: None)
    if not evolve(folder, creature, config, screen, write is None, begin=begin):
        return INTERRUPTED
    _tell(folder, creature)
    certified = Run(folder).certified
    if not certified:
        screen.say(
            "With less of the original it may walk: a smaller --keep. The keys named above go into "
            "a file for --config"
        )
    screen.next_steps(folder, certified)
    return 0


def _tell(folder: Path, creature: Creature) -> None:
    """Print the departure of a run's champion from the original cycle."""
    from mjxgait.animation.keys.refine import departure_of, read_original

    original, found = read_original(folder, creature), departure_of(folder)
    moved = "" if found.moved is None else f", as moved {found.moved:.1f}"
    print(f"From {original.source}: key poses {found.poses:.1f} degrees{moved} (r.m.s.)")
    for sentence in found.words:
        print(f"  {sentence}")
