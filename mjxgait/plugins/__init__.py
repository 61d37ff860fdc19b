"""Controllers and tasks of a run: the shipped ones and those of a user's file."""

from mjxgait.plugins.registry import (
    build_config,
    config_class,
    make_controller,
    make_task,
    resolve_config,
)

__all__ = ["build_config", "config_class", "make_controller", "make_task", "resolve_config"]
