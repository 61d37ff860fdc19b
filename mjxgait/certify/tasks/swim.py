"""What is demanded of a swimmer: to get on, straight, as evolution said, by the water alone.

Letters: `T` frames.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certify.afloat import Afloat
from mjxgait.certify.config import CertificateConfig, SwimConfig
from mjxgait.certify.criteria import Criterion, Measure, at_least, at_most, joint_overrun, steady
from mjxgait.certify.describe import worst_overlap
from mjxgait.certify.measure import Recording
from mjxgait.certify.outcome import Fall, Outcome
from mjxgait.certify.starts import Starts
from mjxgait.certify.tasks.staying import StaysUp, to_the_end
from mjxgait.champion import Champion
from mjxgait.champion.blocks.material import DRAG
from mjxgait.creature import Creature


class SwimDemands(StaysUp):
    """See `Demands`. In water there is no up and no fall, and nobody who stands to push."""

    verdict = "it swims"
    drag = DRAG
    pushed = False

    def fall(self, config: CertificateConfig) -> Fall:
        """See `Demands`: never."""
        return Fall(min_up=-2.0, height=(-np.inf, np.inf), touch=False)

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: 2, 6, 8, 9, and 11, what moves it."""
        window, other = whole.window(config.warmup), halved.window(config.warmup)
        swims, repeated = (swims_on(each, config.swim) for each in (window, other))
        failed = sum(not m.passed for m in repeated.measures)
        change = abs(speed(other) / speed(window) - 1)
        halves = (
            at_most("failures in 2", failed, 0.0),
            at_most("change of speed", change, config.half_step.distance),
        )
        return (
            swims,
            Criterion(6, "half the time step", halves),
            machine(window, config),
            apart(window, config.swim),
            by_water(window, config.swim),
        )

    def kept(
        self, champion: Champion, whole: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: 10, as fast as evolution said, in as many seconds as it saw."""
        told = champion.terms.get("speed", np.nan)
        seen = champion.origin.get("nominal", {}).get("seconds", np.inf)
        change = abs(speed(whole.window(config.warmup, seen)) / told - 1) if told > 0 else np.nan
        return (Criterion(10, "as in evolution", (at_most("change", change, config.swim.again),)),)

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those that were fast enough from the start to the end."""
        seconds = outcome.path.shape[1] * outcome.trajectory.time_step
        way = np.linalg.norm(outcome.travel, axis=1)
        return outcome.stayed_up & (way >= config.swim.speed * seconds)

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: 4."""
        share = at_least("share that swims", started, config.swim.arrive, 1.0)
        return (Criterion(4, "perturbed starts", (share,)),)

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, Any]:
        """See `Demands`: how fast it swims, and of what it is."""
        window, water = whole.window(config.warmup), seen(whole)
        v, parts = speed(window), len(water.sizes)
        return {
            "speed": v,
            "parts": parts,
            "mass": whole.dimensions.mass,
            "overlap": worst_overlap(window),
            "summary": f"{parts} blocks, {v:.2f} m/s",
        }

    def promising(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> bool:
        """See `Demands`: to the end in all its trials, and clearly faster than it must be: so far in
        the seconds that count as it must get in all."""
        wanted = CertificateConfig().swim.speed * seconds
        lived = to_the_end(outcome, seconds, creature)
        return bool(lived.all() and (outcome["way"] >= wanted).all())


def swims_on(window: Recording, config: SwimConfig) -> Criterion:
    """2. It gets away from where it was, straight, and does not slow down."""
    middle = seen(window).middle
    half = len(middle) // 2
    first, second = (float(np.linalg.norm(way)) for way in _halves(middle, half))
    path = np.linalg.norm(np.diff(middle, axis=0), axis=1).sum()
    straight = np.linalg.norm(middle[-1] - middle[0]) / path if path > 0 else np.nan
    return Criterion(
        2,
        "swims",
        (
            at_least("speed (m/s)", speed(window), config.speed),
            at_least("way / path", straight, config.straight, 1.0),
            steady(first, second, config.second_half),
        ),
    )


def machine(window: Recording, config: CertificateConfig) -> Criterion:
    """8. No physics exploit: speeds, angles and torques of a machine that could exist."""
    limit = window.dimensions.torque_limit
    overrun, fastest = joint_overrun(window).max(), np.abs(window.joint_vel).max()
    return Criterion(
        8,
        "physics",
        (
            at_most("joint speed (rad/s)", fastest, config.physics.joint_speed),
            at_most("joint past its range (rad)", overrun, config.physics.joint_overrun),
            at_most("body speed (m/s)", window.body_speed.max(), config.swim.body_speed),
            Measure(
                "torque / limit",
                float((np.abs(window.torque) / limit).max()),
                "<=",
                config.physics.torque,
                0.0,
            ),
        ),
    )


def apart(window: Recording, config: SwimConfig) -> Criterion:
    """9. No block stands in another that it is not joined to, as it grew or by moving."""
    sizes = seen(window).sizes
    least = np.array([min(sizes[one], sizes[other]) for one, other in window.overlap_pairs])
    deepest = (window.overlap / least).max(initial=0.0)
    share = at_most("overlap / smaller block's size", deepest, config.overlap)
    return Criterion(9, "parts", (share,))


def by_water(window: Recording, config: SwimConfig) -> Criterion:
    """11. Its momentum is what the water gave: nothing else pushes it, and no error of a step."""
    water = seen(window)
    given = np.cumsum(water.push[:-1], axis=0) * window.time_step
    lacking = np.linalg.norm(water.momentum[1:] - water.momentum[0] - given, axis=1)
    exchanged = np.linalg.norm(water.push, axis=1).sum() * window.time_step
    share = lacking.max() / exchanged if exchanged > 0 else np.nan
    measure = at_most("momentum from elsewhere / exchanged", share, config.elsewhere)
    return Criterion(11, "by water alone", (measure,))


def speed(window: Recording) -> float:
    """m/s from the first frame to the last, as the crow flies."""
    middle = seen(window).middle
    return float(np.linalg.norm(middle[-1] - middle[0]) / ((len(middle) - 1) * window.time_step))


def seen(recording: Recording) -> Afloat:
    """What was seen of it in water."""
    assert recording.afloat is not None
    return recording.afloat


def _halves(middle: np.ndarray, half: int) -> tuple[np.ndarray, np.ndarray]:
    return middle[half] - middle[0], middle[-1] - middle[half]
