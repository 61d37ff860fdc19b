"""Interface between the examiner and a task."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.reference.starts import Starts


class Demands(Protocol):
    """Acceptance criteria of one task; `StaysUp` implements the part on disturbed simulations."""

    verdict: str
    """Phrase for a champion that passes, such as `it walks`."""
    drag: float
    """Drag of the surrounding water, N·s/m³; 0 without water."""
    pushed: bool
    """True if pushes are simulated."""
    by_pushes: bool
    """True if the pushes are criterion 5; otherwise their result is only reported."""
    grown: bool
    """True for modular bodies; `Outcome.middle` is then recorded."""
    leaps: bool
    """True if `Outcome.low` is recorded."""
    revision: int
    """Number of changes to this task's criteria since schema 2 of the certificate."""
    worth: float
    """Least share of successful trials in evolution for an individual to be worth validating."""

    def asked(self, wish: Mapping[str, Any]) -> "Demands":
        """Return the criteria with those of the requested targets, by name."""
        ...

    def told(self, steps: int, time_step: float) -> np.ndarray | None:
        """Commanded heading [T] in rad at each control step; None if none."""
        ...

    def commands(
        self, config: CertificateConfig, steps: int, time_step: float, rng: np.random.Generator
    ) -> np.ndarray | None:
        """Headings [S, T] in rad to command in separate simulations; None without steering."""
        ...

    def obeyed(
        self, outcome: Outcome, told: np.ndarray, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate how these headings [S, T] were followed."""
        ...

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate the criteria of an undisturbed recording; `halved` had half the time step."""
        ...

    def kept(
        self, champion: Champion, whole: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Check that evolution's result for a champion holds here."""
        ...

    def fall(self, config: CertificateConfig) -> Fall:
        """Conditions of a fall, which ends a simulation."""
        ...

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """Return the starts, with what the task adds to those that lack it, such as a goal.

        rng: draws the addition; without `rng` it is nominal.
        """
        ...

    def onward(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Return the next goals, m ahead of the start.

        goal: current ones. first: those at the start. way: m of the trunk ahead of the start.
        """
        ...

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Mask [S] of simulations from perturbed starts that met the task's criteria."""
        ...

    def lost(self, outcome: Outcome, starts: Starts, steps: int) -> np.ndarray:
        """Mask [S] of simulations that can no longer succeed after so many control steps."""
        ...

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criterion 4 and the others that disturbed simulations decide.

        started: share of the perturbed starts that succeeded. pushed: of the pushed that stayed up.
        """
        ...

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, Any]:
        """Return numbers without a threshold; `summary` is a line for the screen."""
        ...

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """Mask [R] of an individual's trials in evolution that meet the criteria.

        Approximate: only what evolution measures counts. outcome: [R] values by name. seconds: of
        an episode.
        """
        ...


def promising(
    demands: Demands, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
) -> bool:
    """Return True if an individual is worth validating; see `Demands.managed`."""
    return bool(demands.managed(outcome, seconds, creature).mean() >= demands.worth)
