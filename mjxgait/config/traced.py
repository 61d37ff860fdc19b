"""Config as the compiled program reads it: a pytree with its numbers and choices as leaves.

Its structure decides the shape of the program. Configs of the same structure run in the same
compiled program, and many of them can be stacked and run side by side. A changed weight or rate
compiles nothing anew, except a weight marked `SHAPE`: its zero removes a term.
"""

import dataclasses
import functools
from typing import Any, Literal, cast, get_args, get_origin, get_type_hints

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.schema import Config
from mjxgait.config.tables import HOST, KIND, SHAPE
from mjxgait.types import pytree


@pytree
class Choice:
    """One of several named options in the compiled program. index: []."""

    index: jax.Array | np.int32
    options: tuple[str, ...] = dataclasses.field(metadata={"static": True})


@dataclasses.dataclass(frozen=True)
class HostOnly:
    """Placeholder for a setting that the compiled program must not read as number or condition."""

    name: str

    def __bool__(self) -> bool:
        raise TypeError(f'"{self.name}" is read by the host only: the program has no such setting')


def chosen(value: str | Choice, option: str) -> jax.Array:
    """Return whether [] a choice of the config, plain or traced, is this option."""
    if isinstance(value, Choice):
        return value.index == value.options.index(option)
    return jnp.asarray(value == option)


def traced(config: Config) -> Config:
    """Return the config with arrays for numbers and `Choice` for choices, without host settings."""
    # Arrays of JAX, for code under trace may index them.
    return cast(Config, jax.tree.map(jnp.asarray, _traced(config)))


def traced_structure(config: Config) -> jax.tree_util.PyTreeDef:
    """Return the structure of `traced(config)`, which makes no arrays on the device."""
    return jax.tree.structure(_traced(config))


def shape_settings(cls: type) -> tuple[str, ...]:
    """Return the names of a dataclass's settings that decide the shape of the program."""
    return tuple(field.name for field, _, role in _fields(cls) if role == SHAPE)


def _traced(config: Any) -> Any:
    values = {}
    for field, hint, role in _fields(type(config)):  # type: ignore[arg-type]  # types are hashable
        value = getattr(config, field.name)
        if dataclasses.is_dataclass(value):
            values[field.name] = _traced(value)
        elif role is HOST:
            values[field.name] = HostOnly(field.name)
        elif role is SHAPE:
            values[field.name] = value
        elif value is None:
            # Not requested: the program has no input for it.
            values[field.name] = None
        elif role is KIND:
            values[field.name] = value.split(":")[0]
        else:
            values[field.name] = _leaf(value, hint)
    return type(config)(**values)


def _leaf(value: Any, hint: Any) -> object:
    if isinstance(value, tuple):
        return tuple(np.float32(end) for end in value)
    plain = get_args(hint)[0] if hasattr(hint, "__metadata__") else hint
    if isinstance(value, str):
        options = get_args(plain)
        return Choice(np.int32(options.index(value)), options)
    return {bool: np.bool_, int: np.int32}.get(plain, np.float32)(value)


@functools.cache
def _fields(cls: type) -> list[tuple[dataclasses.Field[object], object, str]]:
    """Return each field of a config class with its type and role.

    The role is `SHAPE`, `KIND`, `HOST`, or empty for an input of the program.
    """
    hints = get_type_hints(cls, include_extras=True)
    rows = []
    for field in dataclasses.fields(cls):
        hint = hints[field.name]
        marks = (
            [mark for mark in getattr(hint, "__metadata__", ()) if mark in (SHAPE, KIND, HOST)]
            if get_origin(hint) is not Literal
            else []
        )
        rows.append((field, hint, marks[0] if marks else ""))
    return rows


_REGISTERED: set[type] = set()


def register(cls: type) -> None:
    """Register a config class, and those within it, as pytrees."""
    if cls in _REGISTERED:
        return
    _REGISTERED.add(cls)
    roles = {field.name: role for field, _, role in _fields(cls)}
    for field in dataclasses.fields(cls):
        inner: object = get_type_hints(cls)[field.name]
        if isinstance(inner, type) and dataclasses.is_dataclass(inner):
            register(inner)
    data = [name for name, role in roles.items() if not role]
    jax.tree_util.register_dataclass(
        cls, data_fields=data, meta_fields=[name for name, role in roles.items() if role]
    )


register(Config)
