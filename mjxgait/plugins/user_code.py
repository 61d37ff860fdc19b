"""Controllers and tasks from a user's file, named only on the command line.

For a user's controller, body, drive and criteria are still implemented twice; the controller is
not.
"""

import importlib.util
import inspect
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.certification.acceptance import HasCriteria, PlainCriteria
from mjxgait.champion import Champion
from mjxgait.config.schema import UseConfig
from mjxgait.config.tables import build
from mjxgait.controllers.config import check_every
from mjxgait.creature import Creature
from mjxgait.errors import UserError, did_you_mean
from mjxgait.kinds import ControllerKind, TaskKind, register, shipped
from mjxgait.plugins.registry import find
from mjxgait.reference.controllers import Command, Memory


class SameCode:
    """Implementation of `ReferenceController`. The memory's arrays are numbered."""

    def __init__(self, creature: Creature, champion: Champion, step: float) -> None:
        part: Any = find("controller", champion.controller)
        controller = part(creature, step)
        settings = champion.settings
        if isinstance(settings, Mapping):
            settings = build(part.Settings, settings, "champion.json: settings")
        genome = {name: jnp.asarray(a, jnp.float32) for name, a in champion.genome.items()}
        plan = controller.prepare(genome, settings)
        # Always read the time: its length is the number of individuals.
        self.reads: tuple[str, ...] = (*controller.reads, "time")
        self.command: Command = controller.command
        self.every: int = controller.every
        self.first, self.tree = jax.tree.flatten(jax.device_get(controller.init()))

        def act(memory: object, senses: Mapping[str, jax.Array]) -> tuple[jax.Array, object]:
            return controller.act(plan, memory, senses)

        self.program = jax.jit(jax.vmap(act))

    def init(self, count: int) -> Memory:
        """See `ReferenceController`."""
        leaves = (np.asarray(leaf) for leaf in self.first)
        return {str(i): np.repeat(leaf[None], count, axis=0) for i, leaf in enumerate(leaves)}

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """Command of all individuals.

        Their number is padded to a power of two, so that few programs are compiled.
        """
        count = len(senses["time"])
        padding = (1 << (count - 1).bit_length()) - count

        def padded(array: np.ndarray) -> np.ndarray:
            wide = array.astype(np.float32) if array.dtype == np.float64 else array
            return np.concatenate([wide, np.repeat(wide[:1], padding, axis=0)])

        leaves = [padded(memory[str(i)]) for i in range(len(self.first))]
        inputs = {name: padded(values) for name, values in senses.items()}
        command, after = self.program(jax.tree.unflatten(self.tree, leaves), inputs)
        kept = (np.asarray(leaf)[:count] for leaf in jax.tree.leaves(after))
        return np.asarray(command, float)[:count], {str(i): leaf for i, leaf in enumerate(kept)}

    def phase(self, memory: Memory) -> np.ndarray:
        """Return NaN, because the controller may have no cycle."""
        count = len(next(iter(memory.values()))) if memory else 1
        return np.full(count, np.nan)


KINDS = ("controller", "task")
_LOADED: dict[tuple[str, str], str] = {}


def take_own(arguments: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Load what `--controller` and `--task` name.

    Returns the other arguments, and by kind the names of the loaded classes.

    Raises:
      UserError: says what is wrong with the file or the class.
    """
    rest, named = [], {}
    waiting = list(arguments)
    while waiting:
        flag, equals, value = waiting.pop(0).partition("=")
        kind = flag.removeprefix("--")
        if not flag.startswith("--") or kind not in KINDS:
            rest.append(flag + equals + value)
            continue
        if not equals and not waiting:
            raise UserError(f"{flag}: name one of {', '.join(shipped(kind))}, or FILE.py:CLASS")
        named[kind] = load(kind, value if equals else waiting.pop(0))
    return rest, named


def load(kind: str, text: str) -> str:
    """Register a class and return its name: that of a shipped one unchanged, or `file.py:CLASS`.

    Raises:
      UserError: says what is wrong with the file or the class.
    """
    if text in shipped(kind):
        return text
    place, colon, name = text.rpartition(":")
    if not colon or not name or not place.endswith(".py"):
        raise UserError(
            f"--{kind} {text}: {did_you_mean(text, shipped(kind))}; or give FILE.py:CLASS for one "
            "of your own"
        )
    path = Path(place)
    module = _module(path, kind)
    cls = getattr(module, name, None)
    if not inspect.isclass(cls):
        classes = inspect.getmembers(module, inspect.isclass)
        own = [known for known, one in classes if one.__module__ == module.__name__]
        raise UserError(f'{path}: has no class "{name}"; {did_you_mean(name, own)}')
    base = _base(kind)
    if not issubclass(cls, base):
        raise UserError(f"{path}: {name} must inherit from {base.__module__}.{base.__name__}")
    _refuse_old_names(path, cls)
    if missing := sorted(getattr(cls, "__abstractmethods__", ())):
        raise UserError(f"{path}: {name} lacks {', '.join(missing)}")
    every = getattr(cls, "every", 1)
    try:
        check_every(every)
    except ValueError as error:
        raise UserError(f"{path}: {name}.every = {every}: {error}") from None
    known = f"{path.name}:{name}"
    _LOADED[kind, known] = f"{path.resolve()}:{name}"
    if kind == "controller":
        register(ControllerKind(known, cls.__module__, controller=cls, reference=SameCode))
    else:
        criteria = partial(PlainCriteria, cast(HasCriteria, cls))
        register(TaskKind(known, cls.__module__, task=cls, criteria=criteria))
    return known


def loaded() -> tuple[tuple[str, str], ...]:
    """Return kind and `FILE.py:CLASS` of all loaded classes, for other processes to load.

    Files that no longer exist are left out. A run that uses one fails with an error of its own.
    """
    return tuple(
        (kind, text)
        for (kind, _), text in _LOADED.items()
        if Path(text.rpartition(":")[0]).is_file()
    )


def places_of(use: UseConfig) -> dict[str, str]:
    """Return `FILE.py:CLASS` by kind for the user-defined code of a run; paths are absolute."""
    named = {kind: (kind, getattr(use, kind)) for kind in KINDS}
    return {kind: _LOADED[key] for kind, key in named.items() if key in _LOADED}


def is_loaded(kind: str, known: str) -> bool:
    """Return True if `file.py:CLASS` is loaded in this process."""
    return (kind, known) in _LOADED


def load_all(parts: Sequence[tuple[str, str]]) -> None:
    """Load what `loaded` returned in another process."""
    for kind, text in parts:
        load(kind, text)


def _base(kind: str) -> type:
    from mjxgait.controllers.base import RealController
    from mjxgait.tasks.plain import PlainTask

    return RealController if kind == "controller" else PlainTask


RENAMED = {
    "aim": "goal",
    "climbs": "has_curriculum",
    "harder": "at_level",
    "judge": "evaluate",
    "mastered": "level_passed",
    "numbers": "genome_statistics",
    "onward": "next_goal",
    "senses": "observations",
    "standards": "params",
    "told": "with_settings",
}
"""Old and new names of the members of a task or a controller."""


def _refuse_old_names(path: Path, cls: type) -> None:
    """Refuse a class with a member under its old name, which nothing would call."""
    own = [one for one in cls.__mro__ if not one.__module__.startswith("mjxgait.")]
    for old, new in RENAMED.items():
        if any(old in vars(one) for one in own):
            raise UserError(f"{path}: {cls.__name__}.{old} is now called {new}; rename it")


def _module(path: Path, kind: str) -> ModuleType:
    if not path.is_file():
        raise UserError(f"--{kind} {path}: no such file")
    name = f"mjxgait_own_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise UserError(f"--{kind} {path}: not a file of Python")
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look up their module while they are defined.
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise UserError(f"{path}: cannot be loaded ({type(error).__name__}: {error})") from error
    return module
