"""`mjxgait refine`: a hand-made cycle in, the nearest one that physics lets walk out."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from mjxgait.creature import Creature
from mjxgait.errors import INTERRUPTED, UserError
from mjxgait.library import Run, load_creature
from mjxgait.parts import resolve_config
from mjxgait.runs.folder import create_run, open_run
from mjxgait.settings.config import Config
from mjxgait.settings.tables import build, merge, read_toml


@dataclasses.dataclass(frozen=True)
class RefineOptions:
    """Make a hand-made or captured cycle walk: its key poses change only as far as physics asks.

    Attributes:
      env: Name of a shipped creature, path of a creature folder, or a model file.
      keys: The cycle: .glb, .bvh, or .csv or .json of joint angles (docs/refine.md).
      out: Folder for the run; by default a new one under runs/.
      keep: How much to keep: 1 leaves the poses as they are, 0 lets every joint depart by 30 degrees
        and the period by 30 %.
      names: TOML file with the name in the file of each part (of a CSV or JSON: joint), where the
        guess is wrong.
      begin: Second at which the cycle begins.
      end: Second at which it ends.
      tolerance: Degrees, root mean square, within which the key poses reproduce the cycle.
      forward: Where the creature in the file looks, Y being up.
      only_show: Show names, errors, cycle and key poses, and evolve nothing.
      config: TOML file with settings, or the name of a shipped config.
      seed: Of all randomness.
      population: Individuals of a generation.
      generations: At most.
      resume: Run folder of a refine to go on with.
    """

    env: str = "tall_quadruped"
    keys: Path | None = None
    out: Path | None = None
    keep: float = 0.5
    names: Path | None = None
    begin: Annotated[float | None, tyro.conf.arg(name="from")] = None
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    tolerance: float = 3.0
    forward: Literal["z", "-z", "x", "-x"] = "z"
    only_show: bool = False
    config: Path | None = None
    seed: int = 0
    population: int | None = None
    generations: int | None = None
    resume: Path | None = None


def refine_command(arguments: Sequence[str]) -> int:
    """Returns the exit code."""
    options = tyro.cli(RefineOptions, args=list(arguments), prog="mjxgait refine")
    if options.resume:
        creature, config = open_run(options.resume)
        return _run(options.resume, creature, config, resume=True)
    if options.keys is None:
        raise UserError("name the file with the cycle: mjxgait refine --env duck --keys walk.glb")
    from mjxgait.keys import bring
    from mjxgait.keys.refine import refining, write_original

    creature = load_creature(options.env)
    base = _settings(options, creature)
    brought = bring(
        creature,
        options.keys,
        read_toml(options.names) if options.names else None,
        (options.begin, options.end),
        np.radians(options.tolerance),
        options.forward,
        print,
    )
    config = refining(base, brought, options.keep)
    if options.only_show:
        return 0
    folder = create_run(options.out, creature, config)
    write_original(folder, creature, options.keys, brought)
    return _run(folder, creature, config, resume=False)


def _settings(options: RefineOptions, creature: Creature) -> Config:
    """The settings of a training with key poses, before the cycle is known."""
    config = resolve_config(creature.settings.train, creature.name, options.config)
    if config.use.controller != "poses":
        raise UserError("refine is for the controller of key poses; leave use.controller out")
    short = {"population": options.population, "generations": options.generations}
    evolution = {key: value for key, value in short.items() if value is not None}
    table = merge(dataclasses.asdict(config), {"seed": options.seed, "evolution": evolution})
    return build(type(config), table, "the options")


def _run(folder: Path, creature: Creature, config: Config, resume: bool) -> int:
    """Evolves near the cycle, has the champion examined, and tells how far it departs."""
    from mjxgait.cluster.evolve import evolve
    from mjxgait.keys.departure import departure
    from mjxgait.keys.refine import read_original
    from mjxgait.runs.experiment import prepare_devices
    from mjxgait.runs.screen import Screen
    from mjxgait.viewing.cast import LOOP_SECONDS, champion_of

    original = read_original(folder, creature)
    prepare_devices()
    screen = Screen()
    if not evolve(folder, creature, config, screen, resume):
        return INTERRUPTED
    found = departure(original, champion_of(folder, LOOP_SECONDS).walk)
    moved = "" if found.moved is None else f", as moved {found.moved:.1f}"
    screen.say(f"From {original.source}: key poses {found.poses:.1f} degrees{moved} (r.m.s.)")
    for sentence in found.words:
        screen.say(f"  {sentence}")
    certified = Run(folder).certified
    if not certified:
        screen.say("With less of the original it may walk: a smaller --keep")
    screen.next_steps(folder, certified)
    return 0
