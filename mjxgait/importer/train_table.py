"""Table `[train]` of an imported creature: how a body of its class is evolved."""

import dataclasses
from typing import Any

from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.config import unhurried
from mjxgait.importer.notes import Confidence, Notes
from mjxgait.tasks.walk.config import WalkConfig
from mjxgait.tasks.walk.gaits import stride_limit, transition

STARTS, ALIVE = 6, 6.0
"""Evaluated trials, and weight of staying up to the end, of bodies that must step to catch a fall.
"""
LONG, FIRST = 12.0, 4
"""s, episode of a body on two feet: in the usual 8 s it speeds up and does not yet fall. Number of
individuals drawn for each of the first population: of fewer, some runs learn only to stand.
"""
LATE, HASTY = 1, 8.0
"""Largest torque delay in control steps, which is what first fells a robot in its examination.
Weight of a hasty stride frequency of bodies that must step, twice the default.
"""
BRISK = 1.2
"""Target speed of such a body in body lengths per second: slower, it has to stand on one foot."""
STRIDE = 0.7
"""Target stride length at that speed, in hip heights."""
LEAST = 0.5
"""Least stride length of the certificate in hip heights: a cycle of shorter strides is a buzz."""

LEAPING, RISES = 1.6, 8
"""Target hopping speed in body lengths per second of one-legged bodies, and hardening steps.

The rhythm is that of two-legged bodies. The disturbances grow in these steps as the body learns to
bear them. At the two-legged speed the hops are short, and with full disturbances at once it falls.
"""

WHIPPED = 4.0
"""Weight of swinging a foot too fast, in body lengths per √(g·h).

Most robots that fail a single criterion fail by the speed of their fastest part, a foot.
"""
LEAPS = 9.0
"""Weight of time in the air, three times the default, of bodies on more than two feet: those that
leap off all feet at once do not begin to walk, and late torques fell them.
"""
LENIENT = 1.0
"""Leniency with short walks of robots on more than two feet. Without it some only stand in all
generations, because a first short walk in bad style scores less.
"""
MANY = 6
"""Hinges per leg above which few random poses stand.

For such robots falling forward would otherwise score better than standing.
"""
GENERATIONS = 150
"""Largest number of generations, twice the default."""
SMALLER = 0.03
"""Mutation step as a share of a joint's range, half of that on four feet."""
ENOUGH = 0.1
"""Margin with which a run may end in its first half: these bodies are hasty, so few reach 0.2."""

CROSSED, NEAR = 12.0, 0.667
"""Weight of parts within each other, three times the default, of a character: its thick thighs,
tail and chest are close. Weight of distance on one foot or two: what a longer episode adds to it
must not outweigh them.
"""
SLIDES = 20.0
"""Weight of feet that slide, twice the default, of characters on more than two feet: on a floor
that gives at first touch a paw bears weight while it still moves.
"""
FLICKER, LEISURE = 3.0, 0.65
"""Weight of feet that lose the floor for moments, of characters on more than two feet: their mass
rests on small paws and hooves, which shake. And their target speed in body lengths per second: at
the usual one they gallop.
"""

Settings = dict[str, Any]
"""Tables of settings, as in creature.toml below `[train]`."""
Choice = tuple[str, Confidence, str]
"""The choice, its confidence and its reason."""


@dataclasses.dataclass(frozen=True)
class Traits:
    """What decides how a body is evolved.

    steps: whether it must step to catch a fall. legs, hinges: their numbers. hip: m, height.
    length: m, of the body. mass: kg. time_step: s. rotor: kg m², the inertia of its typical motor.
    skeleton: whether it was made from one.
    """

    steps: bool
    legs: int
    hinges: int
    symmetric: bool
    hip: float
    length: float
    mass: float
    time_step: float
    rotor: float
    skeleton: bool

    @property
    def bounces(self) -> bool:
        """Whether its motors are heavier to turn than all of it."""
        return self.rotor > self.mass * self.hip**2

    def steps_between_poses(self, speed: float) -> int:
        """Steps between poses that avoid too short or hasty strides at a speed in body lengths/s.

        An animal of this mass gallops sooner than it takes hastier ones. Heavy bodies would run at
        the shortest cycle.
        """
        shortest = max(LEAST * self.hip / (speed * self.length), 1 / transition(self.mass))
        return unhurried(shortest, self.time_step)


def train_table(body: Traits, notes: Notes) -> Settings:
    """Return the table `[train]` of an imported creature, and report its reason."""
    if body.steps:
        settings, choice = few_feet(body)
    elif body.hinges > MANY * body.legs:
        settings, choice = many_hinges(body)
    else:
        settings, choice = four_feet(body)
    if body.skeleton and body.steps:
        settings["fitness"]["weights"] |= {"overlap": CROSSED, "distance": NEAR}
        choice = (f"{choice[0]}; parts within each other cost", *choice[1:])
    elif body.skeleton:
        settings["fitness"]["speed"] = LEISURE
        settings["fitness"]["weights"] |= {"patter": FLICKER, "slip": SLIDES, "overlap": CROSSED}
        what = "feet that flicker or slide and parts within each other cost"
        choice = (f"{choice[0]}; {what}; {LEISURE:g} body lengths/s", *choice[1:])
    notes.guess("train", *choice)
    table: Settings = {"base": "other_starts", "examination": {"enough": ENOUGH}} | settings
    if not body.symmetric:
        table.setdefault("controller", {})["key_poses"] = 2 * Config().controller.key_poses
    return table


def four_feet(body: Traits) -> tuple[Settings, Choice]:
    """Settings of a body that stands on its feet.

    A foot of a body that bounces counts as down if it bears weight, because a foot near the floor
    need not. Other bodies learn more slowly with that rule.
    """
    fitness: Settings = {"weights": {"foot_speed": WHIPPED}}
    what = "other starts in each generation; small mutations; feet that swing too fast cost"
    why = "of what robots' joints do at random little stands, and much of it whips"
    settings: Settings = {"fitness": fitness}
    if body.bounces:
        fitness["contact"] = 0.0
        what += "; feet are down that bear weight"
        why += ": its motors are heavier to turn than all of it"
    else:
        fitness["weights"] |= {"fall": 1.0, "airborne": LEAPS}
        settings["rollout"] = {"latency": LATE}
        settings["evolution"] = {"initial_choice": FIRST}
        what += (
            f"; falls and leaps cost, torques come up to {LATE} step late; the best of "
            f"{FIRST} first individuals each"
        )
        if not body.skeleton:
            settings["controller"] = {"interpolation": body.steps_between_poses(WalkConfig().speed)}
            fitness["leniency"] = LENIENT
            what += "; style counts little in short walks"
            what += "; cycles no shorter than an animal's of its mass"
    return settings, (what, "high", why)


def many_hinges(body: Traits) -> tuple[Settings, Choice]:
    """Settings of a body that stands on its feet, but in few poses of many."""
    settings, (what, _, _) = four_feet(body)
    settings["fitness"]["weights"] |= {"alive": ALIVE, "frequency": HASTY}
    settings["controller"] = {"interpolation": body.steps_between_poses(WalkConfig().speed)}
    settings.setdefault("evolution", {})["sigma"] = SMALLER
    what += f"; smaller ones, no haste; staying up counts {ALIVE:g}"
    why = (
        f"with more than {MANY} hinges for each leg it falls in most poses, and learns to fall "
        "forward"
    )
    return settings, (what, "medium", why)


def few_feet(body: Traits) -> tuple[Settings, Choice]:
    """Settings of a body that must step to catch a fall."""
    hertz = BRISK * body.length / (STRIDE * body.hip)
    calm = min(WalkConfig().frequency, hertz / stride_limit(body.mass))
    weights = {"alive": ALIVE, "frequency": HASTY}
    fitness: Settings = {"speed": BRISK, "frequency": round(calm, 2), "weights": weights}
    speed = f"{BRISK:g} body lengths/s in strides of {STRIDE:g} hip heights"
    if body.legs == 1:
        fitness |= {"speed": LEAPING, "hardening": RISES}
        weights["airborne"] = 0.0
        speed = f"{LEAPING:g} body lengths/s, in the air for free; disturbances that grow"
    settings: Settings = {
        "controller": {"interpolation": body.steps_between_poses(BRISK)},
        # An undisturbed trial says little about robustness: evaluate all in all trials.
        "rollout": {
            "variety": GENERATIONS,
            "starts": STARTS,
            "promote": 1.0,
            "latency": LATE,
        },
        "evolution": {"generations": GENERATIONS, "sigma": SMALLER},
        "fitness": fitness,
    }
    if body.legs > 1:
        settings["rollout"]["seconds"] = LONG
        settings["evolution"]["initial_choice"] = FIRST
        speed += f", in episodes of {LONG:g} s"
    what = (
        f"{STARTS} starts, others in each of {GENERATIONS} generations at most, with "
        f"torques up to {LATE} step late; small mutations; staying up counts {ALIVE:g}, {speed}"
    )
    why = "on one foot or two it falls unless it walks: more disturbed starts, and to stay up first"
    return settings, (what, "medium", why)
