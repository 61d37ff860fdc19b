"""Which starts and pushes: one draw to choose on, and each champion's own to be examined on.

A champion's draw follows from his fingerprint, which nobody knows before he is complete: evolution
cannot tune for it, and the same champion is examined on the same draw, whenever and by whomever.
"""

import dataclasses

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.starts import (
    Starts,
    perturbed_starts,
    pushed_starts,
    unfamiliar,
)

AIMS = 3
"""The purpose of what a task draws: goals."""
COMMANDS = 4
"""Of turns that are told."""
STEERED_FOR = 12.0
"""s, length of a simulation that is steered."""


@dataclasses.dataclass(frozen=True)
class Draw:
    """Where all draws of an examination come from; words: of the seed."""

    words: tuple[int, ...]

    def generator(self, purpose: int) -> np.random.Generator:
        """A source for each purpose: 0 starts, 1 pushes, 2 the ladder of larger pushes, `AIMS`,
        `COMMANDS`.
        """
        return np.random.default_rng([*self.words, purpose])


def common(config: CertificateConfig) -> Draw:
    """The one that is the same for all champions."""
    return Draw((config.seed,))


def own(champion: Champion, config: CertificateConfig) -> Draw:
    """The champion's."""
    return Draw((config.seed, int(champion.fingerprint, 16)))


def starts(creature: Creature, config: CertificateConfig, draw: Draw, count: int) -> Starts:
    """Those of criterion 4."""
    noise, rng = config.starts, draw.generator(0)
    familiar = perturbed_starts(
        creature, count, rng, noise.joints, noise.velocities, noise.friction, noise.masses
    )
    return unfamiliar(
        familiar,
        rng,
        gains=noise.gains,
        latency=noise.latency,
        slope=float(np.radians(noise.slope)),
        floor=noise.floor,
    )


def pushes(creature: Creature, config: CertificateConfig, draw: Draw, count: int) -> Starts:
    """Those of criterion 5."""
    speed = config.pushes.speed * _unit_speed(creature)
    return pushed_starts(creature, count, draw.generator(1), speed, config.pushes.window)


def ladder(creature: Creature, config: CertificateConfig, draw: Draw) -> list[Starts]:
    """The larger pushes, a group for each size, all within two seconds.

    None is watched for longer than it takes to fall.
    """
    settings, rng = config.pushes, draw.generator(2)
    begin, end = settings.window[0], min(settings.window[0] + 2.0, settings.window[1])
    watched = np.full(settings.ladder_count, end + settings.ladder_seconds)
    speeds = [size * _unit_speed(creature) for size in settings.ladder]
    return [
        dataclasses.replace(
            pushed_starts(creature, settings.ladder_count, rng, speed, (begin, end)), end=watched
        )
        for speed in speeds
    ]


def _unit_speed(creature: Creature) -> float:
    return float(np.sqrt(creature.gravity * creature.frame.hip_height))
