"""A grid of walks that blend, from its options to its clips."""

import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from mjxgait.animation import Rate
from mjxgait.api.make import load_creature
from mjxgait.api.progress import Progress, pace
from mjxgait.api.requests import check_resumed
from mjxgait.api.run import Place
from mjxgait.config.schema import Config, Physics
from mjxgait.config.tables import build, merge, not_none
from mjxgait.creature import Creature
from mjxgait.experiments.repertoire.grid import GRID, Cell, Grid
from mjxgait.files import path_of, replaced, write_text
from mjxgait.output import Output, Tell, silent
from mjxgait.plugins import resolve_config
from mjxgait.tasks.walk.targets import WalkTargets, speed_of, with_targets
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import check_free, check_parts, command, create_run, open_run
from mjxgait.training.lock import locked

if TYPE_CHECKING:
    from mjxgait.animation.export import Character
    from mjxgait.distributed.jobs import Advanced

MAP = "map.png"
SPEEDS = ("0.3bl/s", "0.5bl/s", "0.7bl/s", "0.9bl/s", "1.1bl/s")
TURNS = (10.0, 20.0)
OF_FILES = ("rate", "travelling", "blends", "cluster", "onto")
"""Options that do not affect the walks."""


@dataclasses.dataclass(frozen=True)
class RepertoireRequest:
    """Evolve a grid of walks, speeds by turns, side by side, each seeded from its neighbours.

    Examines each walk. Writes the certified ones as clips of one GLB, in phase, with a table of
    their places in a blend space (docs/guide/repertoire.md).

    Attributes:
      env: Name of a shipped creature, path of a creature folder, or a model file
        (MJCF, URDF, xacro, BVH, GLB or FBX).
      speeds: Speeds: 0.4 (m/s), 0.4bl/s (body lengths per second), or fr0.2 (Froude number).
      turns: Turn rates in degrees per second, each to both sides; straight on is always included.
      gait: Gait of all walks; see `mjxgait train --help`.
      style: Style of all walks: calm, sneaky, heavy, proud, tired, hurried, or a FILE.toml of
        settings.
      config: TOML file with settings, or the name of a shipped config; replaces
        configs/repertoire.toml.
      out: Folder for the repertoire; by default runs/repertoire-CREATURE. Each walk in it is a run
        folder.
      resume: Folder of a repertoire to continue unchanged.
      population: Population size of each walk.
      generations: Generations of each walk, straight or turning.
      seed: Random seed.
      physics: mjx simulates with MJX itself instead of this program's faster step.
      rate: Key frames per second of the clips.
      travelling: Move the root in the clips; otherwise the creature walks in place.
      onto: The character (GLB, FBX) that the creature was imported from; its file gets the clips,
        with its own mesh.
      blends: Test in C MuJoCo also the blends half way between neighbours, and changes from one to
        the other while walking.
      cluster: Evolve on a Ray cluster: HOST:PORT, or auto (docs/guide/cluster.md).
    """

    env: str = "tall_quadruped"
    speeds: tuple[str, ...] = SPEEDS
    turns: tuple[float, ...] = TURNS
    gait: str | None = None
    style: str | None = None
    config: str = "repertoire"
    out: Path | None = None
    resume: Path | None = None
    population: int | None = None
    generations: int | None = None
    seed: int | None = None
    physics: Physics | None = None
    rate: Rate = 60
    travelling: bool = False
    onto: Path | None = None
    blends: bool = True
    cluster: str | None = None


def repertoire(
    env: Place = "tall_quadruped",
    *,
    speeds: Sequence[str | float] = SPEEDS,
    turns: Sequence[float] = TURNS,
    gait: str | None = None,
    style: Place | None = None,
    config: Place = "repertoire",
    out: Place | None = None,
    population: int | None = None,
    generations: int | None = None,
    seed: int | None = None,
    rate: Rate = 60,
    travelling: bool = False,
    onto: Place | None = None,
    blends: bool = True,
    quiet: bool = False,
) -> Path:
    """Evolve a grid of walks that blend, and return its folder (docs/guide/repertoire.md).

    Does the same as `mjxgait repertoire`. Each walk is a run folder in it: `mjxgait.open`.

    Args:
      env: as for `train`.
      speeds: such as "0.4" (m/s), "0.4bl/s" (body lengths per second), "fr0.2" (Froude number).
      turns: degrees per second, each to both sides.
      gait: of all walks, as for `train`.
      style: of all walks, as for `train`.
      config: file with settings, or the name of a shipped config.
      out: the folder, which must be empty or new; by default runs/repertoire-CREATURE.
      population: individuals in a generation of each walk.
      generations: at most, of each walk.
      seed: of all random numbers.
      rate: key frames per second of the clips.
      travelling: moves the root in the clips.
      onto: the character (GLB, FBX) of which the creature was imported; its file gets the clips.
      blends: tests blends and changes between neighbours too.
      quiet: prints nothing.

    Raises:
      UserError: an invalid argument, explained in one sentence.
    """
    request = RepertoireRequest(
        env=str(env),
        speeds=tuple(map(str, speeds)),
        turns=tuple(turns),
        gait=gait,
        style=None if style is None else str(style),
        config=str(config),
        out=None if out is None else path_of(out),
        population=population,
        generations=generations,
        seed=seed,
        rate=rate,
        travelling=travelling,
        onto=None if onto is None else path_of(onto),
        blends=blends,
    )
    folder, ended = evolve_repertoire(request, Output(Console(quiet=True) if quiet else None))
    if not ended:
        raise KeyboardInterrupt
    return folder


def evolve_repertoire(request: RepertoireRequest, output: Output) -> tuple[Path, bool]:
    """Evolve or continue a repertoire; return its folder, and whether it came to its end.

    Raises:
      UserError: invalid options, or the folder cannot be written.
    """
    plan = None if request.resume else planned(request, output.say)
    folder, grid = _resumed(request) if plan is None else (plan.folder, plan.grid)
    # JAX takes a second to import, so the options are checked first.
    from mjxgait.distributed.evolve import scheduler_at
    from mjxgait.experiments.repertoire.grid import evolve
    from mjxgait.training.ended import examine
    from mjxgait.training.loop import interruptible
    from mjxgait.training.stages import prepare_devices

    prepare_devices(1 if request.cluster else None)
    began, screen = time.perf_counter(), _Screen(output)
    first = folder / grid.cells[0].name
    again = command("repertoire", "--resume", folder, run=first)
    with (
        interruptible() as interrupted,
        scheduler_at(request.cluster, output.progress) as scheduler,
    ):
        if plan is not None:
            begin(plan)
        with locked(folder):
            creature, stopped = open_run(first)[0], interrupted.is_set
            character = _character(request.onto, creature)
            ended = evolve(folder, creature, grid, scheduler, screen.evolved, stopped)
            walks = [folder / cell.name for cell in grid.cells]
            ended = ended and examine(folder, walks, again, screen.examined, stopped)
    if not ended:
        output.console.print(f"interrupted; go on with: {again}")
        return folder, False
    _leave(folder, creature, grid, request, screen, character)
    look = command("inspect", folder, run=first)
    output.say(f"{time.perf_counter() - began:.0f} s; each walk is a run: {look}")
    return folder, True


@dataclasses.dataclass(frozen=True, eq=False)
class Planned:
    """A repertoire before anything is written. configs: settings of each cell's run."""

    folder: Path
    creature: Creature
    grid: Grid
    configs: Mapping[Cell, Config]


def planned(options: RepertoireRequest, tell: Tell = silent) -> Planned:
    """Check the options and return the plan. Writes nothing.

    tell: called with the notes of the import of a model file.

    Raises:
      UserError: invalid options, or the folder is not empty.
    """
    from mjxgait.experiments.repertoire.grid import check, settings_of

    creature = load_creature(options.env, tell=tell)
    grid = Grid.of([speed_of(text, creature) for text in options.speeds], options.turns)
    base = _settings(options, creature)
    check(base)
    check_parts(creature, base)
    _character(options.onto, creature)
    folder = options.out or Path("runs") / f"repertoire-{creature.name}"
    check_free(folder)
    # Last, for it draws many poses.
    configs = {cell: settings_of(cell, grid, creature, base) for cell in grid.cells}
    return Planned(folder, creature, grid, configs)


def begin(plan: Planned) -> None:
    """Make the folder, with a run folder per cell.

    Raises:
      UserError: see `check_spec`; or the folder cannot be written.
    """
    from mjxgait.training.spec import check_spec

    folder, cells = plan.folder, plan.grid.cells
    check_spec(plan.creature, plan.configs[cells[0]])
    with disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for cell in cells:
        create_run(folder / cell.name, plan.creature, plan.configs[cell])
    with disk_errors(folder):
        write_text(folder / GRID, plan.grid.text)


def _character(onto: Path | None, creature: Creature) -> "Character | None":
    """Return the character that gets the clips.

    Raises:
      UserError: the file cannot be read, or has not the creature's skeleton.
    """
    if onto is None:
        return None
    from mjxgait.animation.export import bones_of, read_character

    character = read_character(onto)
    bones_of(creature, character)
    return character


def _resumed(options: RepertoireRequest) -> tuple[Path, Grid]:
    folder = options.resume
    assert folder is not None
    grid = Grid.read(folder)
    kept = "a resumed repertoire keeps its walks and their settings"
    check_resumed(options, folder, OF_FILES, kept)
    return folder, grid


def _settings(options: RepertoireRequest, creature: Creature) -> Config:
    """Return the settings that all walks share."""
    config = resolve_config(creature.settings.train, creature.name, Path(options.config))
    config = with_targets(config, creature, WalkTargets(gait=options.gait, style=options.style))
    table = {
        **not_none(seed=options.seed),
        "evolution": not_none(population=options.population, generations=options.generations),
        "rollout": not_none(physics=options.physics),
    }
    return build(type(config), merge(dataclasses.asdict(config), table), "the options")


def _leave(
    folder: Path,
    creature: Creature,
    grid: Grid,
    options: RepertoireRequest,
    screen: "_Screen",
    character: "Character | None",
) -> None:
    """Write the map, and the clips if there are any."""
    from mjxgait.experiments.repertoire.clips import (
        CLIPS,
        TABLE,
        clips_of,
        transitions,
        write_clips,
    )
    from mjxgait.experiments.repertoire.found import draw_map, found_in, table
    from mjxgait.experiments.repertoire.neighbours import blends, changes
    from mjxgait.rendering.curves import figure

    found, console = found_in(folder, grid), screen.output.console
    console.print(table(found))
    size = (2.4 + 1.3 * (2 * len(grid.turns) + 1), 1.6 + 0.9 * len(grid.speeds))
    with disk_errors(folder / MAP), figure(size) as drawing:
        draw_map(drawing, creature.name, grid, found)
        with replaced(folder / MAP) as beside:
            drawing.savefig(beside)
    walks = sum(one.certified for one in found)
    console.print(f"{walks} of {len(found)} walks are certified: {folder / MAP}")
    between = blends(folder, creature, grid, found, screen.blended) if options.blends else []
    if between:
        walking = sum(blend.walks for blend in between)
        console.print(f"half way between neighbours {walking} of {len(between)} walk")
    changed = changes(folder, creature, grid, found, screen.changed) if between else []
    if changed:
        always = sum(change.share == 1 for change in changed)
        console.print(
            f"when commanded to change to a neighbouring walk, it always succeeds in {always} of "
            f"{len(changed)} changes; from {np.mean([c.share for c in changed]):.0%} of the moments"
        )
    if loops := clips_of(folder, found, options.rate):
        ways = transitions(found, loops)
        console.print(f"from standing, and to a stand: {sum(map(bool, ways))} of {len(ways)} found")
        files = folder / CLIPS, folder / TABLE
        write_clips(*files, loops, found, between, changed, ways, options.travelling, character)
        count = len(loops) + sum(map(bool, ways))
        console.print(f"{count} clips: {files[0]}, their places: {files[1]}")


class _Screen(Progress):
    """Progress of one row of walks after the other."""

    def evolved(self, name: str, generation: int, last: int, done: "Advanced | None") -> None:
        if done is None:
            self.output.say(f"{name}: compiling")
            return
        alive = [1 - line["failures"] / max(line["episodes"], 1) for line in done.lines[-1]]
        self.output.say(
            f"{name}: generation {generation} of {last}, {len(alive)} walks side by side, "
            f"{sum(alive) / len(alive):.0%} of their episodes without a fall, "
            f"{pace(done.steps, done.seconds, len(done.lines), last - generation)}"
        )

    def changed(self, count: int, of: int) -> None:
        self.output.say(f"from one walk to another, in C MuJoCo: {count} of {of}")

    def blended(self, count: int, of: int) -> None:
        self.output.say(f"half way between neighbours, in C MuJoCo: {count} of {of}")
