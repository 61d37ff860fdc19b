"""Run folders that each show one skill of a champion, to film, share, export and examine."""

import dataclasses
from pathlib import Path
from typing import Any

from mjxgait.certification import Certificate
from mjxgait.champion import Champion, by_skill, write_champion
from mjxgait.config.schema import Config
from mjxgait.config.tables import build
from mjxgait.creature import Creature
from mjxgait.files import write_text
from mjxgait.kinds import skills_of, title_of
from mjxgait.tasks.walk.targets import WalkTargets, configured
from mjxgait.training.folder import (
    BODY,
    CERTIFICATE,
    CHAMPION,
    SKILLS,
    open_run,
    write_creature,
    write_setup,
)


def write_skill_runs(folder: Path, champion: Champion, certificate: Certificate) -> list[Path]:
    """Write `skills/NAME` for each skill of a run's champion, and return these folders.

    What an earlier champion left there is replaced, other files stay. A single task has none.
    """
    made: list[Path] = []
    if not (skills := by_skill(champion)):
        return made
    creature, config = open_run(folder)
    for task, one in skills.items():
        own = folder / SKILLS / title_of(task)
        write_setup(own, creature, _single(config, creature, task))
        write_champion(one, creature, own / CHAMPION)
        write_creature(own / BODY, one.embodied(creature).files)
        write_text(own / CERTIFICATE, certificate.skills[task].to_json())
        made.append(own)
    return made


def _single(config: Config, creature: Creature, task: str) -> Config:
    """Return a run's settings with a single skill as task."""
    use = {"controller": config.use.controller, "task": task}
    own = configured(creature, None, use, WalkTargets())
    brain: Any = config.controller
    scores = dataclasses.asdict(getattr(config.fitness, task))
    return dataclasses.replace(
        own,
        seed=config.seed,
        controller=dataclasses.replace(brain, skill=skills_of(config.use.task).index(task)),
        fitness=build(type(own.fitness), scores, f"fitness.{task}"),
        rollout=config.rollout,
    )
