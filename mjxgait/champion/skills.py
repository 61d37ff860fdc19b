"""Champions with several skills: each skill as a champion of its own task."""

import dataclasses

import numpy as np

from mjxgait.champion.record import Champion
from mjxgait.kinds import skills_of

SKILLS = "skills"
"""Key of a champion's origin: metrics of the undisturbed trial of each skill, by task."""


def by_skill(champion: Champion) -> dict[str, Champion]:
    """Return the champion as it does each of its skills, by task; empty for a single task."""
    return {
        task: _doing(champion, task, number) for number, task in enumerate(skills_of(champion.task))
    }


def _doing(champion: Champion, task: str, number: int) -> Champion:
    nominal = champion.origin.get(SKILLS, {}).get(task, {})
    counted = nominal.get("seconds", np.nan) - nominal.get("since", np.nan)
    speed = nominal.get("way", np.nan) / counted if counted > 0 else np.nan
    return dataclasses.replace(
        champion,
        task=task,
        settings=dataclasses.replace(champion.settings, skill=number),
        terms={"speed": speed},
        origin={**champion.origin, "nominal": nominal},
    )
