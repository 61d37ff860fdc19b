"""Champions with several skills: each skill as a champion of its own task."""

import dataclasses
from collections.abc import Mapping

from mjxgait.champion.record import Champion
from mjxgait.kinds import skills_of

TRIALS = "skills"
"""Key of a champion's origin: metrics of the undisturbed trial of each skill, by task."""


def by_skill(champion: Champion) -> dict[str, Champion]:
    """Return the champion as it does each of its skills, by task; empty for a single task."""
    return {
        task: _doing(champion, task, number) for number, task in enumerate(skills_of(champion.task))
    }


def _doing(champion: Champion, task: str, number: int) -> Champion:
    origin = dict(champion.origin)
    nominal = origin.pop(TRIALS, {}).get(task, {})
    return dataclasses.replace(
        champion,
        task=task,
        settings=dataclasses.replace(champion.settings, skill=number),
        terms=_performance(nominal),
        origin={**origin, "nominal": nominal},
    )


def _performance(nominal: Mapping[str, float]) -> dict[str, float]:
    """Return the height of a jumper in m, the speed of others in m/s; empty if nothing counted."""
    if height := nominal.get("height"):
        return {"height": height}
    counted = nominal.get("seconds", 0.0) - nominal.get("since", 0.0)
    return {"speed": nominal["way"] / counted} if counted > 0 else {}
