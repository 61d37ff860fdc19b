"""Controllers and tasks of a run, made from its settings."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from mjxgait.config.rollout import RolloutConfig
from mjxgait.config.schema import Config, UseConfig
from mjxgait.creature import Creature
from mjxgait.creature.settings import Termination
from mjxgait.kinds import controller_kind, meant_of_grown, task_kind

if TYPE_CHECKING:  # JAX takes a second to import
    from mjxgait.controllers.base import Controller
    from mjxgait.creature.body import Body, Ends
    from mjxgait.tasks.base import Task


def find(sort: str, name: str) -> type:
    """Return the class of a controller or a task. sort: "controller" or "task".

    Raises:
      UserError: there is none of that name, or it is code that was not named on the command line.
    """
    kind = controller_kind(name) if sort == "controller" else task_kind(name)
    found: type = kind.part(sort)
    return found


def meant(use: UseConfig) -> UseConfig:
    """Return what takes part, with the task that its name means to a body that grows.

    Raises:
      UserError: there is no such controller.
    """
    if not controller_kind(use.controller).grows:
        return use
    return dataclasses.replace(use, task=meant_of_grown(use.task))


def make_controller(body: "Body", step: float, config: Config) -> "Controller":
    """What moves the creature. step: s between two control steps."""
    kind: Any = find("controller", config.use.controller)
    added = getattr(find("task", config.use.task), "adds", ())
    # One whose genome depends on what there is to sense is told.
    told = getattr(kind, "told", None)
    made: Controller = told(body, step, config.controller, added) if told else kind(body, step)
    return made


def make_task(body: "Body", step: float, ends: "Termination | Ends", config: Config) -> "Task":
    """What the creature is to do. ends: what a fall is."""
    horizon = max(round(config.rollout.seconds / step), 1)
    kind: Any = find("task", config.use.task)
    # One whose tally depends on what is asked is told.
    told = getattr(kind, "told", None)
    made: Task = (
        told(body, step, horizon, ends, config.fitness) if told else kind(body, step, horizon, ends)
    )
    return made


def what_ends(creature: Creature, config: RolloutConfig) -> Termination:
    """What ends an episode: what the creature says, where the config says nothing else."""
    if not config.terminate:
        return Termination(min_up=-1.0, height=(-np.inf, np.inf), touch=False)
    given: dict[str, Any] = dataclasses.asdict(config.termination)
    return dataclasses.replace(
        creature.settings.termination, **{k: v for k, v in given.items() if v is not None}
    )
