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

GENERATIONS = 150
"""Most of them, twice as many as usual."""
SMALL, SMALLER = 0.06, 0.03
"""Step of a mutation, as a share of a joint's range: on four feet, and on less. To draw two joints
anew fells nearly every child of a parent that stands on one foot, and most of a dog's."""
EXAMINATION = {"enough": 0.1, "draws": 64}
"""Margin with which a run may end in its first half; hasty as they all are, few ever get to 0.2.
Starts to choose on, as many as the examination has: who bears 32 often has no room for 64 others."""


def manner(
    steps: bool,
    symmetric: bool,
    hip: float,
    length: float,
    mass: float,
    time_step: float,
    notes: Notes,
) -> dict[str, Any]:
    """The table `[train]` of an imported creature, each reason told.

    Args:
      steps: whether it must step under its fall. hip: m, its height. length: m, of the body. mass: kg.
      time_step: s.
    """
    generations = GENERATIONS if steps else Config().evolution.generations
    table: dict[str, Any] = {
        # Nobody learns a few starts by heart and falls in all others; who was lucky is believed less.
        "rollout": {"variety": generations, "caution": 1.0, "worst": 0.0},
        "evolution": judged_anew(generations, SMALLER if steps else SMALL),
        "examination": EXAMINATION,
    }
    if steps:
        few = few_feet(hip, length, mass, time_step)
        table |= few | {"rollout": table["rollout"] | few["rollout"]}
        notes.guess(
            "train",
            f"{STARTS} starts, others in each of {GENERATIONS} generations at most, with torques up to {LATE} "
            f"step late; small mutations; staying up counts {ALIVE:g}, {BRISK:g} body lengths/s in strides "
            f"of {STRIDE:g} hip heights",
            "medium",
            "on one foot or two it falls unless it walks: more disturbed starts, and first of all "
            "to stay up",
        )
    else:
        notes.guess(
            "train",
            "other starts in each generation; small mutations",
            "high",
            "of what robots' joints do at random little stands",
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
        "rollout": {"starts": STARTS, "promote": 1.0, "latency": LATE},
        "fitness": {
            "speed": BRISK,
            "frequency": round(calm, 2),
            "weights": {"alive": ALIVE, "frequency": HASTY},
        },
    }


def judged_anew(generations: int, sigma: float) -> dict[str, Any]:
    """The table `[evolution]` of who meets other starts in each generation.

    Then only those compare that were judged together: parents die, but for some that are judged again
    and count by all their rounds. A best that is no better is no sign of a stall.
    """
    return {
        "generations": generations,
        "survival": "children",
        "elite": 0.125,
        "remember": True,
        "selection": "tournament",
        "rivals": 4,
        "mutation": "gaussian",
        "sigma": sigma,
        "forced": {"enabled": False},
    }
