"""Draws of starts and pushes: a common one to choose by, and each champion's own to examine it.

A champion's draw follows from its fingerprint, which exists only once the champion is complete.
Evolution therefore cannot tune for it, and every examination of a champion uses the same draw.
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
"""Purpose of the draw of a task's goals."""
COMMANDS = 4
"""Purpose of the draw of commanded turns."""
STEERED_FOR = 12.0
"""s, length of a steered simulation."""


@dataclasses.dataclass(frozen=True)
class Draw:
    """Source of all draws of an examination. words: of the seed."""

    words: tuple[int, ...]

    def generator(self, purpose: int) -> np.random.Generator:
        """Return the generator for a purpose.

        0: starts. 1: pushes. 2: the ladder of larger pushes. Also `AIMS` and `COMMANDS`.
        """
        return np.random.default_rng([*self.words, purpose])


def common(config: CertificateConfig) -> Draw:
    """Return the draw shared by all champions."""
    return Draw((config.seed,))


def own(champion: Champion, config: CertificateConfig) -> Draw:
    """Return the champion's own draw."""
    return Draw((config.seed, int(champion.fingerprint, 16)))


def starts(creature: Creature, config: CertificateConfig, draw: Draw, count: int) -> Starts:
    """Draw the starts of criterion 4."""
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
    """Draw the pushes of criterion 5."""
    speed = config.pushes.speed * _unit_speed(creature)
    return pushed_starts(creature, count, draw.generator(1), speed, config.pushes.window)


def ladder(creature: Creature, config: CertificateConfig, draw: Draw) -> list[Starts]:
    """Draw the larger pushes, a group for each size, all within two seconds.

    Each is watched only for as long as a fall takes.
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
