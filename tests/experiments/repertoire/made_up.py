"""A repertoire of the smallest creature, made without evolution or certification."""

import dataclasses
import functools
import shutil
import tempfile
from pathlib import Path

from helpers import STOOL
from rendering.made_up import treading

from mjxgait.api.repertoires import RepertoireRequest, planned
from mjxgait.api.repertoires import begin as begin_repertoire
from mjxgait.certification import (
    Certificate,
    CertificateConfig,
    Criterion,
    Measure,
)
from mjxgait.champion import write_champion
from mjxgait.creature import Creature
from mjxgait.experiments.repertoire.grid import Cell, Grid
from mjxgait.training.folder import CERTIFICATE, CHAMPION, open_run

SMALL = """
checkpoint_every = 1
[rollout]
seconds = 0.4
starts = 2
lanes = 4
[examination]
candidates = 0
"""
GENERATIONS = 2
CERTIFIED = (Cell(0.2, 0.0), Cell(0.2, 10.0))


def begin(folder: Path) -> tuple[Path, Creature, Grid]:
    """A copy of a repertoire made once per process, because making one samples many poses."""
    made, grid = _begun()
    shutil.copytree(Path(made.name) / "set", folder)
    return folder, open_run(folder / grid.cells[0].name)[0], grid


@functools.cache
def _begun() -> tuple[tempfile.TemporaryDirectory, Grid]:
    """A folder that lasts as long as the process, and its grid."""
    made = tempfile.TemporaryDirectory(prefix="mjxgait-repertoire-")
    settings = Path(made.name) / "set.toml"
    settings.write_text(SMALL)
    plan = planned(
        RepertoireRequest(
            env=str(STOOL),
            speeds=("0.2", "0.4"),
            turns=(10.0,),
            config=str(settings),
            out=Path(made.name) / "set",
            population=6,
            generations=GENERATIONS,
        )
    )
    begin_repertoire(plan)
    return made, plan.grid


def certificate(creature: Creature, passed: bool) -> str:
    measure = Measure("speed", 0.6 if passed else 0.4, ">=", 0.5, 1.0)
    report = {"speed": 0.21, "duty_factor": {"a": 0.5, "b": 0.7}, "gait": "trot", "summary": ""}
    criteria = (Criterion(2, "progress", (measure,)),)
    config = CertificateConfig()
    return Certificate(
        creature.name, creature.digest, "walk", "", criteria, report, config, 1.0
    ).to_json()


def examine(folder: Path, creature: Creature, grid: Grid) -> None:
    """Write champions and certificates as if two walks had passed."""
    champion = treading(creature, degrees=35.0)
    for cell in grid.cells:
        wish = {"speed": cell.speed} | ({"turn": cell.turn} if cell.turn else {})
        place = folder / cell.name
        write_champion(dataclasses.replace(champion, wish=wish), creature, place / CHAMPION)
        (place / CERTIFICATE).write_text(certificate(creature, cell in CERTIFIED))
