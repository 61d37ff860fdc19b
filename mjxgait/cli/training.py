"""What `mjxgait train` does: read the options, evolve, draw."""

import argparse
import contextlib
import dataclasses
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from mjxgait.api import Run, load_creature
from mjxgait.api.make import attempts, evolve
from mjxgait.api.multi_seed import evolve_seeds
from mjxgait.cli.options import parsed
from mjxgait.cli.train_options import TrainOptions, options_of
from mjxgait.config.layers import shipped_creatures
from mjxgait.config.schema import Config, ExaminationConfig
from mjxgait.config.tables import build, merge, not_none
from mjxgait.controllers.expressions.written import with_expressions
from mjxgait.creature import Creature
from mjxgait.creature.scale import at_step, parse_scales
from mjxgait.errors import INTERRUPTED, UserError
from mjxgait.experiments.multi_seed import (
    check_multi_seed,
    create_multi_seed,
    folders_of,
    is_multi_seed,
)
from mjxgait.output import Output, Tell, silent
from mjxgait.plugins.registry import meant
from mjxgait.tasks.walk.targets import (
    TARGETS,
    WalkTargets,
    configured,
    hint,
)
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import (
    METRICS,
    PLOT,
    PLOTS,
    command,
    create_run,
    open_run,
    shows_skill_of,
)
from mjxgait.training.logs import read_metrics

if TYPE_CHECKING:  # JAX takes a second to import
    from mjxgait.training.screen import Screen


def train(arguments: Sequence[str]) -> int:
    """Evolve what these options name; return the exit code."""
    notes: list[str] = []
    creature, default = _layers(arguments, notes.append)
    shape = options_of(type(default))
    options = parsed(shape, "train", arguments, shape(settings=default))
    config = _settings(options)
    several = options.runs is not None or _is_multi_seed(options.resume)
    _check_options(options, several)
    if not options.resume:
        creature = at_step(creature, config.rollout.step)
        if options.expressions:
            config = with_expressions(creature, config, options.expressions)
    if not options.quiet:
        for line in (*notes, *filter(None, [hint(config)])):
            print(line)
    mine = options.resume is None and options.env not in shipped_creatures()
    if mine and config.use.task == "walk" and not options.quiet:
        _tell_limits(creature)
    if several:
        return _several(options, creature, config, default)
    if options.resume is None:
        return _until_certified(options, creature, config)
    if whole := shows_skill_of(options.resume):
        raise UserError(f"{options.resume}: it shows one skill of {whole}; resume that run")
    _check_resumed(options, config, default)
    from mjxgait.training.ended import nothing_left  # leads to JAX
    from mjxgait.training.initial import has_begun

    if options.generation is not None and not has_begun(options.resume):
        raise UserError(
            f"{options.resume}: it has no checkpoint yet, of any generation; leave --generation out"
        )
    over = options.generation is None and nothing_left(options.resume, creature, config, default)
    if over:
        print(over)
        return 0
    return _evolve(options, options.resume, creature, config)


def _check_options(options: TrainOptions, several: bool) -> None:
    """Refuse options that do not go together. several: whether several runs go side by side."""
    if options.resume and options.expressions:
        raise UserError(
            f"{options.resume}: a resumed run keeps the programs that it began with; --expressions "
            "needs a new run"
        )
    if options.source and (options.resume or options.runs is not None):
        raise UserError("--from: for a single new run, without --resume and --runs")
    if options.tries != 1 and (options.resume or options.runs is not None):
        raise UserError("--tries: for new runs one after another, without --resume and --runs")
    if several and (options.view or options.log or options.generation is not None):
        raise UserError("--runs: several runs have no --view, no --log and no --generation")
    if options.generation is not None and options.resume is None:
        raise UserError("--generation: names a checkpoint to go on from, so it needs --resume")


def _check_resumed(options: TrainOptions, config: Config, default: Config) -> None:
    """Reject changes that a resumed run cannot make. default: the settings of its folder."""
    if options.out is not None:
        raise UserError(f"{options.resume}: a resumed run keeps its folder; leave --out out")
    if options.scale or options.way != "forward":
        raise UserError(
            f"{options.resume}: a resumed run keeps its body; --scale and --way need a new run"
        )
    if _without_ends(config) != _without_ends(default):
        raise UserError(
            f"{options.resume}: a resumed run keeps its settings; only --generations, "
            "--evolution.target and --examination may differ"
        )


def _until_certified(options: TrainOptions, creature: Creature, config: Config) -> int:
    """Evolve new runs until one is certified; return the exit code."""
    code = 0
    for number, (folder, one) in enumerate(attempts(options.out, creature, config, options.tries)):
        if number and not options.quiet:
            print(f"Not certified: seed {one.seed} is next, {number + 1} of {options.tries}.")
        code = _evolve(options, folder, creature, one)
        if code or Run(folder).certified:
            break
    return code


def _tell_limits(creature: Creature) -> None:
    """Print what a body lacks for a walk that is certified."""
    from mjxgait.certification.feasibility import feasibility

    for limit in feasibility(creature).limits:
        print(*limit)


def _evolve(options: TrainOptions, folder: Path, creature: Creature, config: Config) -> int:
    """Evolve a new or resumed run and draw it; return the exit code."""
    # JAX takes a second to import, so the options are checked first.
    from mjxgait.cli.view import following
    from mjxgait.training.stages import prepare_devices
    from mjxgait.training.trackers import tracked

    prepare_devices(1 if options.cluster else None)
    resumed = options.resume is not None
    with contextlib.ExitStack() as beside:
        screen = beside.enter_context(tracked(folder, options.log, options.quiet))

        def begin() -> None:
            if not resumed:
                create_run(folder, creature, config)
            if options.view:
                beside.enter_context(following(folder))

        at = options.generation, options.cluster
        ended = evolve(folder, creature, config, screen, resumed, *at, begin, options.source)
    if ended:
        screen.next_steps(folder, Run(folder).certified)
    subject = f"{creature.title}, seed {config.seed}"
    drawn = _draw(folder, screen, subject, all_plots=ended and options.plots)
    return 0 if ended and drawn else INTERRUPTED


def _several(options: TrainOptions, creature: Creature, config: Config, default: Config) -> int:
    """Evolve several runs side by side; return the exit code."""
    output = Output(quiet=options.quiet)
    if options.resume is None:
        assert options.runs is not None
        # On a cluster each run is a job of its own, so that every machine gets work.
        together = 1 if options.cluster else 0
        parent = check_multi_seed(options.out, creature, config, options.runs)
        if config.evolution.ancestors.runs:
            from mjxgait.experiments.ancestors import settings_of_ancestors  # leads to JAX

            settings_of_ancestors(creature, config)
        begin = partial(create_multi_seed, parent, creature, config, options.runs, together)
        ended = evolve_seeds(parent, output, options.cluster, begin)
        return 0 if ended else INTERRUPTED
    other = options.scale or options.way != "forward" or options.out is not None
    if options.runs is not None or other or config != default:
        raise UserError(
            f"{options.resume}: resumed runs keep their number, body and settings; only --cluster "
            "may be given"
        )
    return 0 if evolve_seeds(options.resume, output, options.cluster) else INTERRUPTED


def _is_multi_seed(folder: Path | None) -> bool:
    return folder is not None and is_multi_seed(folder)


def _draw(folder: Path, screen: "Screen", subject: str, all_plots: bool) -> bool:
    """Draw the run, once its results are on the screen; return False if interrupted."""
    try:
        _plot_fitness(folder, subject)
        if all_plots:
            screen.say(f"Drawing {folder / PLOTS}/; the run itself is done and safe.")
            from mjxgait.rendering.plots import plot_run

            plot_run(folder, formats=("png",))
    except KeyboardInterrupt:
        screen.say(f"Not all is drawn; {command('plot', folder, run=folder)} draws it.")
        return False
    return True


def _plot_fitness(folder: Path, subject: str = "") -> None:
    """Draw the fitness curve; matplotlib is slow to import, so only if there are data."""
    if lines := read_metrics(folder / METRICS):
        from mjxgait.rendering.curves import plot_fitness

        with disk_errors(
            folder / PLOT,
            "the run itself is safe",
            f"draw it with {command('plot', folder, run=folder)}",
        ):
            plot_fitness(lines, folder / PLOT, subject)


def _layers(arguments: Sequence[str], tell: Tell = silent) -> tuple[Creature, Config]:
    """Return the creature and the settings below the options; they are the options' defaults.

    tell: called with the notes of the import of a model file.
    """
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
        for name in ("env", "config"):
            if getattr(given, name):
                raise UserError(
                    f"{given.resume}: a resumed run keeps its creature and its settings; leave "
                    f"--{name} out"
                )
        folder = Path(given.resume)
        return open_run(folders_of(folder)[0] if is_multi_seed(folder) else folder)
    scales = parse_scales(given.scale or ())
    way = given.way or "forward"
    creature = load_creature(given.env or TrainOptions.env, scales, tell, way)
    file = Path(given.config) if given.config else None
    named = {kind: getattr(given, f"use.{kind}") for kind in ("controller", "task")}
    use = {kind: name for kind, name in named.items() if name}
    return creature, configured(creature, file, use, WalkTargets.of(requested))


def _settings(options: TrainOptions) -> Config:
    """Return the config with the short options applied, checked again.

    The parser checks the types of options, not their ranges.
    """
    table = {
        "use": dataclasses.asdict(meant(options.settings.use)),
        "evolution": not_none(
            population=options.population,
            generations=options.generations,
            body=options.evolve_body,
            search=options.search,
        ),
        "rollout": not_none(ground=options.ground, physics=options.physics),
    }
    return build(
        type(options.settings), merge(dataclasses.asdict(options.settings), table), "the options"
    )


def _without_ends(config: Config) -> Config:
    """Return the settings that decide what a generation computes."""
    endless = dataclasses.replace(config.evolution, generations=0, target=None)
    return dataclasses.replace(config, evolution=endless, examination=ExaminationConfig())
