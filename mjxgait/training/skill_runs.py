"""Run folders of single skills, within that of a body with several: every command works on each."""

import dataclasses
import shutil
from pathlib import Path
from typing import Any

from mjxgait.certification import Certificate
from mjxgait.champion import Champion, by_skill, write_champion
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.files import write_text
from mjxgait.kinds import skills_of, title_of
from mjxgait.tasks.walk.targets import WalkTargets, configured
from mjxgait.training.folder import (
    BODY,
    CERTIFICATE,
    CHAMPION,
    create_run,
    open_run,
    write_creature,
)

SKILLS = "skills"
"""Folder of these run folders."""


def write_skill_runs(
    folder: Path, creature: Creature, champion: Champion, certificate: Certificate
) -> list[Path]:
    """Write `skills/NAME` for each skill of a run's champion, and return these folders.

    Folders of an earlier champion are replaced. A single task has none.
    """
    place, made = folder / SKILLS, []
    if place.exists():
        shutil.rmtree(place)
    for task, one in by_skill(champion).items():
        own = create_run(place / title_of(task), creature, _config(folder, creature, task))
        body = one.embodied(creature)
        write_champion(one, creature, own / CHAMPION)
        write_creature(own / BODY, body.files)
        write_text(own / CERTIFICATE, certificate.skills[task].to_json())
        made.append(own)
    return made


def _config(folder: Path, creature: Creature, task: str) -> Config:
    """Return the settings under which the skill alone would be simulated."""
    config = open_run(folder)[1]
    use = {"controller": config.use.controller, "task": task}
    own = configured(creature, None, use, WalkTargets())
    brain: Any = config.controller
    number = skills_of(config.use.task).index(task)
    return dataclasses.replace(
        own,
        seed=config.seed,
        controller=dataclasses.replace(brain, skill=number),
        rollout=dataclasses.replace(own.rollout, step=config.rollout.step),
    )
