"""Controllers and tasks from a user's file, named only on the command line."""

import importlib.util
import inspect
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import cast

from mjxgait.certification.tasks.plain import HasCriteria, PlainDemands
from mjxgait.config.schema import UseConfig
from mjxgait.controllers.key_poses.config import holds
from mjxgait.errors import UserError, did_you_mean
from mjxgait.kinds import ControllerKind, TaskKind, register, shipped

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
    cls = getattr(_module(path, kind), name, None)
    if not inspect.isclass(cls):
        raise UserError(f'{path}: has no class "{name}"')
    base = _base(kind)
    if not issubclass(cls, base):
        raise UserError(f"{path}: {name} must inherit from {base.__module__}.{base.__name__}")
    if missing := sorted(getattr(cls, "__abstractmethods__", ())):
        raise UserError(f"{path}: {name} lacks {', '.join(missing)}")
    every = getattr(cls, "every", 1)
    try:
        holds(every)
    except ValueError as error:
        raise UserError(f"{path}: {name}.every = {every}: {error}") from None
    known = f"{path.name}:{name}"
    _LOADED[kind, known] = f"{path.resolve()}:{name}"
    if kind == "controller":
        from mjxgait.plugins.same_code import SameCode

        register(ControllerKind(known, cls.__module__, controller=cls, reference=SameCode))
    else:
        criteria = partial(PlainDemands, cast(HasCriteria, cls))
        register(TaskKind(known, cls.__module__, task=cls, criteria=criteria))
    return known


def loaded() -> tuple[tuple[str, str], ...]:
    """Return kind and `FILE.py:CLASS` of all loaded classes, for other processes to load."""
    return tuple((kind, text) for (kind, _), text in _LOADED.items())


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
    from mjxgait.controllers.real_genome import RealController
    from mjxgait.tasks.plain import PlainTask

    return RealController if kind == "controller" else PlainTask


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
