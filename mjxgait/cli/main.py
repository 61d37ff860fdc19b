"""The command line: `mjxgait SUBCOMMAND`."""

import importlib
import importlib.metadata
import keyword
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from mjxgait.cli.commands import ALIASES, COMMANDS, MOVED
from mjxgait.errors import (
    INTERRUPTED,
    NotLoaded,
    UserError,
    did_you_mean,
)

OWN_PARTS = ("--controller", "--task")
TAKES = {"train": ("controller", "task"), "certify": ("task",), "gallery": ("task",)}
"""Shipped kinds that a command takes; user-defined ones are loaded for every command."""
"""Options of every subcommand that name user-defined code."""

USAGE = """usage: mjxgait SUBCOMMAND [options]

Evolve a stable walk for any creature.

{commands}

`mjxgait SUBCOMMAND --help` lists the options of each; `mjxgait --version` prints the version."""


def _usage() -> str:
    lines = (f"  {name:10} {one.what}: {one.example}" for name, one in COMMANDS.items())
    return USAGE.format(commands="\n".join(lines))


def _with_own_parts(given: Sequence[str]) -> list[str]:
    """Load the code that `--controller` and `--task` name; return the options of the subcommand.

    No run folder, model or settings file can load code.
    """
    command, *rest = given
    if not any(argument.partition("=")[0] in OWN_PARTS for argument in rest):
        return rest
    from mjxgait.plugins.user_code import take_own

    rest, named = take_own(rest)
    from mjxgait.kinds import shipped

    for kind, name in named.items():
        if name in shipped(kind) and kind not in TAKES.get(command, ()):
            raise UserError(f"--{kind} {name}: mjxgait {command} has no use for it; leave it out")
    if command == "train":
        rest += [word for kind, name in named.items() for word in (f"--use.{kind}", name)]
    if command in ("certify", "gallery") and "task" in named:
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


def _meant(given: Sequence[str]) -> list[str]:
    """Return a command as the program reads it: asking for help, other names, a creature first.

    Raises:
      UserError: the creature is named twice.
    """
    if given[0] == "help":
        return [*(given[1:2] if given[1:2] != ["help"] else []), "--help"]
    command, *rest = ALIASES.get(given[0], given[0]), *given[1:]
    if rest == ["help"] and not Path("help").exists():
        return [command, "--help"]
    if command in COMMANDS and COMMANDS[command].creature and rest and not rest[0].startswith("-"):
        if any(word.partition("=")[0] == "--env" for word in rest):
            raise UserError(
                f"the creature is named twice, {rest[0]} and with --env; name it once: "
                f"mjxgait {command} {rest[0]}"
            )
        rest = ["--env", *rest]
    return [command, *rest]


def _run(given: Sequence[str]) -> int:
    """Run a subcommand; return its exit code.

    Raises:
      UserError: there is none of this name, or it refuses its input.
    """
    name = given[0]
    if name in MOVED:
        raise UserError(MOVED[name])
    if name not in COMMANDS:
        raise UserError(_unknown(name))
    module = importlib.import_module(f"mjxgait.cli.{name + '_' * keyword.iskeyword(name)}")
    code: int = getattr(module, f"{name}_command")(_with_own_parts(given))
    return code


def _unknown(name: str) -> str:
    """Return the error for a subcommand that does not exist."""
    from mjxgait.config.layers import shipped_creatures

    if name in shipped_creatures():
        return f'"{name}" is a creature; evolve its walk with: mjxgait train {name}'
    return f'unknown subcommand "{name}"; {did_you_mean(name, COMMANDS)}'


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the console command. For exit codes see docs/reference/command-line.md."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given:
        print(_usage())
        sys.exit(2)
    try:
        given = _meant(given)
        if given[0] in ("-h", "--help", "--help-all"):
            print(_usage())
            sys.exit(0)
        if given[0] in ("-V", "--version"):
            print(f"mjxgait {importlib.metadata.version('mjxgait')}")
            sys.exit(0)
        sys.exit(_run(given))
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
    except OSError as error:
        if error.filename is None:
            raise
        # Such as a name that is too long, or a folder that may not be read.
        print(f"mjxgait: {error.filename}: {error.strerror}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("mjxgait: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
