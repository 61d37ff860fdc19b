"""Environments of a creature, for algorithms that are not this program's."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mjxgait.api.make import load_creature, used
from mjxgait.api.run import Place
from mjxgait.config.tables import Table, build, merge
from mjxgait.creature import Creature
from mjxgait.files import path_of

if TYPE_CHECKING:  # they lead to JAX
    from mjxgait.environments.functional import Environment
    from mjxgait.environments.problem import Problem


def environment(
    creature: Place | Creature = "tall_quadruped",
    task: str | None = None,
    *,
    config: Place | None = None,
    settings: Table | None = None,
    observe: Sequence[str] = (),
    perturbed: bool = True,
) -> "Environment":
    """Return a functional environment in JAX: pure `reset(key)` and `step(state, action)`.

    See docs/guide/research-tools.md for observations, actions, reward and the end of an episode.

    Args:
      creature: shipped creature, creature folder, model file, or a loaded one.
      task: a shipped name, or FILE.py:CLASS of your own; by default the creature's usual task.
      config: as for `train`.
      settings: as for `train`.
      observe: names of observations (docs/reference/controller.md).
      perturbed: False begins every episode alike, undisturbed.

    Raises:
      UserError: an invalid argument, or a body that grows, explained in one sentence.
    """
    from mjxgait.environments.functional import make_environment

    return make_environment(problem_of(creature, task, config, settings, observe, perturbed))


def problem_of(
    creature: Place | Creature,
    task: str | None = None,
    config: Place | None = None,
    settings: Table | None = None,
    observe: Sequence[str] = (),
    perturbed: bool = True,
) -> "Problem":
    """Return what an environment poses; see `environment`."""
    from mjxgait.environments.problem import make_problem
    from mjxgait.tasks.walk.targets import WalkTargets, configured

    use = used(task=task)
    body = creature if isinstance(creature, Creature) else load_creature(creature)
    resolved = configured(body, path_of(config) if config else None, use, WalkTargets())
    table = merge(dataclasses.asdict(resolved), settings or {})
    chosen = build(type(resolved), table, "the settings of the environment")
    return make_problem(body, chosen, tuple(observe), perturbed)
