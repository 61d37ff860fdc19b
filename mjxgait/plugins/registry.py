"""Controllers and tasks of a run: found by name, and configured."""

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mjxgait.config import layers
from mjxgait.config.schema import Config, RolloutConfig, UseConfig
from mjxgait.config.tables import STRICT, Table, build, not_none
from mjxgait.creature import Creature
from mjxgait.creature.settings import Termination
from mjxgait.kinds import controller_kind, meant_of_grown, task_kind

if TYPE_CHECKING:
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
    kind = find("controller", config.use.controller)
    added = getattr(find("task", config.use.task), "adds", ())
    # For controllers with a genome that depends on settings and observations.
    make = getattr(kind, "with_settings", None)
    made: Controller = make(body, step, config.controller, added) if make else kind(body, step)
    return made


def make_task(body: "Body", step: float, ends: "Termination | Ends", config: Config) -> "Task":
    """Return the creature's task. ends: the termination conditions."""
    horizon = max(round(config.rollout.seconds / step), 1)
    kind = find("task", config.use.task)
    # For tasks with episode statistics that depend on the settings.
    make = getattr(kind, "with_settings", None)
    given = (body, step, horizon, ends)
    made: Task = make(*given, config.fitness) if make else kind(*given)
    return made


def task_of(creature: Creature, config: Config) -> "Task":
    """Return the task of a run of this creature."""
    step, ends = float(creature.model.opt.timestep), what_ends(creature, config.rollout)
    return make_task(creature, step, ends, config)


def what_ends(creature: Creature, config: RolloutConfig) -> Termination:
    """Return the termination conditions: the creature's, overridden by the config's."""
    if not config.terminate:
        return Termination(min_up=-1.0, height=(-np.inf, np.inf), touch=False)
    own = not_none(**dataclasses.asdict(config.termination))
    return dataclasses.replace(creature.settings.termination, **own)


def config_class(use: UseConfig) -> type[Config]:
    """`Config` with the tables `[controller]` and `[fitness]` of this controller and this task."""
    own = {
        table: find(kind, name).Settings  # type: ignore[attr-defined]
        for table, kind, name in (
            ("controller", "controller", use.controller),
            ("fitness", "task", use.task),
        )
        if name != getattr(UseConfig(), kind)
    }
    return _config_class(tuple(sorted(own.items()))) if own else Config


@functools.cache
def _config_class(tables: tuple[tuple[str, type], ...]) -> type[Config]:
    from mjxgait.config.traced import register

    fields = [
        (name, settings, dataclasses.field(default_factory=settings)) for name, settings in tables
    ]
    made = dataclasses.make_dataclass(
        "Config",
        fields,
        bases=(Config,),
        frozen=True,
        namespace={"__pydantic_config__": STRICT, "__doc__": Config.__doc__},
    )
    register(made)
    return made


def build_config(table: Table, where: str) -> Config:
    """Return the config of a table, with the settings of the controller and the task it names.

    Raises:
      UserError: names the key; or the code that must be named on the command line.
    """
    use = meant(build(UseConfig, table.get("use", {}), f"{where}: [use]"))
    return build(config_class(use), {**table, "use": dataclasses.asdict(use)}, where)


def resolve_config(
    creature_table: Table,
    creature_name: str,
    file: Path | None = None,
    use: Mapping[str, str] | None = None,
) -> Config:
    """See `layers.resolve_config`."""
    return layers.resolve_config(creature_table, creature_name, file, use, config_class, meant)
