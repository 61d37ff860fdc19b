"""`mjxgait completion`: a script that completes subcommands and options on Tab."""

import contextlib
import dataclasses
import functools
import importlib
import keyword
import operator
from collections.abc import Sequence
from typing import Annotated, Any, Literal

import tyro

from mjxgait.cli.commands import COMMANDS
from mjxgait.cli.options import parsed


@dataclasses.dataclass(frozen=True)
class CompletionOptions:
    """Print a script that completes subcommands, options and their values on Tab.

    bash: add `eval "$(mjxgait completion bash)"` to ~/.bashrc. zsh: write the script to a file
    `_mjxgait` in a folder of $fpath. fish: write it to ~/.config/fish/completions/mjxgait.fish.

    Attributes:
      shell: The shell.
    """

    shell: tyro.conf.Positional[Literal["bash", "zsh", "fish"]]


def completion_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(CompletionOptions, "completion", arguments)
    commands: Any = functools.reduce(operator.or_, map(_subcommand, COMMANDS))
    with contextlib.suppress(SystemExit):  # tyro ends the program after printing
        tyro.cli(commands, prog="mjxgait", args=["--tyro-print-completion", options.shell])
    return 0


def _subcommand(name: str) -> Any:
    module = importlib.import_module(f"mjxgait.cli.{name + '_' * keyword.iskeyword(name)}")
    options = getattr(module, f"{name.capitalize()}Options")
    named = tyro.conf.subcommand(name, description=COMMANDS[name].what, prefix_name=False)
    return Annotated[options, named]
