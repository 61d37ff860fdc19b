"""Draw one stride of each champion and write docs/research/filmstrips.md.

python scripts/filmstrips.py runs/every/*-[0-4]
"""

import sys
import tempfile
from pathlib import Path

from PIL import Image

from mjxgait.certification import read_certificate
from mjxgait.cli import main
from mjxgait.errors import UserError
from mjxgait.training.folder import CERTIFICATE, open_run

DOCS = Path(__file__).parents[1] / "docs"
WIDTH = 1100


def strip(run: Path, name: str) -> Path:
    """Draw the filmstrip of a run, write it as a small picture to the docs, return its path."""
    picture = DOCS / "images" / "strips" / f"{name}.webp"
    picture.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        drawn = Path(scratch) / "strip.png"
        try:
            main(["render", str(run), "--out", str(drawn)])
        except SystemExit as ended:
            if ended.code:
                raise
        with Image.open(drawn) as image:
            image.convert("RGB").resize((WIDTH, round(image.height * WIDTH / image.width))).save(
                picture, quality=70
            )
    return picture


lines = [
    "# One stride of each champion",
    "",
    "Drawn from the walks in C MuJoCo whose figures are in [results.md](results.md).",
    "",
]
for run in map(Path, sys.argv[1:]):
    creature, config = open_run(run)
    certificate = read_certificate(run / CERTIFICATE)
    if certificate is None:
        raise UserError(f"{run}: no certificate; run mjxgait certify {run}")
    title = f"{creature.name.replace('_', ' ')}, seed {config.seed}"
    picture = strip(run, f"{creature.name}-{config.seed}")
    said = f"{certificate['report']['gait']}, {certificate['report']['speed']:.2f} m/s"
    lines += [
        f"## {title}: {said}",
        "",
        f"![{title}](../{picture.relative_to(DOCS).as_posix()})",
        "",
    ]
(DOCS / "research" / "filmstrips.md").write_text("\n".join(lines), encoding="utf-8")
