"""Controllers and tasks by name."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mjxgait.config.rollout import RolloutConfig
from mjxgait.config.schema import Config, UseConfig
from mjxgait.creature import Creature
from mjxgait.creature.settings import Termination
from mjxgait.errors import UserError, did_you_mean, not_loaded

if TYPE_CHECKING:  # JAX takes a second to import
    from mjxgait.controllers.base import Controller
    from mjxgait.creature.body import Body, Ends
    from mjxgait.tasks.base import Task

Maker = Callable[[], type]


def _poses() -> type:
    from mjxgait.controllers.key_poses.controller import PoseTracker

    return PoseTracker


def _walk() -> type:
    from mjxgait.tasks.walk.task import Walk

    return Walk


def _hop() -> type:
    from mjxgait.tasks.hop.task import Hop

    return Hop


def _limbo() -> type:
    from mjxgait.tasks.hop.limbo import Limbo

    return Limbo


def _travel() -> type:
    from mjxgait.tasks.hop.travel import Travel

    return Travel


def _programs() -> type:
    from mjxgait.controllers.expressions.controller import Programs

    return Programs


def _brains() -> type:
    from mjxgait.controllers.sims_brain.controller import Brains

    return Brains


def _swim() -> type:
    from mjxgait.tasks.modular.swim import Swim

    return Swim


def _roam() -> type:
    from mjxgait.tasks.modular.roam import Roam

    return Roam


def _jump() -> type:
    from mjxgait.tasks.modular.jump import Jump

    return Jump


def _follow() -> type:
    from mjxgait.tasks.modular.follow import FollowInWater

    return FollowInWater


def _follow_on_land() -> type:
    from mjxgait.tasks.modular.follow import FollowOnLand

    return FollowOnLand


SHIPPED: Mapping[str, Mapping[str, Maker]] = {
    "controller": {"poses": _poses, "program": _programs, "brain": _brains},
    "task": {
        "walk": _walk,
        "hop": _hop,
        "limbo": _limbo,
        "travel": _travel,
        "swim": _swim,
        "roam": _roam,
        "jump": _jump,
        "follow": _follow,
        "follow-on-land": _follow_on_land,
    },
}
"""By kind and name; the classes are imported when they are needed."""
OF_BODIES_THAT_GROW = {"walk": "roam"}
"""What a task of this name is to them: they have no strides."""

_OWN: dict[tuple[str, str], type] = {}


def add_own(kind: str, name: str, cls: type) -> None:
    """Makes a class of the user's known, for as long as the program runs."""
    _OWN[kind, name] = cls


def find(kind: str, name: str) -> type:
    """The class of a controller or a task.

    Raises:
      UserError: there is none of that name, or it is code that was not named on the command line.
    """
    if (kind, name) in _OWN:
        return _OWN[kind, name]
    if name in SHIPPED[kind]:
        return SHIPPED[kind][name]()
    if ":" in name:
        raise not_loaded(kind, name)
    raise UserError(f'there is no {kind} "{name}"; {did_you_mean(name, SHIPPED[kind])}')


def meant(use: UseConfig) -> UseConfig:
    """Who takes part, with the task that its name means to a body that grows.

    Raises:
      UserError: there is no such controller.
    """
    if not getattr(find("controller", use.controller), "grows", False):
        return use
    return dataclasses.replace(use, task=OF_BODIES_THAT_GROW.get(use.task, use.task))


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
