"""`mjxgait ablate`: compare variants of the settings over seeds, with error bars."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.api.studies import AblateRequest, evolve_study, prepared
from mjxgait.cli.options import Verbosity, parsed, request_of
from mjxgait.errors import INTERRUPTED
from mjxgait.output import Output


@dataclasses.dataclass(frozen=True)
class AblateOptions(Verbosity, AblateRequest):
    """Run a study, variants times seeds side by side, with a report (docs/research/ablations.md).

    Writes report.md, report.html, results.csv and generations.parquet into the study folder.

    Attributes:
      study: File of a study, or the name of a shipped one; not needed with --resume.
      dry_run: Only print the planned runs and the estimated time.
    """

    study: tyro.conf.Positional[Path | None] = None
    dry_run: bool = False


def ablate_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(AblateOptions, "ablate", arguments)
    request, output = request_of(AblateRequest, options), Output(quiet=options.quiet)
    planned = prepared(request)
    if options.dry_run:
        output.console.print(planned.words)
        return 0
    output.say(planned.words)
    return INTERRUPTED if evolve_study(planned, request, output) is None else 0
