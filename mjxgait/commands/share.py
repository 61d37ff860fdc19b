"""`mjxgait share`: one offline page of a run's champion."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True)
class ShareOptions:
    """Write one HTML file with the 3D walk, the curves and the certificate; it plays by double
    click, without a network.

    Attributes:
      run: Run folder.
      out: File to write, ending with .html.
    """

    run: tyro.conf.Positional[Path]
    out: Path


def share_command(arguments: Sequence[str]) -> int:
    """Returns the exit code."""
    options = tyro.cli(ShareOptions, args=list(arguments), prog="mjxgait share")
    if options.out.suffix.lower() not in (".html", ".htm"):
        raise UserError(
            f'{options.out}: cannot write "{options.out.suffix}"; end the name with .html'
        )
    from mjxgait.runs.disk import require_writable
    from mjxgait.web.page import write_page

    require_writable(options.out)
    write_page(options.run, options.out)
    print(f"{options.out} ({options.out.stat().st_size / 1024:,.0f} KiB)")
    return 0
