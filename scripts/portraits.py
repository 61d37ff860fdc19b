"""Render the small moving pictures of the README from finished runs.

python scripts/portraits.py runs/every/*-0
"""

import sys
from pathlib import Path

from mjxgait.cli import main
from mjxgait.training.folder import open_run

PICTURES = Path(__file__).parents[1] / "docs" / "images"

for run in sys.argv[1:]:
    creature, _ = open_run(Path(run))
    PICTURES.mkdir(exist_ok=True)
    try:
        main(
            [
                "render",
                run,
                "--out",
                str(PICTURES / f"{creature.name}.webp"),
                "--seconds",
                "3",
                "--size",
                "320",
                "180",
            ]
        )
    except SystemExit as ended:
        if ended.code:
            raise
