"""Common part of most tasks in the examination: disturbed bodies must stay up."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certification import criteria
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.reference.starts import Starts


class Unasked:
    """See `Demands`: for a task without targets.

    revision: see `Demands`.
    """

    revision: int = 0

    def asked(self, wish: Mapping[str, Any]) -> Any:
        """See `Demands`: the same."""
        return self

    def told(self, steps: int, time_step: float) -> np.ndarray | None:
        """See `Demands`: straight ahead."""
        return None

    def commands(
        self, config: CertificateConfig, steps: int, time_step: float, rng: np.random.Generator
    ) -> np.ndarray | None:
        """See `Demands`: none."""
        return None

    def obeyed(
        self, outcome: Outcome, told: np.ndarray, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: nothing was commanded."""
        return ()

    def lost(self, outcome: Outcome, starts: Starts, steps: int) -> np.ndarray:
        """See `Demands`: those that are down."""
        return ~outcome.stayed_up


class StaysUp(Unasked):
    """See `Demands`: criteria 4 and 5 for tasks with no goal but to be up at the end.

    drag, pushed, by_pushes, grown, leaps, worth: see `Demands`.
    """

    drag: float = 0.0
    pushed: bool = True
    by_pushes: bool = True
    grown: bool = False
    leaps: bool = False
    worth: float = 1.0

    def fall(self, config: CertificateConfig) -> Fall:
        """See `Demands`: as criterion 1 has it."""
        return config.upright

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """See `Demands`: as they are."""
        return starts

    def onward(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """See `Demands`: the same."""
        return goal

    def kept(
        self, champion: Champion, whole: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: evolution has promised nothing."""
        return ()

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those that have stayed up."""
        return outcome.stayed_up

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: 4 and 5."""
        return criteria.starts(started, config), criteria.pushes(pushed, config)


def to_the_end(outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature) -> np.ndarray:
    """Return a mask [R] of an individual's trials in evolution that lasted a whole episode."""
    # Half a step of tolerance: an episode lasts a whole number of steps.
    lasted: np.ndarray = outcome["seconds"] > seconds - 0.5 * creature.model.opt.timestep
    return lasted
