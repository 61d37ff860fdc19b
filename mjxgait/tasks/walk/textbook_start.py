"""Settings by which evolution begins near a cycle that is drawn after an animal's, and not anywhere."""

from typing import Any

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.creature.textbook import Footfalls, textbook_cycle
from mjxgait.tasks.walk.config import WalkConfig
from mjxgait.tasks.walk.gaits import (
    AUTO,
    WALKS_UP_TO,
    animal_duty,
    animal_stride,
    gait_of,
    placed,
)

DRAWN = 8
"""Poses of a cycle that is drawn."""
WITHIN, SLACK, BEGINS = 25.0, 0.15, 0.4
"""How far evolution may depart from it: deg of each joint of each pose, share of its time; and the
share of that in which it begins."""
ORDERED = {
    "initial_choice": 1,
    "crossing": "align",
    "mutation": "gaussian",
    "forced": {"enabled": False},
}
"""Operators of a search that begins with a cycle: its poses have an order, which permutation and
newcomers would destroy. Nearly all that is drawn around it stays up, so nothing is gained by a
choice of the first."""
INSIDE = 0.05
"""Duty factor by which a drawn gait is away from the ends of what its name allows."""


def top_speed(creature: Creature, config: Config) -> float:
    """m/s up to which faster is better where no speed is asked for."""
    return (config.fitness.speed or WalkConfig().speed) * creature.frame.body_length


def natural_gait(creature: Creature, speed: float) -> str:
    """The gait of an animal with so many feet at a speed in m/s; `auto` where it has no name."""
    froude = speed**2 / (creature.gravity * creature.frame.hip_height)
    names = {2: "walk", 4: "walk" if froude < WALKS_UP_TO else "trot", 6: "tripod"}
    return names.get(len(creature.feet.names), AUTO)


def drawn(name: str, speed: float, creature: Creature, config: Config) -> dict[str, Any]:
    """A gait at a speed in m/s with an animal's strides and duty factor; nothing where it has no name
    or no second half that mirrors the first.
    """
    if name == AUTO or not (gait := gait_of(name, len(creature.feet.names))).twice:
        return {}
    hip = creature.frame.hip_height
    stride, (least, most) = animal_stride(speed, hip), gait.duty
    falls = Footfalls(
        phases=placed(gait, creature.feet.stations)[0],
        duty=min(max(animal_duty(speed, hip), least + INSIDE), most - INSIDE),
        stride=stride,
        lift=config.fitness.clearance * hip,
    )
    cycle = textbook_cycle(creature, falls, DRAWN)
    poses = cycle[: DRAWN // 2] if creature.mirror.symmetric else cycle
    near = {
        "key_poses": len(poses),
        "advance": "clock",
        "around": [round(float(angle), 6) for angle in poses.ravel()],
        "within": WITHIN,
        "tuning": {"period": [(1 - SLACK) * stride / speed, (1 + SLACK) * stride / speed]},
    }
    return {"controller": near, "evolution": {"initial_spread": BEGINS}}
