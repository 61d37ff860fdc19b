"""Everything that is shipped and every way to train it, read from the files and the registries.

A new creature, task, configuration, style, study, subcommand, benchmark or script is found here
automatically; its end-to-end test fails until it works.
"""

import dataclasses
import functools
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from mjxgait.config.layers import data_folder, over_base, shipped_configs, shipped_creatures
from mjxgait.config.schema import UseConfig
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.scale import at_step
from mjxgait.errors import UserError
from mjxgait.kinds import skills_of, tasks
from mjxgait.plugins import resolve_config
from mjxgait.plugins.fit import check_fit
from mjxgait.plugins.registry import find
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.walk.gaits import GAITS

ROOT = Path(__file__).parents[2]
CREATURES, CONFIGS = shipped_creatures(), shipped_configs()
TASKS = [name for name, kind in tasks().items() if not kind.called]
"""Task names as a user types them."""
SMALLEST_WALKER = "short_quadruped"
WITH_GAITS = (SMALLEST_WALKER, "crab", "duck")
"""A creature on four, six and two feet."""
STYLES = sorted(path.stem for path in (data_folder("configs") / "styles").glob("*.toml"))
STUDIES = sorted(path.stem for path in (data_folder("configs") / "ablations").glob("*.toml"))
BENCHMARKS = sorted(path.name for path in (ROOT / "benchmarks").glob("*.py"))
SCRIPTS = sorted(path.name for path in (ROOT / "scripts").glob("*.py"))

TINY = (
    *("--population", "4", "--generations", "1", "--seed", "7", "--no-plots"),
    *("--rollout.seconds", "0.3", "--rollout.lanes", "2"),
    *("--examination.candidates", "1", "--examination.draws", "2"),
)
"""Options of `train` that shorten any configuration to seconds and change nothing else."""
FEW_STARTS = ("--rollout.variety", "2")
"""The same if initial conditions change every generation: each needs its own uneven ground."""
FEW_BLOCKS = (
    *("--controller.nodes", "3", "--controller.parts", "3", "--controller.links", "4"),
    *("--evolution.ancestors.population", "4", "--evolution.ancestors.generations", "1"),
)
"""The same for modular bodies: compile time grows with the padded size."""


@dataclasses.dataclass(frozen=True)
class Way:
    """One way of training named by the shipped files. None: not given on the command line."""

    creature: str
    task: str | None = None
    config: str | None = None
    style: str | None = None
    gait: str | None = None

    @property
    def name(self) -> str:
        """A short name for the test."""
        return "-".join(part for part in dataclasses.astuple(self) if part)

    @property
    def arguments(self) -> list[str]:
        """Arguments of `mjxgait train`."""
        given = {"env": self.creature, "task": self.task, "config": self.config}
        given |= {"style": self.style, "gait": self.gait}
        words = [w for key, value in given.items() if value for w in (f"--{key}", value)]
        grows = creature_of(self.creature).settings.creature.grows
        few = (*FEW_BLOCKS, *settled_soon(task_of(self))) if grows else ()
        rollout = read_config(self.config).get("rollout", {}) if self.config else {}
        # With the usual seed the best of so few followers is a body without a hinge.
        few += ("--seed", "8") if (self.task, self.config) == ("follow", None) else ()
        return [*words, *few, *(FEW_STARTS if rollout.get("variety", 1) > 1 else ())]


def settled_soon(task: str) -> tuple[str, ...]:
    """Return options with which an episode of a modular body is longer than settling."""
    tables = [f"{skill}." for skill in skills_of(task)] or [""]
    return tuple(word for table in tables for word in (f"--fitness.{table}settle", "0.1"))


@functools.cache
def creature_of(name: str) -> Creature:
    """Return a shipped creature."""
    return load_creature(data_folder("envs") / name)


@functools.cache
def use_of(name: str) -> UseConfig:
    """Return the default controller and task of a creature."""
    creature = creature_of(name)
    return resolve_config(creature.settings.train, creature.name).use


def tasks_of(name: str) -> list[str]:
    """Return every task that fits a creature and is related to its own."""
    creature, own = creature_of(name), use_of(name)
    return [task for task in TASKS if _fits(creature, task) and _akin(creature, task, own.task)]


def _fits(creature: Creature, task: str) -> bool:
    try:
        config = resolve_config(creature.settings.train, creature.name, use={"task": task})
        check_fit(at_step(creature, config.rollout.step), config)
    except UserError:
        return False
    return True


def _akin(creature: Creature, task: str, own: str) -> bool:
    """Return whether a task is related to a creature's own.

    Modular bodies take all tasks. Other creatures take their own task and those derived from it;
    the smallest walker also takes plain tasks.
    """
    kind = find("task", task)
    if creature.settings.creature.grows or issubclass(kind, find("task", own)):
        return True
    return issubclass(kind, PlainTask) and creature.name == SMALLEST_WALKER


def smallest(names: list[str]) -> str:
    """Return the creature with the fewest degrees of freedom, which compiles soonest."""
    return min(names, key=lambda name: creature_of(name).nv)


def read_config(name: str) -> dict[str, Any]:
    """Return the table of a shipped configuration, over its base."""
    path = data_folder("configs") / f"{name}.toml"
    return over_base(tomllib.loads(path.read_text(encoding="utf-8")), str(path))


def creatures_of(config: str) -> list[str]:
    """Return the creatures of a configuration.

    Candidates have the controller that it names. A file with tables for single creatures takes all
    of them, any other file the smallest.
    """
    table = read_config(config)
    controller = table.get("use", {}).get("controller", UseConfig.controller)
    fit = [name for name in CREATURES if use_of(name).controller == controller]
    return fit if table.get("creature") else [smallest(fit)]


def task_of(way: Way) -> str:
    """Return the task of a way of training, as a user types it."""
    requested = way.task or read_config(way.config or "default").get("use", {}).get("task")
    return requested or use_of(way.creature).task


def first_of_each_task(ways: Iterable[Way]) -> list[Way]:
    """Return the first way of training with each task."""
    first: dict[tuple[str, bool], Way] = {}
    for way in ways:
        grows = creature_of(way.creature).settings.creature.grows
        first.setdefault((task_of(way), grows), way)
    return list(first.values())


def trainings() -> Iterator[Way]:
    """Yield every way of training, creature by creature, so that neighbours share programs."""
    walkers = [name for name in CREATURES if use_of(name).task == "walk"]
    for name in CREATURES:
        grows, own = creature_of(name).settings.creature.grows, use_of(name).task
        for task in tasks_of(name):
            yield Way(name, None if task == own else task)
        for config in CONFIGS:
            if name not in creatures_of(config):
                continue
            named = read_config(config).get("use", {}).get("task", own)
            for task in tasks_of(name) if grows else [named]:
                yield Way(name, None if task == named else task, config)
        if name == smallest(walkers):
            yield from (Way(name, style=style) for style in STYLES)
        if name in WITH_GAITS:
            feet = len(creature_of(name).feet.names)
            yield from (Way(name, gait=gait) for gait in GAITS[feet])
