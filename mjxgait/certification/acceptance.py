"""Acceptance criteria of a task: the protocol, and what most tasks share."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from mjxgait.certification import criteria
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import (
    Criterion,
    at_most,
    failures,
    parts,
    physics,
    speed,
    upright,
)
from mjxgait.certification.describe import worst_overlap
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.kinds import TaskKind, known_task, task_kind
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.reference.starts import Starts

Wish = Mapping[str, Any]
"""Requested targets by name, as in a champion's file; each task defines the types of its own."""


@dataclasses.dataclass(frozen=True, eq=False)
class Commands:
    """Demands that change on the way, for simulations of their own.

    seconds: length of each. heading: [S, T] rad, commanded; None without. lights: fields of
    `Starts`, by name, that set lights.
    """

    seconds: float
    heading: np.ndarray | None = None
    lights: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)

    def __len__(self) -> int:
        """Number of simulations."""
        each = self.lights["light"] if self.heading is None else self.heading
        return len(each)


class AcceptanceCriteria(Protocol):
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

    def with_targets(self, wish: Wish) -> "AcceptanceCriteria":
        """Return the criteria with those of the requested targets, by name."""
        ...

    def commanded_heading(self, steps: int, time_step: float) -> np.ndarray | None:
        """Commanded heading [T] in rad at each control step; None if none."""
        ...

    def commands(
        self, config: CertificateConfig, time_step: float, rng: np.random.Generator
    ) -> Commands | None:
        """Draw changing demands; None if the task has none."""
        ...

    def obeyed(
        self, outcome: Outcome, commands: Commands, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate how these were followed."""
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

    def next_goal(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Return the next goals, m ahead of the start.

        goal: current ones. first: those at the start. way: m of the trunk ahead of the start.
        """
        ...

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Mask [S] of simulations from perturbed starts that met the task's criteria."""
        ...

    def lost(
        self, outcome: Outcome, starts: Starts, steps: int, config: CertificateConfig
    ) -> np.ndarray:
        """Mask [S] of simulations that can no longer succeed after so many control steps."""
        ...

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criterion 4 and the others that disturbed simulations decide.

        started: share of the perturbed starts that succeeded. pushed: of the pushed that stayed up.
        """
        ...

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
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
    acceptance: AcceptanceCriteria,
    outcome: Mapping[str, np.ndarray],
    seconds: float,
    creature: Creature,
) -> bool:
    """Return True if an individual is worth validating; see `AcceptanceCriteria.managed`."""
    return bool(acceptance.managed(outcome, seconds, creature).mean() >= acceptance.worth)


class WithoutTargets:
    """`AcceptanceCriteria` of a task without targets, on land, with fixed goals.

    drag, pushed, by_pushes, grown, leaps, revision, worth: see `AcceptanceCriteria`.
    """

    drag: float = 0.0
    pushed: bool = True
    by_pushes: bool = True
    grown: bool = False
    leaps: bool = False
    revision: int = 0
    worth: float = 1.0

    def with_targets(self, wish: Wish) -> Any:
        """Return these criteria: targets add none."""
        return self

    def commanded_heading(self, steps: int, time_step: float) -> np.ndarray | None:
        """Command no heading: straight ahead."""
        return None

    def commands(
        self, config: CertificateConfig, time_step: float, rng: np.random.Generator
    ) -> Commands | None:
        """Return None."""
        return None

    def obeyed(
        self, outcome: Outcome, commands: Commands, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Return no criteria: nothing was commanded."""
        return ()

    def kept(
        self, champion: Champion, whole: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Return no criteria: evolution has promised nothing."""
        return ()

    def next_goal(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Keep the goals."""
        return goal

    def lost(
        self, outcome: Outcome, starts: Starts, steps: int, config: CertificateConfig
    ) -> np.ndarray:
        """Mask of the simulations that are down."""
        return ~outcome.stayed_up


class StaysUp(WithoutTargets):
    """Implementation of `AcceptanceCriteria`.

    Criteria 4 and 5 for tasks with no goal but to be up at the end.
    """

    def fall(self, config: CertificateConfig) -> Fall:
        """Return the conditions of criterion 1."""
        return config.upright

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """Return the starts unchanged."""
        return starts

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Mask of the simulations that stayed up."""
        return outcome.stayed_up

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criteria 4 and 5."""
        return criteria.starts(started, config), criteria.pushes(pushed, config)


def to_the_end(outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature) -> np.ndarray:
    """Return a mask [R] of an individual's trials in evolution that lasted a whole episode."""
    # Half a step of tolerance: an episode lasts a whole number of steps.
    lasted: np.ndarray = outcome["seconds"] > seconds - 0.5 * creature.model.opt.timestep
    return lasted


class HasCriteria(Protocol):
    """Task class with criteria of its own, such as `tasks.plain.PlainTask`."""

    @classmethod
    def criteria(cls, window: Recording) -> tuple[Criterion, ...]:
        """Return the task's own criteria, numbered from 10."""
        ...


class PlainCriteria(StaysUp):
    """Implementation of `AcceptanceCriteria`."""

    verdict = "it does what its task demands"

    def __init__(self, task: HasCriteria) -> None:
        self.task = task

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Stays up, at half the time step too; physics, parts, and its own."""
        window = whole.window(config.warmup)
        failed = failures(*self._basic(halved, config))
        return (
            *self._basic(whole, config),
            Criterion(
                6,
                "half the time step",
                (at_most("failures in criterion 1 and its own", failed, 0.0),),
            ),
            physics(window, config.physics),
            parts(window, config.parts),
        )

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
        """See `AcceptanceCriteria`."""
        window = whole.window(config.warmup)
        v = speed(window)
        return {"speed": v, "overlap": worst_overlap(window), "summary": f"{v:.2f} m/s"}

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """Whether the episode lasts to the end."""
        return to_the_end(outcome, seconds, creature)

    def _basic(self, whole: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        window = whole.window(config.warmup)
        return (upright(whole, window, config.upright), *self.task.criteria(window))


def acceptance_of(task: str, wish: Wish | None = None) -> AcceptanceCriteria:
    """Return the criteria of a task, with those of the requested targets.

    Raises:
      UserError: the task is user-defined code that was not named.
    """
    return _made(task_kind(task)).with_targets(wish or {})


def task_rules(task: str, wish: Wish | None = None) -> AcceptanceCriteria | StaysUp:
    """Return a task's goals, falls and turns for a simulation; the usual ones if it is unknown."""
    kind = known_task(task)
    return (_made(kind) if kind else StaysUp()).with_targets(wish or {})


@functools.cache
def _made(kind: TaskKind) -> AcceptanceCriteria:
    made: AcceptanceCriteria = kind.part("criteria")()
    return made
