"""The subcommands: what each does, and an example."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Command:
    """A subcommand in words.

    what: what it does. example: a command to type. creature: whether its first word may be a
      creature, as in `mjxgait train crab`.
    """

    what: str
    example: str
    creature: bool = False


COMMANDS = {
    "train": Command("evolve a walk", "mjxgait train tall_quadruped", creature=True),
    "refine": Command(
        "make a hand-made cycle walk",
        "mjxgait refine short_quadruped --keys walk.glb",
        creature=True,
    ),
    "certify": Command("examine a champion in C MuJoCo", "mjxgait certify RUN"),
    "stress": Command(
        "test a walk on bumps and slopes, by pushes, for ten minutes", "mjxgait stress RUN"
    ),
    "inspect": Command("show what a run or a checkpoint holds", "mjxgait inspect RUN"),
    "plot": Command("draw a run: fitness, footfalls, joints, a filmstrip", "mjxgait plot RUN"),
    "render": Command("make a video of a walk or a race", "mjxgait render RUN --out walk.webp"),
    "export": Command("write a walk as an animation file", "mjxgait export RUN --out walk.glb"),
    "build": Command("design a robot from a body of blocks", "mjxgait build RUN --out robot"),
    "share": Command("write one offline page of a walk in 3D", "mjxgait share RUN --out walk.html"),
    "gallery": Command(
        "show champions side by side on one page",
        "mjxgait gallery RUNS --out all.html",
    ),
    "repertoire": Command(
        "evolve a grid of walks that blend, for games",
        "mjxgait repertoire tall_quadruped",
        creature=True,
    ),
    "view": Command("watch a run as it learns on a local page", "mjxgait view RUN"),
    "import": Command(
        "make a creature folder from a model file", "mjxgait import robot.urdf --out envs/mine"
    ),
    "check": Command("validate a creature folder and draw it", "mjxgait check envs/mine"),
    "ablate": Command(
        "compare settings over seeds, with error bars",
        "mjxgait ablate forced_evolution --out DIR",
    ),
    "leaderboard": Command(
        "success rates per creature, task and algorithm", "mjxgait leaderboard add RUN"
    ),
    "list": Command("list the shipped creatures, configurations, tasks, gaits", "mjxgait list"),
    "doctor": Command("tell whether a run would work on this machine", "mjxgait doctor"),
    "cache": Command("show or clear the compiled programs", "mjxgait cache"),
    "completion": Command(
        "print a script for Tab in bash, zsh or fish",
        'eval "$(mjxgait completion bash)"',
    ),
}
"""Each is `<name>_command` in mjxgait/cli/<name>.py (`import` in import_.py), imported only when it
is called.
"""

ALIASES = {"envs": "list"}
"""Other names of subcommands."""

MOVED = {"bench": "python benchmarks/speed.py measures the speed, in a checkout of the repository"}
"""What does the work of subcommands that are gone."""
