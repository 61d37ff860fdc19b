"""Whether a body can walk and be examined, before anything is evolved: strength, reach, shapes.

A prediction from statics and kinematics; it proves nothing. The thresholds are the certificate's.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import SHAPELESS
from mjxgait.certification.statics import REACHED, Load, Statics
from mjxgait.creature import Creature
from mjxgait.creature.textbook import Leg
from mjxgait.reference.measure import dimensions
from mjxgait.tasks.walk.gaits import stride_limit

DUTY = 0.5
"""Duty factor between walking and running, at which a stride is twice the way of a foot."""
CROUCHES = (0.0, 0.1)
"""Hip heights by which the trunk may be lower than standing."""
SIDEWAYS = 0.05
"""Weight of a foot's way to the side: legs that swing about an upright axis move it in an arc."""
GREATEST_REACH, HALVINGS = 1.0, 5
"""Greatest hip heights at which a foot's reach is tried, and steps of the search below."""
SPENT = 0.9
"""Share of the torque limit that a step may take; balance and swings need the rest.

Robots that walk take up to 0.85; a dog with 0.93 did not stay up (docs/research/models.md).
"""
Limit = tuple[str, str]
"""A sentence on what the body lacks, and one on the remedy."""


@dataclasses.dataclass(frozen=True)
class LegRoom:
    """What a leg can do.

    foot: its name. load: in a step. way, lift: hip heights that the foot moves to and fro, and up.
    touches: whether it stands on the floor in the standing pose.
    """

    foot: str
    load: Load
    way: float
    lift: float
    touches: bool


@dataclasses.dataclass(frozen=True)
class Feasibility:
    """What a body can do.

    rest: load in standing of joints that belong to no single leg. speed: body lengths/s that its
    longest strides give, as often as an animal of its mass may stride. legs: those with joints.
    shapeless: share of the mass of parts without a shape.
    """

    legs: tuple[LegRoom, ...]
    rest: Load
    speed: float
    shapeless: float
    config: CertificateConfig

    @property
    def stride(self) -> float:
        """Longest stride of the median leg in hip heights; infinite without legs."""
        if not self.legs:
            return np.inf
        return float(np.median([leg.way for leg in self.legs])) / DUTY

    @property
    def limits(self) -> list[Limit]:
        """What it lacks for a certified walk, the worst first; empty if it lacks nothing."""
        unseen = self._unseen()
        return [*self.walk_limits, *([unseen] if unseen else [])]

    @property
    def walk_limits(self) -> list[Limit]:
        """What it lacks for a walk, whether or not that can be examined."""
        found = (self._weak(), self._hanging(), self._short(), self._slow())
        return [limit for limit in found if limit is not None]

    def lines(self) -> list[str]:
        """Return a table of the legs, and a sentence on each limit."""
        rows = [
            ("leg", "torque in a step, of the limit", "to and fro", "up"),
            *(
                (leg.foot, _of_limit(leg.load), f"{leg.way:.2f}", f"{leg.lift:.2f}")
                for leg in self.legs
            ),
        ]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        table = [
            "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
            for row in rows
        ]
        found = ["what it can do (lengths in hip heights; a prediction):"] if self.legs else []
        found += table if self.legs else []
        if self.rest.joint:
            found.append(f"other joints, standing: {_of_limit(self.rest)}")
        if self.legs:
            found.append(
                f"longest stride {self.stride:.2f} hip heights, "
                f"fastest walk {self.speed:.1f} body lengths/s"
            )
        sentences = [" ".join(limit) for limit in self.limits]
        return found + (sentences or ["Strength, reach and strides are enough for a walk."])

    def _weak(self) -> Limit | None:
        loads = [leg.load for leg in self.legs if leg.load.share > SPENT]
        loads += [self.rest] if self.rest.share > 1 else []
        if not loads:
            return None
        worst = max(loads, key=lambda load: load.share)
        others = len({load.joint for load in loads} - {worst.joint})
        names = f'"{worst.joint}"' + (f" and {others} more are" if others else " is")
        lacks, needs = 1 - SPENT / worst.share, "a step takes at least"
        if worst is self.rest:
            lacks, needs = 1 - 1 / worst.share, "standing takes"
        return (
            f"{names} up to {lacks:.0%} too weak for its weight: {needs} {worst.needed:.3g} N·m, "
            f"{worst.share:.0%} of its limit.",
            "Raise `torque_limit` in creature.toml, or make the body lighter.",
        )

    def _hanging(self) -> Limit | None:
        names = [leg.foot for leg in self.legs if not leg.touches]
        if not names:
            return None
        return (
            f"In its standing pose {', '.join(names)} {'do' if len(names) > 1 else 'does'} not "
            "reach the floor.",
            "Edit the keyframe `stand` in creature.xml.",
        )

    def _short(self) -> Limit | None:
        least = self.config.gait.stride_length
        if self.stride >= least:
            return None
        return (
            f"Its feet move {DUTY * self.stride:.2f} hip heights to and fro, and a stride of "
            f"{least:g} needs {DUTY * least:g}.",
            "Widen `range` of the legs' joints in creature.toml.",
        )

    def _slow(self) -> Limit | None:
        least = self.config.progress.speed
        if self.speed >= least or self.stride < self.config.gait.stride_length:
            return None
        return (
            f"Its longest strides give {self.speed:.2f} body lengths/s, and {least:g} is needed.",
            "Widen `range` of the legs' joints in creature.toml.",
        )

    def _unseen(self) -> Limit | None:
        if self.shapeless <= SHAPELESS:
            return None
        return (
            f"Parts with {self.shapeless:.0%} of its mass have no shape, so that their overlap "
            f"cannot be examined; more than {SHAPELESS:.0%} is never certified.",
            "Import the model with its meshes, or add geoms in creature.xml.",
        )


def _of_limit(load: Load) -> str:
    return f"{load.share:.0%} ({load.joint})" if load.joint else "none"


def feasibility(creature: Creature) -> Feasibility:
    """Return what a body can do; it takes about half a second."""
    config, frame = CertificateConfig(), creature.frame
    legs = [Leg(creature, foot, SIDEWAYS) for foot in range(len(creature.feet.names))]
    statics = Statics(creature)
    quarter = 0.5 * DUTY * config.gait.stride_length * frame.hip_height
    rooms = tuple(
        LegRoom(
            creature.feet.names[foot],
            statics.in_a_step(leg, foot, (-quarter, 0.0, quarter)),
            _reached(leg, creature, (1.0, 0.0)) + _reached(leg, creature, (-1.0, 0.0)),
            _reached(leg, creature, (0.0, 1.0)),
            bool((statics.feet == foot).any()),
        )
        for foot, leg in enumerate(legs)
        if len(leg.joints)
    )
    own = [joint for leg in legs for joint in leg.joints]
    rest = statics.standing(np.setdiff1d(np.arange(len(creature.joints.names)), own))
    found = Feasibility(rooms, rest, np.inf, dimensions(creature).shapeless, config)
    if not rooms:
        return found
    speed = found.stride * frame.hip_height * stride_limit(frame.mass) / frame.body_length
    return dataclasses.replace(found, speed=float(speed))


def _reached(leg: Leg, creature: Creature, direction: Sequence[float]) -> float:
    """Hip heights that a foot can move in a direction (ahead, up), with some bend of the legs."""
    return max(_reached_at(leg, creature, direction, crouch) for crouch in CROUCHES)


def _reached_at(leg: Leg, creature: Creature, direction: Sequence[float], crouch: float) -> float:
    """See `_reached`; by bisection."""
    pose, hip = creature.joints.stand.copy(), creature.frame.hip_height

    def reaches(way: float) -> bool:
        path = (direction[0] * way * hip, direction[1] * way * hip)
        pose[leg.joints] = leg.reach(path, creature.joints.stand, crouch)
        return leg.missed(path, pose, crouch) <= REACHED

    low, high = 0.0, GREATEST_REACH
    if reaches(high):
        return high
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if reaches(middle) else (low, middle)
    return low
