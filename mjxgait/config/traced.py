"""The config as the compiled program reads it: a pytree whose leaves are its numbers and choices.

Its structure is what decides the shape of the program: two configs of the same structure run in the same compiled program, and many of
them can be stacked and run side by side. Nothing is compiled anew because a weight or a rate has changed, but for a weight
by which there is a term or none.
"""

import dataclasses
from typing import Any, Literal, get_args, get_origin, get_type_hints

import jax
import jax.numpy as jnp

from mjxgait.config.schema import Config
from mjxgait.config.tables import HOST, KIND, SHAPE
from mjxgait.types import pytree


@pytree
class Choice:
    """One of some named options, as the program sees it: index: []."""

    index: jax.Array
    options: tuple[str, ...] = dataclasses.field(metadata={"static": True})


@dataclasses.dataclass(frozen=True)
class HostOnly:
    """In the place of a setting that the compiled program must not read: it is no number and no truth."""

    name: str

    def __bool__(self) -> bool:
        raise TypeError(f'"{self.name}" is read by the host only: the program has no such setting')


def chosen(value: Any, option: str) -> jax.Array:
    """Whether [] a choice of the config, plain or traced, is this option."""
    if isinstance(value, Choice):
        return value.index == value.options.index(option)
    return jnp.asarray(value == option)


def traced(config: Config) -> Config:
    """The config with arrays as numbers and `Choice` as choices; what only the host reads is not in it."""
    return _traced(config)


def _traced(config: Any) -> Any:
    values = {}
    for field, hint, role in _fields(type(config)):
        value = getattr(config, field.name)
        if dataclasses.is_dataclass(value):
            values[field.name] = _traced(value)
        elif role is HOST:
            values[field.name] = HostOnly(field.name)
        elif role is SHAPE:
            values[field.name] = value
        elif value is None:
            # Not asked for: the program has no place for it.
            values[field.name] = None
        elif role is KIND:
            values[field.name] = value.split(":")[0]
        else:
            values[field.name] = _leaf(value, hint)
    return type(config)(**values)


def _leaf(value: Any, hint: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(jnp.float32(end) for end in value)
    if isinstance(value, str):
        options = get_args(hint)
        return Choice(jnp.int32(options.index(value)), options)
    plain = get_args(hint)[0] if hasattr(hint, "__metadata__") else hint
    return jnp.asarray(value, {bool: jnp.bool_, int: jnp.int32}.get(plain, jnp.float32))


def _fields(cls: type) -> list[tuple[Any, Any, str]]:
    """Each field of a config class with its type and its role: `SHAPE`, `KIND`, `HOST`, or empty for a value of the program."""
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
    """Makes a config class, and those within it, pytrees."""
    if cls in _REGISTERED:
        return
    _REGISTERED.add(cls)
    roles = {field.name: role for field, _, role in _fields(cls)}
    for field in dataclasses.fields(cls):
        inner: Any = get_type_hints(cls)[field.name]
        if isinstance(inner, type) and dataclasses.is_dataclass(inner):
            register(inner)
    data = [name for name, role in roles.items() if not role]
    jax.tree_util.register_dataclass(
        cls, data_fields=data, meta_fields=[name for name, role in roles.items() if role]
    )


register(Config)
