"""Kinds of controllers and of tasks: one object for each, found by its name.

The `__init__.py` of a slice (a folder of `controllers/` or `tasks/`) lists its kinds. User-defined
code registers the same objects. Parts are imported on first use: the reference simulator must not
import JAX, and JAX takes a second to import.
"""

import dataclasses
import functools
import importlib
import pkgutil
from collections.abc import Mapping
from typing import Any, NoReturn, TypeVar

from mjxgait.errors import UserError, did_you_mean, not_loaded

Part = object
"""An object, or its location: `module:name` within the slice's folder."""


@dataclasses.dataclass(frozen=True)
class ControllerKind:
    """One kind of controller.

    name: as in the settings (`use.controller`).
    home: the slice's package.
    controller: the class that moves bodies in the compiled program, a `Controller`.
    reference: from creature, champion and step (s) to the reference controller in NumPy, a
    `ReferenceController`.
    opponent: the same for the body that a creature meets in a contest; None without contests.
    serializer: a `Serializer`; None writes the genome's arrays as they are.
    report: a `GenomeView`; None shows the arrays as they are.
    grows: whether a genome grows its own body.
    what: what it is, in a few words.
    """

    name: str
    home: str
    controller: Part
    reference: Part
    opponent: Part = None
    serializer: Part = None
    report: Part = None
    grows: bool = False
    what: str = ""

    def part(self, name: str) -> Any:
        """Return one of the parts, imported if necessary."""
        return _found(self.home, getattr(self, name))


@dataclasses.dataclass(frozen=True)
class TaskKind:
    """One kind of task.

    name: as in the settings (`use.task`).
    home: the slice's package.
    task: the class that is traced into the compiled program, a `Task`.
    criteria: the acceptance criteria, a `AcceptanceCriteria`.
    modular: whether it is only for bodies that grow.
    water: whether these bodies are in water; of a task with skills, in its first.
    skills: tasks of a body that does each on command, in the order of its effectors.
    called: the user's name for the task; one name may mean one task for a body from a model and
      another for one that grows.
    tables: tables of the certificate's settings that apply only to this task or related ones.
    what: what the creature is to do, in a few words.
    """

    name: str
    home: str
    task: Part
    criteria: Part
    modular: bool = False
    water: bool = False
    called: str = ""
    tables: tuple[str, ...] = ()
    skills: tuple[str, ...] = ()
    what: str = ""

    def part(self, name: str) -> Any:
        """Return one of the parts, imported if necessary."""
        return _found(self.home, getattr(self, name))


Kind = TypeVar("Kind", ControllerKind, TaskKind)
_OWN: dict[tuple[str, str], Any] = {}
"""User-defined kinds, by "controller" or "task" and name."""


def register(kind: ControllerKind | TaskKind) -> None:
    """Add a user-defined kind until the program ends."""
    sort = "controller" if isinstance(kind, ControllerKind) else "task"
    _OWN[sort, kind.name] = kind


@functools.cache
def controllers() -> Mapping[str, ControllerKind]:
    """Return the shipped kinds of controllers by name."""
    return _shipped("mjxgait.controllers")


@functools.cache
def tasks() -> Mapping[str, TaskKind]:
    """Return the shipped kinds of tasks by name."""
    return _shipped("mjxgait.tasks")


def shipped(sort: str) -> Mapping[str, ControllerKind | TaskKind]:
    """Return the shipped kinds. sort: "controller" or "task"."""
    return controllers() if sort == "controller" else tasks()


def known_controller(name: str) -> ControllerKind | None:
    """Return a kind of controller, shipped or user-defined; None if the name is unknown."""
    found: ControllerKind | None = _OWN.get(("controller", name)) or controllers().get(name)
    return found


def known_task(name: str) -> TaskKind | None:
    """Return a kind of task, shipped or user-defined; None if the name is unknown."""
    found: TaskKind | None = _OWN.get(("task", name)) or tasks().get(name)
    return found


def controller_kind(name: str) -> ControllerKind:
    """Return a kind of controller.

    Raises:
      UserError: the name is unknown, or it is code that was not named on the command line.
    """
    return known_controller(name) or _refuse("controller", name)


def task_kind(name: str) -> TaskKind:
    """Return a kind of task.

    Raises:
      UserError: the name is unknown, or it is code that was not named on the command line.
    """
    return known_task(name) or _refuse("task", name)


def in_water(task: str) -> bool:
    """Return whether a task takes place in water."""
    kind = known_task(task)
    return kind is not None and kind.water


def skills_of(task: str) -> tuple[str, ...]:
    """Return the tasks that a body does on command; empty for a single task."""
    kind = known_task(task)
    return kind.skills if kind else ()


def title_of(task: str) -> str:
    """Return the user's name for a task."""
    kind = known_task(task)
    return (kind.called or kind.name) if kind else task


def meant_of_grown(task: str) -> str:
    """Return the task that a name means for a body that grows."""
    called = {kind.called: kind.name for kind in tasks().values() if kind.called}
    return called.get(task, task)


def _refuse(sort: str, name: str) -> NoReturn:
    if ":" in name:
        raise not_loaded(sort, name)
    raise UserError(f'there is no {sort} "{name}"; {did_you_mean(name, shipped(sort))}')


def _shipped(package: str) -> Mapping[str, Any]:
    """Return the kinds of all slices of a package."""
    home = importlib.import_module(package)
    slices = [found.name for found in pkgutil.iter_modules(home.__path__) if found.ispkg]
    kinds = [k for name in slices for k in importlib.import_module(f"{package}.{name}").KINDS]
    return {kind.name: kind for kind in kinds}


def _found(home: str, part: Part) -> Any:
    if not isinstance(part, str):
        return part
    module, _, name = part.partition(":")
    return getattr(importlib.import_module(f"{home}.{module}"), name)
