"""Settings that start evolution near a textbook cycle, drawn after an animal's."""

from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.config import smooth
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
"""Poses of a textbook cycle."""
WITHIN, SLACK, BEGINS = 25.0, 0.15, 0.4
"""Search range around the cycle: deg for each joint of each pose, and share of its period.

The third is the share of that range in which evolution begins.
"""
ORDERED = {
    "initial_choice": 1,
    "crossing": "align",
    "mutation": "gaussian",
    "forced": {"enabled": False},
}
"""Operators of a search that begins with a cycle.

Its poses have an order, which permutation and immigrants would destroy. Nearly all individuals
drawn around it stay up, so selecting the first ones gains nothing.
"""
INSIDE = 0.05
"""Margin in duty factor that a textbook cycle keeps from the ends of its gait's range."""


def top_speed(creature: Creature, config: Config) -> float:
    """Speed in m/s up to which faster is better, without a target speed."""
    return (config.fitness.speed or WalkConfig().speed) * creature.frame.body_length


def natural_gait(creature: Creature, speed: float) -> str:
    """Gait of an animal with as many feet at a speed in m/s; `auto` if it has no name."""
    froude = speed**2 / (creature.gravity * creature.frame.hip_height)
    names = {
        2: "walk",
        4: "walk" if froude < WALKS_UP_TO else "trot",
        6: "tripod",
        8: "alternating",
    }
    return names.get(len(creature.feet.names), AUTO)


def drawn(name: str, speed: float, creature: Creature, config: Config) -> dict[str, object]:
    """Settings for a textbook cycle of a gait at a speed in m/s.

    The cycle has an animal's strides and duty factor. Empty without a name, and for a gait
    that is not `drawn`.
    """
    if name == AUTO or not (gait := gait_of(name, len(creature.feet.names))).drawn:
        return {}
    hip = creature.frame.hip_height
    stride, (least, most) = gait.stride * animal_stride(speed, hip), gait.duty
    falls = Footfalls(
        phases=placed(gait, creature.feet.stations)[0],
        duty=min(max(animal_duty(speed, hip), least + INSIDE), most - INSIDE),
        stride=stride,
        lift=config.fitness.clearance * hip,
    )
    cycle = textbook_cycle(creature, falls, DRAWN)
    poses = cycle[: DRAWN // 2] if creature.mirror.symmetric and gait.twice else cycle
    slow, time_step = (1 + SLACK) * stride / speed, float(creature.model.opt.timestep)
    near = {
        "key_poses": len(poses),
        "advance": "clock",
        "interpolation": smooth(slow, DRAWN, time_step),
        "around": [round(float(angle), 6) for angle in poses.ravel()],
        "within": WITHIN,
        "tuning": {"period": [(1 - SLACK) * stride / speed, slow]},
    }
    return {"controller": near, "evolution": {"initial_spread": BEGINS}}
