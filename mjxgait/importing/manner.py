"""How a body of its class is to be evolved: settings that differ from those of a dog."""

from typing import Any

from mjxgait.importing.notes import Notes
from mjxgait.settings.config import Config
from mjxgait.settings.control import unhurried
from mjxgait.settings.gaits import stride_limit
from mjxgait.settings.walk import WalkConfig

STARTS, ALIVE = 6, 6.0
"""Episodes by which a body is judged that steps under its fall, and what it counts to stay up to the end."""
LATE, HASTY = 1, 8.0
"""Control steps by which torques may come late, which is what fells such a body first in its
examination; and what it costs to be hasty, twice the usual."""
BRISK = 1.2
"""Body lengths per second that such a body should walk: slower it has to stand on one foot."""
STRIDE = 0.7
"""Hip heights that its strides should be at that speed."""
LEAST = 0.5
"""Those that the certificate asks for: a cycle that leads through shorter ones is a buzz."""

LEAPING, RISES = 1.6, 8
"""Body lengths per second that who has one leg should hop, in the rhythm of who has two, and in how many steps
disturbances grow as it learns to bear them: at two legs' speed its hops are short, and with all at once it falls."""

WHIPPED = 4.0
"""What it costs to swing a foot too fast, in body lengths per √(g·h): of robots that fail by one
criterion alone most do by the speed of their fastest part, which is a foot."""
GENERATIONS = 150
"""Most of them, twice as many as usual."""
SMALLER = 0.03
"""Step of a mutation, as a share of a joint's range: half of that on four feet."""
ENOUGH = 0.1
"""Margin with which a run may end in its first half; hasty as they all are, few ever get to 0.2."""


def manner(
    steps: bool,
    legs: int,
    symmetric: bool,
    hip: float,
    length: float,
    mass: float,
    time_step: float,
    rotor: float,
    notes: Notes,
) -> dict[str, Any]:
    """The table `[train]` of an imported creature, each reason told.

    Args:
      steps: whether it must step under its fall. legs: how many. hip: m, its height. length: m, of the body. mass: kg.
      time_step: s. rotor: kg m², the inertia of its usual motor.
    """
    table: dict[str, Any] = {"base": "other_starts", "examination": {"enough": ENOUGH}}
    if steps:
        table |= few_feet(hip, length, mass, time_step)
        speed = f"{BRISK:g} body lengths/s in strides of {STRIDE:g} hip heights"
        if legs == 1:
            table["fitness"] |= {"speed": LEAPING, "hardening": RISES}
            table["fitness"]["weights"]["airborne"] = 0.0
            speed = f"{LEAPING:g} body lengths/s, in the air for free; disturbances that grow"
        notes.guess(
            "train",
            f"{STARTS} starts, others in each of {GENERATIONS} generations at most, with torques up to {LATE} "
            f"step late; small mutations; staying up counts {ALIVE:g}, {speed}",
            "medium",
            "on one foot or two it falls unless it walks: more disturbed starts, and first of all "
            "to stay up",
        )
    else:
        table["fitness"] = {"weights": {"foot_speed": WHIPPED}}
        # It bounces: what is near the floor need not bear weight, which others learn more slowly by.
        bounces = rotor > mass * hip**2
        if bounces:
            table["fitness"]["contact"] = 0.0
        notes.guess(
            "train",
            "other starts in each generation; small mutations; feet that swing too fast cost"
            + ("; feet are down that bear weight" if bounces else ""),
            "high",
            "of what robots' joints do at random little stands, and much of it whips"
            + (": its motors are heavier to turn than all of it" if bounces else ""),
        )
    if not symmetric:
        table.setdefault("controller", {})["key_poses"] = 2 * Config().controller.key_poses
    return table


def few_feet(hip: float, length: float, mass: float, time_step: float) -> dict[str, Any]:
    """What is different for who steps under its fall; see `manner`."""
    hertz = BRISK * length / (STRIDE * hip)
    calm = min(WalkConfig().frequency, hertz / stride_limit(mass))
    shortest = LEAST * hip / (BRISK * length)
    return {
        "controller": {"interpolation": unhurried(shortest, time_step)},
        # Undisturbed it tells little about who bears something: all are tried in all starts.
        "rollout": {"variety": GENERATIONS, "starts": STARTS, "promote": 1.0, "latency": LATE},
        "evolution": {"generations": GENERATIONS, "sigma": SMALLER},
        "fitness": {
            "speed": BRISK,
            "frequency": round(calm, 2),
            "weights": {"alive": ALIVE, "frequency": HASTY},
        },
    }
