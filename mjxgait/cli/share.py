"""`mjxgait share`: one offline page with a run's champion, or a steerable repertoire."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.cli.options import parsed
from mjxgait.errors import UserError


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
    if options.out.suffix.lower() not in (".html", ".htm"):
        raise UserError(
            f'{options.out}: cannot write "{options.out.suffix}"; end the name with .html'
        )
    from mjxgait.experiments.repertoire.clips import write_driven
    from mjxgait.experiments.repertoire.grid import GRID
    from mjxgait.training.stored import require_writable
    from mjxgait.web.page import write_page

    require_writable(options.out)
    write = write_driven if (options.run / GRID).is_file() else write_page
    said = write(options.run, options.out)
    print(f"{options.out} ({options.out.stat().st_size / 1024:,.0f} KiB)")
    if said:
        print(said)
    return 0
