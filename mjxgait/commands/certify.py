"""`mjxgait certify`: examine the champion of a run in C MuJoCo."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.library import examine
from mjxgait.runs.folder import CERTIFICATE


@dataclasses.dataclass(frozen=True)
class CertifyOptions:
    """Examine the champion of a run: whether it truly walks, criterion by criterion
    (docs/certificate.md).

    Writes RUN/certificate.json. The exit code is 0 whether or not the champion passes, as long as
    it could be examined.

    Attributes:
      run: Run folder.
      config: TOML file with other thresholds; configs/certificate/default.toml shows all.
    """

    run: tyro.conf.Positional[Path]
    config: Path | None = None


def certify_command(arguments: Sequence[str]) -> int:
    """Returns the exit code."""
    options = tyro.cli(CertifyOptions, args=list(arguments), prog="mjxgait certify")
    certificate = examine(options.run, options.config)
    from mjxgait.runs.screen import Screen  # rich is slow to import

    (options.run / CERTIFICATE).write_text(certificate.to_json(), encoding="utf-8")
    Screen().certificate(certificate)
    return 0
