"""`mjxgait repertoire`: a grid of walks that blend."""

import dataclasses
from collections.abc import Sequence

from mjxgait.api.repertoires import RepertoireRequest, evolve_repertoire
from mjxgait.cli.options import Verbosity, parsed, request_of
from mjxgait.errors import INTERRUPTED
from mjxgait.output import Output


@dataclasses.dataclass(frozen=True)
class RepertoireOptions(Verbosity, RepertoireRequest):
    """Evolve a grid of walks, speeds by turns, side by side, each seeded from its neighbours.

    Examines each walk. Writes the certified ones as clips of one GLB, in phase, with a table of
    their places in a blend space (docs/guide/repertoire.md).
    """


def repertoire_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(RepertoireOptions, "repertoire", arguments)
    _, ended = evolve_repertoire(
        request_of(RepertoireRequest, options), Output(quiet=options.quiet)
    )
    return 0 if ended else INTERRUPTED
