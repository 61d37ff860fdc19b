"""`mjxgait train`: evolve a walk."""

from collections.abc import Sequence

from mjxgait.cli.options import parsed
from mjxgait.cli.train_options import TrainOptions, short_options

__all__ = ["TrainOptions", "train_command"]


def train_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    if {"-h", "--help"} & set(arguments):
        parsed(short_options(), "train", ["--help"])
    from mjxgait.cli.training import train  # JAX takes a second to import

    return train(arguments)
