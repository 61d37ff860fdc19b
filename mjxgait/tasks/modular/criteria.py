"""Acceptance criteria for modular bodies: swim, roam, jump, within physical limits.

Letters: `T` frames, `P` spans of time.
"""

import abc
from collections.abc import Mapping

import numpy as np
from typing_extensions import override

from mjxgait.certification.acceptance import StaysUp, to_the_end
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import (
    Criterion,
    at_least,
    at_most,
    failures,
    machine,
    steady,
)
from mjxgait.certification.describe import vibration, worst_overlap
from mjxgait.champion import Champion
from mjxgait.controllers.sims_brain.reference_body import DRAG
from mjxgait.creature import Creature
from mjxgait.reference.grown import Grown
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.modular.thresholds import (
    BlocksThresholds,
    GoingThresholds,
    JumpThresholds,
    RoamThresholds,
    SwimThresholds,
)

UNITS = {"speed": "m/s", "height": "m", "share": ""}


class ModularCriteria(StaysUp, abc.ABC):
    """Implementation of `AcceptanceCriteria`.

    These bodies have no upright pose, so there are no falls and no pushes.
    """

    pushed = by_pushes = False
    grown = True
    revision = 2
    """1: criterion 4 no longer measures the root from the first moment on, nor one leap of jumpers.
    2: a far end in the next block counts in criterion 9.
    """
    verb: str
    """Verb for what a passing body does."""
    promised: str
    """Fitness term that states the performance in evolution."""
    repeats = True
    """Whether the performance at half the time step must be nearly the same, not only enough."""
    evidence = "way"
    """Metric of a trial in evolution that shows the performance."""

    @abc.abstractmethod
    def wanted(self, config: CertificateConfig) -> BlocksThresholds:
        """Thresholds of this task."""

    @abc.abstractmethod
    def second(self, window: Recording, config: CertificateConfig) -> Criterion:
        """Criterion 2: the task itself."""

    @abc.abstractmethod
    def done(self, window: Recording) -> float:
        """Performance in the recording, in the unit of the promised term."""

    def promise(self, champion: Champion, seconds: float, config: CertificateConfig) -> float:
        """Performance that evolution reported for a trial of so many seconds."""
        return champion.terms.get(self.promised, np.nan)

    @abc.abstractmethod
    def enough(self, seconds: float, config: CertificateConfig) -> float:
        """Least `evidence` in a trial of so many seconds, clearly above the threshold."""

    def since(self, champion: Champion, config: CertificateConfig) -> float:
        """Time in s from which evolution counted the performance."""
        return config.warmup

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """No early end, and clearly more than required."""
        lived = to_the_end(outcome, seconds, creature)
        enough: np.ndarray = outcome[self.evidence] >= self.enough(seconds, CertificateConfig())
        return lived & enough

    def alone(self, window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """Criteria of this task alone."""
        return ()

    def fall(self, config: CertificateConfig) -> Fall:
        """Return conditions that are never met."""
        return Fall(min_up=-2.0, height=(-np.inf, np.inf), touch=False)

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criteria 2, 6, 8, 9, and the task's own."""
        window, other = whole.window(config.warmup), halved.window(config.warmup)
        does, repeated = (self.second(each, config) for each in (window, other))
        halves = [at_most("failures in 2", failures(repeated), 0.0)]
        if self.repeats:
            done, halved_done = self.done(window), self.done(other)
            change = abs(halved_done / done - 1) if done else np.inf
            halves.append(at_most("change", change, config.half_step.distance))
        wanted = self.wanted(config)
        fastest = at_most("body speed (m/s)", window.body_speed.max(), wanted.body_speed)
        return (
            does,
            Criterion(6, "half the time step", tuple(halves)),
            machine(window, config.physics, fastest),
            apart(window, wanted, on_land=not self.drag),
            *self.alone(window, config),
        )

    def kept(
        self, champion: Champion, whole: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Return criterion 10: the performance of evolution again, over the same number of seconds.

        It fails if the episode ended before anything counted.
        """
        seconds = in_trial(champion, "seconds", np.inf)
        promised = self.promise(champion, seconds, config)
        window = whole.window(self.since(champion, config), seconds)
        done = self.done(window) if len(window.trunk_pos) > 1 else np.nan
        change = abs(done / promised - 1) if promised > 0 else np.nan
        again = at_most("change", change, self.wanted(config).again)
        return (Criterion(10, "as in evolution", (again,)),)

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criterion 4."""
        share = at_least(f"share that {self.verb}", started, self.wanted(config).arrive, 1.0)
        return (Criterion(4, "perturbed starts", (share,)),)

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
        """The performance, and the body."""
        window = whole.window(config.warmup)
        done, parts, unit = self.done(window), len(seen(whole).sizes), UNITS[self.promised]
        return {
            self.promised: done,
            "parts": parts,
            "mass": whole.dimensions.mass,
            "overlap": worst_overlap(window),
            "summary": f"{parts} blocks, {done:.2f} {unit}",
        }


class GoingCriteria(ModularCriteria):
    """Implementation of `ModularCriteria`: motion in a straight line at a speed."""

    promised = "speed"
    axes = 3
    """Number of world axes along which distance counts: two if height does not."""

    @abc.abstractmethod
    @override
    def wanted(self, config: CertificateConfig) -> GoingThresholds: ...

    @override
    def second(self, window: Recording, config: CertificateConfig) -> Criterion:
        return gets_on(self.verb, self._middle(window), window.time_step, self.wanted(config))

    def done(self, window: Recording) -> float:
        """Speed in m/s."""
        return float(flight(self._middle(window), window.time_step))

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Simulations as fast as criterion 2 requires, measured in the same way."""
        middle = counted(outcome.middle, outcome, config)[..., : self.axes]
        fast = flight(middle, outcome.trajectory.time_step) >= self.wanted(config).speed
        return outcome.stayed_up & fast

    def enough(self, seconds: float, config: CertificateConfig) -> float:
        """The distance in m due in all seconds, within those that count."""
        return self.wanted(config).speed * seconds

    def _middle(self, window: Recording) -> np.ndarray:
        return seen(window).middle[:, : self.axes]


def gets_on(name: str, middle: np.ndarray, time_step: float, config: GoingThresholds) -> Criterion:
    """2. The body moves away, straight, and does not slow down; middle: [T, 2 or 3] m."""
    half = len(middle) // 2
    first, second = (
        float(np.linalg.norm(way)) for way in (middle[half] - middle[0], middle[-1] - middle[half])
    )
    path = np.linalg.norm(np.diff(middle, axis=0), axis=1).sum()
    straight = np.linalg.norm(middle[-1] - middle[0]) / path if path > 0 else np.nan
    return Criterion(
        2,
        name,
        (
            at_least("speed (m/s)", float(flight(middle, time_step)), config.speed),
            at_least("way / path", straight, config.straight, 1.0),
            steady("second half / first half", first, second, config.second_half),
        ),
    )


def apart(window: Recording, config: BlocksThresholds, on_land: bool) -> Criterion:
    """9. No block is in another that it is not joined to, nor in the ground, nor folded through.

    Overlaps count whether they come from growth or from motion. A block may bend into the one that
    it turns on until its far end meets it.
    """
    sizes = seen(window).sizes
    least = np.array([min(sizes[one], sizes[other]) for one, other in window.overlap_pairs])
    deepest = (window.overlap / least).max(initial=0.0)
    folded = seen(window).folded.max()
    inside = [
        at_most("overlap / smaller block's size", deepest, config.overlap),
        at_most("far end in the next block / size", folded, config.overlap),
    ]
    if on_land:
        buried = seen(window).buried.max()
        inside.append(at_most("depth in the ground / block's size", buried, config.overlap))
    return Criterion(9, "parts", tuple(inside))


def flight(middle: np.ndarray, time_step: float) -> np.ndarray:
    """Straight-line speed [...] in m/s over all frames; middle: [..., T, 2 or 3] m."""
    way = np.linalg.norm(middle[..., -1, :] - middle[..., 0, :], axis=-1)
    speed: np.ndarray = way / ((middle.shape[-2] - 1) * time_step)
    return speed


def counted(frames: np.ndarray, outcome: Outcome, config: CertificateConfig) -> np.ndarray:
    """Frames [S, T, ...] of disturbed simulations after the warm-up."""
    return frames[:, round(config.warmup / outcome.trajectory.time_step) :]


def in_trial(champion: Champion, metric: str, without: float = np.nan) -> float:
    """Metric of the champion's undisturbed trial in evolution. without: where it has none."""
    return float(champion.origin.get("nominal", {}).get(metric, without))


def seen(recording: Recording) -> Grown:
    """Recorded data of a modular body."""
    assert recording.grown is not None
    return recording.grown


class SwimCriteria(GoingCriteria):
    """Implementation of `AcceptanceCriteria`. In water there is no up."""

    verdict = "it swims"
    verb = "swims"
    drag = DRAG

    @override
    def wanted(self, config: CertificateConfig) -> SwimThresholds:
        return config.swim

    def alone(self, window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """Evaluate criterion 11, the source of the momentum."""
        return (by_water(window, config.swim),)


def by_water(window: Recording, config: SwimThresholds) -> Criterion:
    """11. All momentum comes from the water: not from elsewhere, nor from the error of a step."""
    water = seen(window)
    given = np.cumsum(water.push[:-1], axis=0) * window.time_step
    lacking = np.linalg.norm(water.momentum[1:] - water.momentum[0] - given, axis=1)
    exchanged = np.linalg.norm(water.push, axis=1).sum() * window.time_step
    share = lacking.max() / exchanged if exchanged > 0 else np.nan
    measure = at_most("momentum from elsewhere / exchanged", share, config.elsewhere)
    return Criterion(11, "by water alone", (measure,))


class RoamCriteria(GoingCriteria):
    """Implementation of `AcceptanceCriteria`.

    Only level distance counts: leaping up gains nothing.
    """

    verdict = "it walks"
    verb = "walks"
    axes = 2
    revision = 3
    """2: criterion 7 was added. 3: as 2 of all modular bodies."""

    @override
    def wanted(self, config: CertificateConfig) -> RoamThresholds:
        return config.roam

    def alone(self, window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """Evaluate criteria 1 and 7."""
        return on_land(window, config)


def on_land(window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
    """Evaluate the criteria of walking alone: 1, and 7, no motion by vibration."""
    return (balanced(window, config.roam), unshaken(window, config))


def unshaken(window: Recording, config: CertificateConfig) -> Criterion:
    """7. No motion by vibration."""
    return Criterion(7, "gait", (vibration(window, config.gait),))


def balanced(window: Recording, config: RoamThresholds) -> Criterion:
    """1. The body does not tip over from its settled attitude."""
    up = np.stack([-np.sin(window.pitch), np.sin(window.roll), window.trunk_up], axis=1)
    upright = (up @ up[0]).min()
    return Criterion(1, "balance", (at_least("least upright", upright, config.min_up, 1.0),))


SPAN = 2.0
"""Length of a span in s; the body must jump in each. A single highest leap is chance."""


class JumpCriteria(ModularCriteria):
    """Implementation of `AcceptanceCriteria`.

    It jumps again and again, from perturbed starts too.
    """

    verdict = "it jumps"
    verb = "jumps"
    promised = evidence = "height"
    leaps = True

    @override
    def wanted(self, config: CertificateConfig) -> JumpThresholds:
        return config.jump

    @override
    def second(self, window: Recording, config: CertificateConfig) -> Criterion:
        height = at_least("height of the lowest part (m)", self.done(window), config.jump.height)
        return Criterion(2, "jumps", (height,))

    def done(self, window: Recording) -> float:
        """Height in m of the lowest part at the best moment, mean of the spans."""
        return float(np.mean(highest(seen(window).low, window.time_step)))

    def promise(self, champion: Champion, seconds: float, config: CertificateConfig) -> float:
        """For the undisturbed trial, not for all."""
        return in_trial(champion, "height")

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Simulations with a high enough leap in the median span."""
        low = counted(outcome.low, outcome, config)
        middling = np.median(highest(low, outcome.trajectory.time_step), axis=-1)
        return outcome.stayed_up & (middling >= config.jump.height)

    def enough(self, seconds: float, config: CertificateConfig) -> float:
        """Height in m, a tenth above the threshold."""
        return 1.1 * config.jump.height


def highest(low: np.ndarray, time_step: float) -> np.ndarray:
    """Greatest height [..., P] in m of the lowest part in each span; low: [..., T] m."""
    count = max(round(low.shape[-1] * time_step / SPAN), 1)
    spans = np.array_split(low, count, axis=-1)
    return np.stack([np.maximum(span.max(axis=-1), 0.0) for span in spans], axis=-1)
