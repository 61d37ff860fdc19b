"""How a body of its class is to be evolved: settings that differ from those of a dog."""

from typing import Any

from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.config import unhurried
from mjxgait.importer.notes import Confidence, Notes
from mjxgait.tasks.walk.config import WalkConfig
from mjxgait.tasks.walk.gaits import stride_limit

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
MANY = 6
"""Hinges for each leg; of whom has more few random poses stand, and to fall ahead is worth more than to stay."""
GENERATIONS = 150
"""Most of them, twice as many as usual."""
SMALLER = 0.03
"""Step of a mutation, as a share of a joint's range: half of that on four feet."""
ENOUGH = 0.1
"""Margin with which a run may end in its first half; hasty as they all are, few ever get to 0.2."""

Told = tuple[str, Confidence, str]
"""What was chosen, how sure it is, and why."""


def manner(
    steps: bool,
    legs: int,
    hinges: int,
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
      steps: whether it must step under its fall. legs, hinges: how many. hip: m, its height. length: m, of the body.
      mass: kg. time_step: s. rotor: kg m², the inertia of its usual motor.
    """
    bounces = rotor > mass * hip**2
    if steps:
        settings, told = few_feet(legs, hip, length, mass, time_step)
    elif hinges > MANY * legs:
        settings, told = many_hinges(bounces, hip, length, time_step)
    else:
        settings, told = four_feet(bounces)
    notes.guess("train", *told)
    table = {"base": "other_starts", "examination": {"enough": ENOUGH}} | settings
    if not symmetric:
        table.setdefault("controller", {})["key_poses"] = 2 * Config().controller.key_poses
    return table


def four_feet(bounces: bool) -> tuple[dict[str, Any], Told]:
    """What is different for who stands on its feet; see `manner`. bounces: then what is near the
    floor need not bear weight, which others learn more slowly by.
    """
    fitness: dict[str, Any] = {"weights": {"foot_speed": WHIPPED}}
    what = "other starts in each generation; small mutations; feet that swing too fast cost"
    why = "of what robots' joints do at random little stands, and much of it whips"
    if bounces:
        fitness["contact"] = 0.0
        what += "; feet are down that bear weight"
        why += ": its motors are heavier to turn than all of it"
    return {"fitness": fitness}, (what, "high", why)


def many_hinges(
    bounces: bool, hip: float, length: float, time_step: float
) -> tuple[dict[str, Any], Told]:
    """What is different for who stands on its feet, but in few poses of many; see `manner`."""
    settings, (what, _, _) = four_feet(bounces)
    settings["fitness"]["weights"] |= {"alive": ALIVE, "frequency": HASTY}
    settings["controller"] = {
        "interpolation": _unhurried(WalkConfig().speed, hip, length, time_step)
    }
    settings["evolution"] = {"sigma": SMALLER}
    what += f"; smaller ones, no haste; staying up counts {ALIVE:g}"
    why = f"with more than {MANY} hinges for each leg it falls in most poses, and learns to fall ahead"
    return settings, (what, "medium", why)


def few_feet(
    legs: int, hip: float, length: float, mass: float, time_step: float
) -> tuple[dict[str, Any], Told]:
    """What is different for who steps under its fall; see `manner`."""
    hertz = BRISK * length / (STRIDE * hip)
    calm = min(WalkConfig().frequency, hertz / stride_limit(mass))
    weights = {"alive": ALIVE, "frequency": HASTY}
    fitness: dict[str, Any] = {"speed": BRISK, "frequency": round(calm, 2), "weights": weights}
    speed = f"{BRISK:g} body lengths/s in strides of {STRIDE:g} hip heights"
    if legs == 1:
        fitness |= {"speed": LEAPING, "hardening": RISES}
        weights["airborne"] = 0.0
        speed = f"{LEAPING:g} body lengths/s, in the air for free; disturbances that grow"
    settings = {
        "controller": {"interpolation": _unhurried(BRISK, hip, length, time_step)},
        # Undisturbed it tells little about who bears something: all are tried in all starts.
        "rollout": {"variety": GENERATIONS, "starts": STARTS, "promote": 1.0, "latency": LATE},
        "evolution": {"generations": GENERATIONS, "sigma": SMALLER},
        "fitness": fitness,
    }
    what = (
        f"{STARTS} starts, others in each of {GENERATIONS} generations at most, with torques up to {LATE} "
        f"step late; small mutations; staying up counts {ALIVE:g}, {speed}"
    )
    why = "on one foot or two it falls unless it walks: more disturbed starts, and first of all to stay up"
    return settings, (what, "medium", why)


def _unhurried(speed: float, hip: float, length: float, time_step: float) -> int:
    """Steps between poses with which no cycle leads through strides that are too short at this
    speed, in body lengths per second.
    """
    return unhurried(LEAST * hip / (speed * length), time_step)
