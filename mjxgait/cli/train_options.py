"""Options of `mjxgait train`."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

import tyro

from mjxgait.cli.options import HELP_ALL, Verbosity
from mjxgait.config.schema import Config, Physics
from mjxgait.creature.scale import Way

Tracker = Literal["tensorboard", "wandb"]


@dataclasses.dataclass(frozen=True)
class TrainOptions(Verbosity):
    """Evolve a walk for a creature.

    Settings come in layers, each overriding the one before: configs/default.toml, the creature's
    own [train] table, the file of --config, and the options given here. Every key of the config is
    an option. --controller and --task select the controller and the task, such as poses and walk,
    or FILE.py:CLASS of your own (docs/guide/your-own-task.md).

    Attributes:
      env: Name of a shipped creature, path of a creature folder, robot:NAME, or a model file to
        import (MJCF, URDF, xacro, BVH, GLB or FBX).
      config: TOML file with settings, or the name of a shipped config such as wilson.
      scale: Size factors of parts, as PATTERN=FACTOR: '*_shin=1.2' for longer shins, 'trunk=0.9'
        (docs/reference/creature-folder.md). Lengths, masses and inertias follow, gains do not.
      way: back, left or right: direction in the creature's own frame; forward by default
        (docs/guide/gaits.md).
      expressions: File of handwritten programs as the start of evolution, for --controller program
        (docs/reference/expressions.md).
      source: Run folder, or folder of several (--runs); the last populations are the first of the
        new run, which may have another task or other settings.
      out: Folder for the run; by default a new one under runs/.
      runs: Number of separate runs side by side, with seeds from --seed on: a folder with a run
        folder each, and a picture of all champions (docs/guide/studies.md).
      tries: Number of runs at most, one after another with seeds from --seed on, until one is
        certified. Each has a folder of its own.
      resume: Run folder to continue, with its own creature and settings. Only the settings that end
        a run may differ: --generations, --evolution.target, --examination.
      generation: With --resume: the checkpoint to continue from, instead of the latest.
      population: Individuals of a generation; short for --evolution.population.
      generations: Maximum number of generations; short for --evolution.generations.
      search: ga, the genetic algorithm, or es, an evolution strategy; short for --evolution.search
        (docs/reference/algorithm.md).
      evolve_body: Short for --evolution.body: 1.25 lets the parts below the trunk become up to a
        quarter larger or a fifth smaller; the run stores the winning body in body/.
      speed: Target speed: 0.4 (m/s), 0.4bl/s (body lengths per second), or fr0.2 (Froude number).
        This and --gait, --turn, --steer and --style are for walking (docs/guide/gaits.md).
      gait: On four feet walk, amble, trot, pace, canter, bound, gallop or hop; on six walk, tripod
        or wave; on eight alternating; on two walk, waddle or hop; natural: the gait of an
        animal at this speed; auto: any gait. By default that of [usual] in creature.toml, or else
        auto.
      turn: Turn rate while walking, degrees per second to the left.
      steer: Largest commanded turn rate that the walk must follow, degrees per second to either
        side.
      style: calm, sneaky, heavy, proud, tired, hurried, or a FILE.toml of settings.
      certificate: walks, or anywhere: trains on uneven ground until the walk passes `mjxgait
        stress` (docs/reference/certificate.md).
      cluster: Evolve on a Ray cluster: HOST:PORT, or auto for the cluster that this machine belongs
        to (docs/guide/cluster.md).
      ground: flat, slope:0.1, steps:0.05, bumps:0.05 or rough:0.05; short for --rollout.ground.
      physics: Short for --rollout.physics: mjx simulates with MJX itself, auto with this program's
        faster step where it supports the model (docs/research/performance.md).
      log: Log for a tracker, repeatable: tensorboard writes event files into the run folder, wandb
        an offline run (docs/guide/research-tools.md).
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
    tries: int = 1
    resume: Path | None = None
    generation: int | None = None
    population: int | None = None
    generations: int | None = None
    search: Literal["ga", "es"] | None = None
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


COMMON = (
    *("env", "out", "generations", "population", "speed", "gait", "style", "ground", "config"),
    *("tries", "runs", "resume", "view", "quiet", "verbose"),
)
"""Options that `--help` shows, besides `--seed`; `--help-all` shows all."""
SHORT = f"""Evolve a walk for a creature.

You may name the creature first: `mjxgait train crab`. The run folder gets the champion, its
certificate and its plots.
`mjxgait train {HELP_ALL}` lists further options and every key of the config; --controller and
--task select another controller and task (docs/guide/your-own-task.md).
"""


def options_of(config: type[Config]) -> type[TrainOptions]:
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


def short_options() -> type:
    """Return the options class that `--help` shows."""
    fields = {field.name: field for field in dataclasses.fields(TrainOptions)}
    shown = [(name, fields[name].type, fields[name]) for name in COMMON]
    documented = (TrainOptions.__doc__, Verbosity.__doc__)
    attributes = "".join((text or "").partition("Attributes:")[2].rstrip() for text in documented)
    return dataclasses.make_dataclass(
        "CommonOptions",
        [*shown[:1], ("seed", int, dataclasses.field(default=0)), *shown[1:]],
        namespace={"__doc__": f"{SHORT}\nAttributes:{attributes}\n      seed: Random seed.\n"},
        frozen=True,
    )
