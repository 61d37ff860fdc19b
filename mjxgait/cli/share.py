"""`mjxgait share`: one offline page with a run's champion, or a steerable repertoire."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.cli.options import parsed


@dataclasses.dataclass(frozen=True)
class ShareOptions:
    """Write one HTML file with the 3D walk, the curves and the certificate.

    It plays by double click, without a network. The page of a repertoire is steered with arrow keys
    or a stick.

    Attributes:
      run: Run folder, or the folder of a repertoire.
      out: File to write, ending with .html.
    """

    run: tyro.conf.Positional[Path]
    out: Path


def share_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(ShareOptions, "share", arguments)
    from mjxgait.api.exports import share

    share(options.run, options.out, tell=print)
    return 0
