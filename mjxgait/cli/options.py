"""Reading of a subcommand's options: help with an example, and errors in one sentence."""

import contextlib
import dataclasses
import io
import types
import typing
from collections.abc import Callable, Sequence
from typing import Annotated, Any, TypeVar

import tyro
from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    UnsupportedTypeAnnotationError,
)

from mjxgait.cli.commands import COMMANDS
from mjxgait.errors import UserError
from mjxgait.output import print_details

T = TypeVar("T")
HELP_ALL = "--help-all"
SIDES, RULES = "│ ", set("─-╰╯")
"""Characters of the frame around tyro's errors, in a UTF-8 terminal and in others."""
ENDS = ("Argument helptext", "For full helptext")
"""Beginnings of what follows in such a frame and is left out."""
SIMILAR = "Perhaps you meant"
"""Beginning of the similar options in such a frame, each with its help."""
NUMBERS = {int: "give a whole number", float: "give a number"}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Verbosity:
    """Options of commands that take minutes.

    Attributes:
      quiet: Print only the result and errors.
      verbose: Also print when programs are compiled, and where they are kept.
    """

    quiet: Annotated[bool, tyro.conf.arg(aliases=["-q"]), tyro.conf.FlagCreatePairsOff] = False
    verbose: Annotated[bool, tyro.conf.arg(aliases=["-v"]), tyro.conf.FlagCreatePairsOff] = False


def parsed(cls: type[T], command: str, arguments: Sequence[str], default: T | None = None) -> T:
    """Return the options of a subcommand.

    Raises:
      UserError: an unknown option or an invalid value.
    """
    words = ["--help" if word == HELP_ALL else word for word in arguments]
    given: dict[str, Any] = {} if default is None else {"default": default}
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            options = tyro.cli(
                cls,
                args=words,
                prog=f"mjxgait {command}",
                description=described(cls, command),
                registry=_registry(),
                **given,
            )
    except SystemExit as ended:
        if ended.code in (0, None):
            raise
        raise UserError(
            f"{_sentence(said.getvalue())}; `mjxgait {command} --help` lists the options"
        ) from None
    if isinstance(options, Verbosity) and options.verbose:
        print_details()
    return options


def request_of(cls: type[T], options: object) -> T:
    """Return the request that the Python function of a command takes, without further options."""
    fields = dataclasses.fields(cls)  # type: ignore[arg-type]
    return cls(**{field.name: getattr(options, field.name) for field in fields})


def described(cls: type, command: str) -> str:
    """Return the text above a subcommand's options: the docstring without fields, an example."""
    text = (cls.__doc__ or "").partition("Attributes:")[0]
    paragraphs = [" ".join(part.split()) for part in text.split("\n\n") if part.strip()]
    return "\n\n".join([*paragraphs, f"Example: {COMMANDS[command].example}"])


def _sentence(framed: str) -> str:
    """Return the error in tyro's frame, below its title, as one sentence."""
    lines: list[str] = []
    near: list[str] | None = None
    for line in framed.splitlines()[1:]:
        text = line.strip(SIDES)
        if text.startswith(ENDS):
            break
        if text.startswith(SIMILAR):
            near = []
        elif near is not None:
            near += [text.split()[0]] if text.startswith("--") and set(text) - RULES else []
        elif set(text) - RULES:
            lines.append(text)
    said = " ".join(lines).rstrip(".").removeprefix("Error parsing ")
    return f"{said}; did you mean {' or '.join(near[:3])}?" if near else said


def _registry() -> ConstructorRegistry:
    """Return rules for values: None cannot be typed where it is the default, numbers by name."""
    registry = ConstructorRegistry()

    @registry.primitive_rule
    def number(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
        if info.type not in NUMBERS:
            return None
        kind = typing.cast(type[int] | type[float], info.type)
        return PrimitiveConstructorSpec(
            nargs=1,
            metavar=kind.__name__.upper(),
            instance_from_str=lambda words: _number(kind, words[0]),
            is_instance=lambda value: isinstance(value, int if kind is int else int | float),
            str_from_instance=lambda value: [str(value)],
        )

    @registry.primitive_rule
    def optional(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
        inner = _without_none(info.type)
        if inner is None:
            return None
        spec = ConstructorRegistry.get_primitive_spec(PrimitiveTypeInfo.make(inner, info.markers))
        return None if isinstance(spec, UnsupportedTypeAnnotationError) else _or_none(spec)

    return registry


def _number(kind: type[int] | type[float], word: str) -> float:
    try:
        return kind(word)
    except ValueError:
        raise ValueError(f"{word!r}: {NUMBERS[kind]}") from None


def _without_none(kind: object) -> Any:
    """Return X of `X | None`; None for any other type."""
    if typing.get_origin(kind) not in (types.UnionType, typing.Union):
        return None
    inner = [one for one in typing.get_args(kind) if one is not type(None)]
    return inner[0] if len(inner) == 1 and len(typing.get_args(kind)) == 2 else None


def _or_none(spec: PrimitiveConstructorSpec[Any]) -> PrimitiveConstructorSpec[Any]:
    """Return the rule of a type for the same type or None; the word None still sets it."""
    read: Callable[[list[str]], Any] = spec.instance_from_str
    return dataclasses.replace(
        spec,
        instance_from_str=lambda words: None if words == ["None"] else read(words),
        is_instance=lambda value: value is None or spec.is_instance(value),
        str_from_instance=lambda v: ["None"] if v is None else spec.str_from_instance(v),
    )
