"""The command line: one file per subcommand."""

from mjxgait.cli.main import COMMANDS, main

__all__ = ["COMMANDS", "main"]
