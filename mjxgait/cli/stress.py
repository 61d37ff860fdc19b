"""`mjxgait stress`: stress tests of a walk."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from mjxgait.cli.options import parsed


@dataclasses.dataclass(frozen=True)
class StressOptions:
    """Test a champion harder than the certificate does (docs/reference/certificate.md).

    Bumps, slopes to all sides, a slippery floor, larger pushes, a heavier trunk, ten minutes.

    Writes RUN/stress.json and a picture beside it. The exit code is 0 even if the champion fails.

    Attributes:
      run: Run folder.
      starts: Disturbed initial conditions of each trial.
    """

    run: tyro.conf.Positional[Path]
    starts: Annotated[int, tyro.conf.arg(metavar="COUNT")] = 32


def stress_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(StressOptions, "stress", arguments)
    from mjxgait.certification.stress import StressConfig, stress
    from mjxgait.errors import UserError
    from mjxgait.files import write_text
    from mjxgait.rendering.curves import draw_stress, figure, save
    from mjxgait.training.disk import disk_errors
    from mjxgait.training.folder import STRESS, open_champion

    if options.starts < 1:
        raise UserError(f"--starts {options.starts}: give at least one")
    creature, champion = open_champion(options.run)
    found = stress(
        creature, champion, StressConfig(starts=options.starts), lambda name: print(f"{name}…")
    )
    print("\n".join(found.rows()))
    picture = options.run / "stress"
    with disk_errors(options.run), figure((7.0, 3.6)) as drawing:
        write_text(options.run / STRESS, found.to_json())
        draw_stress(drawing, found, f"{creature.title}, seed {champion.origin.get('seed')}")
        files = save(drawing, picture, ("png",))
    print(f"{options.run / STRESS}, {files[0]}")
    return 0
