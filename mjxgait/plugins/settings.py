"""The config of a run, with the settings of its controller and task."""

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mjxgait.config import layers
from mjxgait.config.schema import Config, UseConfig
from mjxgait.config.tables import STRICT, build
from mjxgait.plugins.registry import find, meant


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


def build_config(table: Mapping[str, Any], where: str) -> Config:
    """Return the config of a table, with the settings of the controller and the task it names.

    Raises:
      UserError: names the key; or the code that must be named on the command line.
    """
    use = meant(build(UseConfig, table.get("use", {}), f"{where}: [use]"))
    return build(config_class(use), {**table, "use": dataclasses.asdict(use)}, where)


def resolve_config(
    creature_table: Mapping[str, Any],
    creature_name: str,
    file: Path | None = None,
    use: Mapping[str, str] | None = None,
) -> Config:
    """See `layers.resolve_config`."""
    return layers.resolve_config(creature_table, creature_name, file, use, config_class, meant)
