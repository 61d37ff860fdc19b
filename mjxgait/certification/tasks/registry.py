"""Acceptance criteria of a task by its name."""

import functools
from collections.abc import Mapping
from typing import Any

from mjxgait.certification.tasks.protocol import Demands
from mjxgait.certification.tasks.staying import StaysUp
from mjxgait.kinds import TaskKind, known_task, task_kind


def demands_of(task: str, wish: Mapping[str, Any] | None = None) -> Demands:
    """Return the criteria of a task, with those of the requested targets.

    Raises:
      UserError: the task is user-defined code that was not named.
    """
    return _made(task_kind(task)).asked(wish or {})


def how_simulated(task: str, wish: Mapping[str, Any] | None = None) -> Demands | StaysUp:
    """Return a task's goals, falls and turns for a simulation; the usual ones if it is unknown."""
    kind = known_task(task)
    return (_made(kind) if kind else StaysUp()).asked(wish or {})


@functools.cache
def _made(kind: TaskKind) -> Demands:
    made: Demands = kind.part("criteria")()
    return made
