"""The command line: `mjxgait SUBCOMMAND`; `scripts/*.py` are thin wrappers around it."""

import importlib
import importlib.metadata
import keyword
import os
import shlex
import sys
from collections.abc import Sequence

from mjxgait.errors import (
    INTERRUPTED,
    NotLoaded,
    UserError,
    did_you_mean,
)

COMMANDS = {
    "train": "evolve a walk: mjxgait train --env tall_quadruped",
    "refine": "make a hand-made cycle walk: mjxgait refine --env duck --keys walk.glb",
    "certify": "examine a champion in C MuJoCo: mjxgait certify RUN",
    "stress": "test a walk on bumps and slopes, by pushes, for ten minutes: mjxgait stress RUN",
    "inspect": "show what a run or a checkpoint holds: mjxgait inspect RUN",
    "plot": "draw a run: fitness, footfalls, joints, a filmstrip: mjxgait plot RUN",
    "render": "make a video of a walk or a race: mjxgait render RUN --out walk.webp",
    "export": "write a walk as an animation file: mjxgait export RUN --out walk.glb",
    "share": "write one offline page of a walk in 3D: mjxgait share RUN --out walk.html",
    "repertoire": "evolve a grid of walks that blend, for games: mjxgait repertoire --env duck",
    "view": "watch a run as it learns on a local page: mjxgait view RUN",
    "import": "make a creature folder from a model file: mjxgait import robot.urdf --out envs/mine",
    "check": "validate a creature folder and draw it: mjxgait check envs/mine",
    "ablate": "compare settings over seeds, with error bars: mjxgait ablate forced_evolution --out "
    "DIR",
    "envs": "list the shipped creatures and configs",
}
"""Each is `<name>_command` in mjxgait/cli/<name>.py (`import` in import_.py), imported only when it
is called.
"""

MOVED = {"bench": "python benchmarks/speed.py measures the speed, in a checkout of the repository"}
"""What does the work of subcommands that are gone."""

OWN_PARTS = ("--controller", "--task")
"""Options of every subcommand that name user-defined code."""

USAGE = """usage: mjxgait SUBCOMMAND [options]

Evolve a stable walk for any creature.

{commands}

`mjxgait SUBCOMMAND --help` lists the options of each; `mjxgait --version` says which this is."""


def _with_own_parts(given: Sequence[str]) -> list[str]:
    """Load the code that `--controller` and `--task` name; return the options of the subcommand.

    No run folder, model or settings file can load code.
    """
    command, *rest = given
    if not any(argument.partition("=")[0] in OWN_PARTS for argument in rest):
        return rest
    from mjxgait.plugins.user_code import take_own

    rest, named = take_own(rest)
    if command == "train":
        rest += [word for kind, name in named.items() for word in (f"--use.{kind}", name)]
    if command == "certify" and "task" in named:
        rest += ["--task", named["task"]]
    return rest


def _without_own_parts(given: Sequence[str]) -> list[str]:
    """Return the words of a command without those that name user-defined code."""
    rest, waiting = [], list(given)
    while waiting:
        word = waiting.pop(0)
        if word.partition("=")[0] not in OWN_PARTS:
            rest.append(word)
        elif "=" not in word:
            del waiting[:1]
    return rest


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the console command. Exit codes: 0 done, 2 invalid arguments, 130 interrupted."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("-h", "--help"):
        print(
            USAGE.format(
                commands="\n".join(f"  {name:10} {what}" for name, what in COMMANDS.items())
            )
        )
        sys.exit(0 if given else 2)
    if given[0] in ("-V", "--version"):
        print(f"mjxgait {importlib.metadata.version('mjxgait')}")
        sys.exit(0)
    try:
        if given[0] in MOVED:
            raise UserError(MOVED[given[0]])
        if given[0] not in COMMANDS:
            raise UserError(f'unknown subcommand "{given[0]}"; {did_you_mean(given[0], COMMANDS)}')
        module = importlib.import_module(
            f"mjxgait.cli.{given[0] + '_' * keyword.iskeyword(given[0])}"
        )
        sys.exit(getattr(module, f"{given[0]}_command")(_with_own_parts(given)))
    except NotLoaded as error:
        print(f"mjxgait: {error}", file=sys.stderr)
        if error.options:
            words = ["mjxgait", *_without_own_parts(given), *error.options]
            print(f"The whole command: {shlex.join(words)}", file=sys.stderr)
        sys.exit(2)
    except UserError as error:
        print(f"mjxgait: {error}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        # The reader of the output has closed it, as `head` does; Python must not complain at exit
        # about the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except KeyboardInterrupt:
        print("mjxgait: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
