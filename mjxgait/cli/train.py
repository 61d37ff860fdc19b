"""`mjxgait train`: evolve a walk."""

import argparse
import contextlib
import dataclasses
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from mjxgait.api import Run, load_creature
from mjxgait.api.make import evolve
from mjxgait.cli.zoo import evolve_zoo
from mjxgait.config.schema import Config, ExaminationConfig, Physics
from mjxgait.config.tables import build, merge
from mjxgait.controllers.expressions.written import with_expressions
from mjxgait.creature import Creature
from mjxgait.creature.scale import Way, at_step, parse_scales
from mjxgait.errors import INTERRUPTED, UserError
from mjxgait.experiments.multi_seed import check_zoo, create_zoo, folders_of, is_zoo
from mjxgait.plugins.registry import meant
from mjxgait.tasks.walk.targets import (
    TARGETS,
    WalkTargets,
    configured,
    hint,
)
from mjxgait.training.folder import (
    METRICS,
    PLOT,
    PLOTS,
    check_run,
    command,
    create_run,
    open_run,
    read_metrics,
)
from mjxgait.training.stored import disk_errors

if TYPE_CHECKING:  # JAX takes a second to import
    from mjxgait.training.screen import Screen

Tracker = Literal["tensorboard", "wandb"]


@dataclasses.dataclass(frozen=True)
class TrainOptions:
    """Evolve a walk for a creature.

    Settings come in layers, each overriding the one before: configs/default.toml, the creature's
    own [train] table, the file of --config, and the options given here. Every key of the config is
    an option. --controller and --task select the controller and the task, such as poses and walk,
    or FILE.py:CLASS of your own (docs/guide/your-own-task.md).

    Attributes:
      env: Name of a shipped creature, path of a creature folder, or a model file (MJCF or URDF) to
        import on the fly.
      config: TOML file with settings, or the name of a shipped config such as wilson.
      scale: Size factors of parts, as PATTERN=FACTOR: '*_shin=1.2' for longer shins, 'trunk=0.9'
        (docs/reference/creature-folder.md). Lengths, masses and inertias follow, gains do not.
      way: back, left or right: direction in the creature's own frame; forward by default
        (docs/guide/gaits.md).
      expressions: File of handwritten programs as the start of evolution, for --controller program
        (docs/reference/expressions.md).
      source: Run folder; its last population is the first of the new run, which may have another
        task or other settings.
      out: Folder for the run; by default a new one under runs/.
      runs: Number of separate runs side by side, with seeds from --seed on: a folder with a run
        folder each, and a picture of all champions (docs/guide/studies.md).
      resume: Run folder to continue, with its own creature and settings. Only the settings that end
        a run may differ: --generations, --evolution.target, --examination.
      generation: With --resume: the checkpoint to continue from, instead of the latest.
      population: Short for --evolution.population.
      generations: Short for --evolution.generations.
      evolve_body: Short for --evolution.body: 1.25 lets the parts below the trunk become up to a
        quarter larger or a fifth smaller; the run stores the winning body in body/.
      speed: Target speed: 0.4 (m/s), 0.4bl/s (body lengths per second), or fr0.2 (Froude number).
        This and the next four are for walking (docs/guide/gaits.md).
      gait: walk, amble, trot, pace, canter, bound, gallop, hop (four feet), walk, tripod, wave
        (six),
        walk, waddle, hop (two), natural (an animal's at this speed), or auto (whatever evolves). By
        default that of [usual] in creature.toml, or else whatever evolves.
      turn: Turn rate while walking, degrees per second to the left.
      steer: Largest commanded turn rate that the walk must follow, degrees per second to either
        side.
      style: calm, sneaky, heavy, proud, tired, hurried, or a FILE.toml of settings.
      certificate: walks, or anywhere: trains on uneven ground until the walk passes `mjxgait
        stress` (docs/reference/certificate.md).
      cluster: Evolve on a Ray cluster: HOST:PORT, or auto for the cluster that this machine belongs
        to (docs/guide/cluster.md).
      ground: Short for --rollout.ground: flat, slope:0.1, steps:0.05, bumps:0.05, rough:0.05.
      physics: Short for --rollout.physics: mjx simulates with MJX itself, auto with this program's
        faster step where it supports the model (docs/research/performance.md).
      log: Log for a tracker, repeatable: tensorboard writes event files into the run folder, wandb an
        offline run (docs/guide/research-tools.md).
      view: Show the best of each generation walking on a page that only this machine can reach.
      plots: Draw all plots at the end of the run (`mjxgait plot`).
      settings: The config, key by key.
    """

    env: str = "tall_quadruped"
    config: str | None = None
    scale: tuple[str, ...] = ()
    way: Way = "forward"
    expressions: Path | None = None
    source: Annotated[Path | None, tyro.conf.arg(name="from")] = None
    out: Path | None = None
    runs: int | None = None
    resume: Path | None = None
    generation: int | None = None
    population: int | None = None
    generations: int | None = None
    evolve_body: float | None = None
    speed: str | None = None
    gait: str | None = None
    turn: float | None = None
    steer: float | None = None
    style: str | None = None
    certificate: str | None = None
    cluster: str | None = None
    ground: str | None = None
    physics: Physics | None = None
    log: Annotated[tuple[Tracker, ...], tyro.conf.UseAppendAction] = ()
    view: bool = False
    plots: bool = True
    settings: Annotated[Config, tyro.conf.arg(name="")] = dataclasses.field(default_factory=Config)


def train_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    creature, default = _layers(arguments)
    shape = _options_of(type(default))
    options = tyro.cli(
        shape, args=list(arguments), prog="mjxgait train", default=shape(settings=default)
    )
    config = _settings(options)
    if not options.resume:
        creature = at_step(creature, config.rollout.step)
        if options.expressions:
            config = with_expressions(creature, config, options.expressions)
    elif options.expressions:
        raise UserError(
            f"{options.resume}: a resumed run keeps the programs that it began with; --expressions "
            "needs a new run"
        )
    if options.source and (options.resume or options.runs is not None):
        raise UserError("--from: for a single new run, without --resume and --runs")
    if said := hint(config):
        print(said)
    if options.runs is not None or _is_zoo(options.resume):
        return _several(options, creature, config, default)
    if options.generation is not None and options.resume is None:
        raise UserError("--generation: names a checkpoint to go on from, so it needs --resume")
    if options.resume is None:
        return _evolve(options, check_run(options.out, creature, config), creature, config)
    _check_resumed(options, config, default)
    from mjxgait.training.ended import nothing_left  # leads to JAX

    over = options.generation is None and nothing_left(options.resume, creature, config, default)
    if over:
        print(over)
        return 0
    return _evolve(options, options.resume, creature, config)


def _check_resumed(options: TrainOptions, config: Config, default: Config) -> None:
    """Reject changes that a resumed run cannot make. default: the settings of its folder."""
    if options.scale or options.way != "forward":
        raise UserError(
            f"{options.resume}: a resumed run keeps its body; --scale and --way need a new run"
        )
    if _without_ends(config) != _without_ends(default):
        raise UserError(
            f"{options.resume}: a resumed run keeps its settings; only --generations, "
            "--evolution.target and --examination may differ"
        )


def _evolve(options: TrainOptions, folder: Path, creature: Creature, config: Config) -> int:
    """Evolve a new or resumed run and draw it; return the exit code."""
    # JAX takes a second to import, so the options are checked first.
    from mjxgait.cli.view import following
    from mjxgait.training.stages import prepare_devices
    from mjxgait.training.trackers import tracked

    prepare_devices(1 if options.cluster else None)
    resumed = options.resume is not None
    with contextlib.ExitStack() as beside:
        screen = beside.enter_context(tracked(folder, options.log))

        def begin() -> None:
            if not resumed:
                create_run(folder, creature, config)
            if options.view:
                beside.enter_context(following(folder))

        at = options.generation, options.cluster
        ended = evolve(folder, creature, config, screen, resumed, *at, begin, options.source)
    if ended:
        screen.next_steps(folder, Run(folder).certified)
    drawn = _draw(folder, screen, all_plots=ended and options.plots)
    return 0 if ended and drawn else INTERRUPTED


def _several(options: TrainOptions, creature: Creature, config: Config, default: Config) -> int:
    """Evolve several runs side by side; return the exit code."""
    if options.view or options.log or options.generation is not None:
        raise UserError("--runs: several runs have no --view, no --log and no --generation")
    if options.resume is None:
        assert options.runs is not None
        # On a cluster each run is a job of its own, so that every machine gets work.
        together = 1 if options.cluster else 0
        zoo = check_zoo(options.out, creature, config, options.runs)
        begin = partial(create_zoo, zoo, creature, config, options.runs, together)
        return evolve_zoo(zoo, options.cluster, begin)
    other = options.scale or options.way != "forward"
    if options.runs is not None or other or config != default:
        raise UserError(
            f"{options.resume}: resumed runs keep their number, body and settings; only --cluster "
            "may be given"
        )
    return evolve_zoo(options.resume, options.cluster)


def _is_zoo(folder: Path | None) -> bool:
    return folder is not None and is_zoo(folder)


def _options_of(config: type[Config]) -> type[TrainOptions]:
    """Return the options class with every key of this config."""
    settings = Annotated[config, tyro.conf.arg(name="")]  # type: ignore[valid-type]
    field = ("settings", settings, dataclasses.field(default_factory=config))
    return dataclasses.make_dataclass(
        "TrainOptions",
        [field],
        bases=(TrainOptions,),
        frozen=True,
        namespace={"__doc__": TrainOptions.__doc__},
    )


def _draw(folder: Path, screen: "Screen", all_plots: bool) -> bool:
    """Draw the run, once its results are on the screen; return False if interrupted."""
    try:
        _plot_fitness(folder)
        if all_plots:
            screen.say(f"Drawing {folder / PLOTS}/; the run itself is done and safe.")
            from mjxgait.rendering.plots import plot_run

            plot_run(folder)
    except KeyboardInterrupt:
        screen.say(f"Not all is drawn; {command('plot', folder, run=folder)} draws it.")
        return False
    return True


def _plot_fitness(folder: Path) -> None:
    """Draw the fitness curve; matplotlib is slow to import, so only if there are data."""
    if lines := read_metrics(folder / METRICS):
        from mjxgait.rendering.curves import plot_fitness

        with disk_errors(
            folder / PLOT,
            "the run itself is safe",
            f"draw it with {command('plot', folder, run=folder)}",
        ):
            plot_fitness(lines, folder / PLOT)


def _layers(arguments: Sequence[str]) -> tuple[Creature, Config]:
    """Return the creature and the settings below the options; they are the options' defaults."""
    early = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    for name in ("--env", "--config", "--resume", "--use.controller", "--use.task"):
        early.add_argument(name, nargs="?")
    for name in TARGETS:
        early.add_argument(f"--{name}", nargs="?")
    early.add_argument("--scale", nargs="*")
    early.add_argument("--way", nargs="?")
    try:
        given, _ = early.parse_known_args(list(arguments))
    except argparse.ArgumentError as error:
        raise UserError(str(error)) from None
    requested = {name: getattr(given, name) for name in TARGETS}
    if given.resume:
        if any(requested.values()):
            raise UserError(
                f"{given.resume}: a resumed run keeps its settings; other targets need a new run"
            )
        folder = Path(given.resume)
        return open_run(folders_of(folder)[0] if is_zoo(folder) else folder)
    scales = parse_scales(given.scale or ())
    way = given.way or "forward"
    creature = load_creature(given.env or TrainOptions.env, scales, print, way)
    file = Path(given.config) if given.config else None
    named = {kind: getattr(given, f"use.{kind}") for kind in ("controller", "task")}
    use = {kind: name for kind, name in named.items() if name}
    return creature, configured(creature, file, use, WalkTargets.of(requested))


def _settings(options: TrainOptions) -> Config:
    """Return the config with the short options applied, checked again.

    The parser checks the types of options, not their ranges.
    """
    short = {
        "population": options.population,
        "generations": options.generations,
        "body": options.evolve_body,
    }
    table = {
        "use": dataclasses.asdict(meant(options.settings.use)),
        "evolution": {key: value for key, value in short.items() if value is not None},
        "rollout": {
            key: getattr(options, key)
            for key in ("ground", "physics")
            if getattr(options, key) is not None
        },
    }
    return build(
        type(options.settings), merge(dataclasses.asdict(options.settings), table), "the options"
    )


def _without_ends(config: Config) -> Config:
    """Return the settings that decide what a generation computes."""
    endless = dataclasses.replace(config.evolution, generations=0, target=None)
    return dataclasses.replace(config, evolution=endless, examination=ExaminationConfig())
