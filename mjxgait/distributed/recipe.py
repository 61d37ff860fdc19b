"""All that a machine needs to build the program of some runs; sent along, no folder is shared."""

import dataclasses
import hashlib
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.creature.scale import load_files
from mjxgait.plugins import build_config
from mjxgait.plugins.user_code import is_loaded, load, loaded


@dataclasses.dataclass(frozen=True)
class OwnPart:
    """A user-defined controller or task: its class, and the file that it is in."""

    kind: str
    cls: str
    file: str
    source: str

    def load(self) -> None:
        """Load the class into this process."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / self.file
            path.write_text(self.source, encoding="utf-8")
            load(self.kind, f"{path}:{self.cls}")


@dataclasses.dataclass(frozen=True)
class Recipe:
    """A creature's files by name, the runs' settings as tables, and the user's own code.

    sources: see `build_batch`.
    """

    files: Mapping[str, str]
    tables: tuple[Mapping[str, Any], ...]
    own: tuple[OwnPart, ...] = ()
    sources: tuple[tuple[int, ...], ...] = ()

    @classmethod
    def of(
        cls, creature: Creature, configs: Sequence[Config], sources: Sequence[Sequence[int]] = ()
    ) -> "Recipe":
        """Make the recipe of runs of one program."""
        tables = tuple(dataclasses.asdict(config) for config in configs)
        known = tuple(map(tuple, sources))
        return cls(dict(creature.files), tables, tuple(_own_parts(configs)), known)

    @cached_property
    def digest(self) -> str:
        """Hash of the whole recipe."""
        text = json.dumps(dataclasses.asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def read(self) -> tuple[Creature, list[Config]]:
        """Return the creature and the configs; load the user's own code."""
        for part in self.own:
            if not is_loaded(part.kind, f"{part.file}:{part.cls}"):
                part.load()
        configs = [build_config(table, "the settings that were sent") for table in self.tables]
        return load_files(self.files), configs


def _own_parts(configs: Sequence[Config]) -> Iterator[OwnPart]:
    """Yield the loaded plugins that the configs use."""
    used = {name for config in configs for name in (config.use.controller, config.use.task)}
    for kind, text in loaded():
        place, _, cls = text.rpartition(":")
        path = Path(place)
        if f"{path.name}:{cls}" in used:
            yield OwnPart(kind, cls, path.name, path.read_text(encoding="utf-8"))
