"""What the examiner asks of a task."""

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
    """Criteria of one task; `StaysUp` has all of it that concerns disturbed simulations."""

    verdict: str
    """What one that passes does."""
    drag: float
    """Of the water around it, N·s/m³; 0 without."""
    pushed: bool
    """Whether it is tried what pushes do."""
    by_pushes: bool
    """Whether that decides: criterion 5. Else it is only told."""
    grown: bool
    """Whether it is for modular bodies; then `Outcome.middle` is recorded."""
    leaps: bool
    """Whether `Outcome.low` is recorded."""
    revision: int
    """How often the criteria of this task have changed since schema 2 of the certificate."""
    worth: float
    """Share of its trials in evolution that one must manage to be worth a look."""

    def asked(self, wish: Mapping[str, Any]) -> "Demands":
        """The demands where this was asked besides, by name."""
        ...

    def told(self, steps: int, time_step: float) -> np.ndarray | None:
        """[T] rad, the heading that the controller is told at each control step; None if none."""
        ...

    def commands(
        self, config: CertificateConfig, steps: int, time_step: float, rng: np.random.Generator
    ) -> np.ndarray | None:
        """[S, T] rad, headings to tell simulations of their own; None where nobody is steered."""
        ...

    def obeyed(
        self, outcome: Outcome, told: np.ndarray, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Whether these headings [S, T] were followed."""
        ...

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """What a recording decides that nobody has disturbed; `halved` had half the time step."""
        ...

    def kept(
        self, champion: Champion, whole: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Whether what evolution said of a champion holds here."""
        ...

    def fall(self, config: CertificateConfig) -> Fall:
        """When a simulation is down, and nobody looks at it any more."""
        ...

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """The starts with what the task adds to those that lack it, such as a goal.

        rng: draws it; without one it is the nominal.
        """
        ...

    def onward(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """The goals from the next moment on, m ahead of the start.

        goal: now. first: at the start. way: m of the trunk ahead of the start.
        """
        ...

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Which [S] of the simulations from perturbed starts did what the task demands."""
        ...

    def lost(self, outcome: Outcome, starts: Starts, steps: int) -> np.ndarray:
        """Which [S] cannot succeed any more, after so many of their control steps."""
        ...

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Criterion 4 and what else disturbed simulations decide.

        started: share of the perturbed starts that succeeded. pushed: of the pushed that stayed up.
        """
        ...

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, Any]:
        """Numbers without a threshold; `summary` is a line for the screen."""
        ...

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """In which [R] of its trials in evolution, with these outcomes [R], an individual did what
        is demanded, as far as evolution can tell.

        seconds: of an episode.
        """
        ...


def promising(
    demands: Demands, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
) -> bool:
    """Whether an individual is worth a look; see `Demands.managed`."""
    return bool(demands.managed(outcome, seconds, creature).mean() >= demands.worth)
