"""What is demanded of who hops to a goal: to get there, whatever goal it is, and to stay."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certify.config import CertificateConfig, HopConfig
from mjxgait.certify.criteria import Criterion, at_least, at_most, parts, physics
from mjxgait.certify.describe import worst_overlap
from mjxgait.certify.measure import Recording
from mjxgait.certify.outcome import Fall, Outcome
from mjxgait.certify.starts import Starts
from mjxgait.creature import Creature

HIGHEST = 1e3
"""Standing heights: a trunk that hops may be anywhere, as long as no part of it lies."""


class HopDemands:
    """See `Demands`. It is not asked to bear pushes: in half of a hop nothing can be done."""

    verdict = "it gets to its goal and stays"

    def wanted(self, config: CertificateConfig) -> HopConfig:
        """The thresholds of this task."""
        return config.hop

    def fall(self, config: CertificateConfig) -> Fall:
        """See `Demands`: a head or an elbow on the floor, or a base on its edge."""
        return Fall(min_up=self.wanted(config).min_up, height=(0.0, HIGHEST), touch=True)

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """See `Demands`: a goal for each that has none yet."""
        wanted = self.wanted(config)
        drawn = wanted.nominal if rng is None else rng.uniform(*wanted.goals, len(starts))
        return dataclasses.replace(starts, goal=np.where(starts.goal > 0, starts.goal, drawn))

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: 1 and 2, both at half the time step too, 8, 9; from the first moment on."""
        basic, repeated = (self.basic(each, self.wanted(config)) for each in (whole, halved))
        failed = sum(not m.passed for c in repeated for m in c.measures)
        of = " and ".join(str(c.number) for c in basic)
        return (
            *basic,
            Criterion(6, "half the time step", (at_most(f"failures in {of}", failed, 0.0),)),
            physics(whole, config.physics),
            parts(whole, config.parts),
        )

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those that stayed up, arrived, and stayed there."""
        wanted = self.wanted(config)
        frames = frames_in(wanted.stay, outcome.trajectory.time_step)
        away = farthest(starts.goal[:, None] - outcome.path, starts.goal, frames)
        return outcome.stayed_up & (away <= wanted.near)

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: 4. The report has what pushes do."""
        share = at_least("share that arrives and stays", started, self.wanted(config).arrive, 1.0)
        return (Criterion(4, "perturbed starts and other goals", (share,)),)

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, Any]:
        """See `Demands`: how far off it ends, and since when it is there for good."""
        left = whole.goal - whole.trunk_pos[:, 0]
        outside = np.flatnonzero(~(np.abs(left) <= self.wanted(config).near * whole.goal))
        begins = outside[-1] + 1 if len(outside) else 0
        arrival = float(begins * whole.time_step) if begins < len(left) else None
        when = f"there from {arrival:.2f} s on" if arrival is not None else "not there"
        return {
            "goal": whole.goal,
            "left": float(left[-1]),
            "arrival": arrival,
            "overlap": worst_overlap(whole),
            "summary": f"{abs(left[-1]):.3f} m from a goal {whole.goal:g} m ahead, {when}",
        }

    def basic(self, whole: Recording, wanted: HopConfig) -> tuple[Criterion, ...]:
        """What one recording decides, at whatever time step: 1 and 2."""
        left = whole.goal - whole.trunk_pos[:, 0]
        frames = frames_in(wanted.stay, whole.time_step)
        away = farthest(left[None], np.array([whole.goal]), frames)[0]
        up = at_least("least upright", whole.trunk_up.min(), wanted.min_up, 1.0)
        lies = at_most("time on wrong parts", whole.touch.mean(), 0.0)
        there = at_most("farthest left / goal distance", away, wanted.near)
        return (Criterion(1, "stays up", (up, lies)), Criterion(2, "arrives and stays", (there,)))

    def promising(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> bool:
        """See `Demands`: up to the end in all its trials, and near enough to be near every goal."""
        # Half a step, for an episode lasts a whole number of them.
        whole = seconds - 0.5 * creature.model.opt.timestep
        demands = self.wanted(CertificateConfig())
        near = outcome["left"] <= demands.near * demands.goals[1]
        return bool((outcome["seconds"] > whole).all() and near.all())


def farthest(left: np.ndarray, goal: np.ndarray, frames: int) -> np.ndarray:
    """[S] farthest from the goal over the last frames, in goal distances; NaN where one is NaN.

    Args:
      left: [S, T] m. goal: [S] m.
    """
    last: np.ndarray = np.abs(left[:, -frames:]).max(1) / goal
    return last


def frames_in(seconds: float, time_step: float) -> int:
    """How many frames so much time is, at least one."""
    return max(round(seconds / time_step), 1)
