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
    """Return the controller and the task, its name resolved for a body that grows.

    Raises:
      UserError: there is no such controller.
    """
    if not controller_kind(use.controller).grows:
        return use
    return dataclasses.replace(use, task=meant_of_grown(use.task))


def make_controller(body: "Body", step: float, config: Config) -> "Controller":
    """Return the creature's controller. step: s between two control steps."""
    kind: Any = find("controller", config.use.controller)
    added = getattr(find("task", config.use.task), "adds", ())
    # `told` passes settings and observations to controllers with a genome that depends on them.
    told = getattr(kind, "told", None)
    made: Controller = told(body, step, config.controller, added) if told else kind(body, step)
    return made


def make_task(body: "Body", step: float, ends: "Termination | Ends", config: Config) -> "Task":
    """Return the creature's task. ends: the termination conditions."""
    horizon = max(round(config.rollout.seconds / step), 1)
    kind: Any = find("task", config.use.task)
    # `told` passes the settings to tasks with episode statistics that depend on them.
    told = getattr(kind, "told", None)
    made: Task = (
        told(body, step, horizon, ends, config.fitness) if told else kind(body, step, horizon, ends)
    )
    return made


def what_ends(creature: Creature, config: RolloutConfig) -> Termination:
    """Return the termination conditions: the creature's, overridden by the config's."""
    if not config.terminate:
        return Termination(min_up=-1.0, height=(-np.inf, np.inf), touch=False)
    given: dict[str, Any] = dataclasses.asdict(config.termination)
    return dataclasses.replace(
        creature.settings.termination, **{k: v for k, v in given.items() if v is not None}
    )
