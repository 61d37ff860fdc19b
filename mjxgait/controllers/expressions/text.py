"""Expressions: as arrays for evolution, and as text for people (`reading` reads that again).

An expression is arrays `code` [C] and `value` [C] in prefix order, as far as `code` is not `EMPTY`.
In text it is a number, a name, or `(function argument ...)`.
"""

import dataclasses
import fnmatch
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from mjxgait.controllers.expressions.config import FUNCTIONS
from mjxgait.errors import UserError, did_you_mean

EMPTY, CONSTANT, FIRST_FUNCTION, FIRST_ADDED, FIRST_SENSE = 0, 1, 2, 32, 64
FUNCTION_CODES = {name: FIRST_FUNCTION + i for i, name in enumerate(FUNCTIONS)}
ARITY = np.zeros(FIRST_ADDED, np.int32)
ARITY[FIRST_FUNCTION : FIRST_FUNCTION + len(FUNCTIONS)] = list(FUNCTIONS.values())
"""[32] by code; senses take no arguments."""
LEAST_DIVISOR, LARGEST = 1e-6, 1e9
"""`/` gives 1 where the divisor is smaller. No function gives more than the second, so that none
gives what is not finite.
"""

Expression = str | float | tuple[Any, ...]
"""The name of a sense, a number, or a function with its arguments."""


@dataclasses.dataclass(frozen=True)
class Terminal:
    """A number that an expression may read: its name, and where it is among the senses.

    index: in the sense's array; None where that is one number.
    """

    name: str
    code: int
    sense: str
    index: int | None = None


class Named(Protocol):
    """Parts with names."""

    @property
    def names(self) -> tuple[str, ...]:
        """One per part."""
        ...


class HasParts(Protocol):
    """What is told of a body."""

    @property
    def joints(self) -> Named:
        """The actuated ones."""
        ...

    @property
    def feet(self) -> Named:
        """Each a body, of one shape or several."""
        ...


ADDED = {"s0": "goal_distance", "b0": "bar_distance"}
"""Names of senses that tasks add."""
SCALARS = {
    "t": "time",
    "beat": "beat",
    "vx": "forward_vel",
    "vz": "up_vel",
    "px": "forward",
    "py": "aside",
    "pz": "trunk_height",
    "heading": "heading",
    "pitch": "pitch",
    "roll": "roll",
    "pitch_rate": "pitch_rate",
    "roll_rate": "roll_rate",
}


def terminals(body: HasParts, added: Sequence[str] = ()) -> tuple[Terminal, ...]:
    """All that a body senses, and those of the senses `added` by a task that have a name."""
    rows: list[tuple[str, str, int | None]] = [(n, sense, None) for n, sense in SCALARS.items()]
    for j in range(len(body.joints.names)):
        rows += [(f"a{j}", "joint_pos", j), (f"w{j}", "joint_vel", j)]
    rows += [(f"c{f}", "contact", f) for f in range(len(body.feet.names))]
    own = [Terminal(n, FIRST_SENSE + i, sense, k) for i, (n, sense, k) in enumerate(rows)]
    given = [
        Terminal(name, FIRST_ADDED + i, sense)
        for i, (name, sense) in enumerate(ADDED.items())
        if sense in added
    ]
    return (*given, *own)


def chosen_terminals(known: Sequence[Terminal], patterns: Sequence[str]) -> tuple[Terminal, ...]:
    """Those whose names match a pattern.

    Raises:
      UserError: a pattern without a star or bracket matches none.
    """
    names = [terminal.name for terminal in known]
    for pattern in patterns:
        if not set(pattern) & set("*?[") and pattern not in names:
            raise UserError(
                f'controller.senses: there is no "{pattern}" here; {did_you_mean(pattern, names)}'
            )
    found = tuple(t for t in known if any(fnmatch.fnmatchcase(t.name, p) for p in patterns))
    if not found:
        raise UserError(f"controller.senses = {list(patterns)}: no sense has such a name")
    return found


def to_text(code: np.ndarray, value: np.ndarray, known: Sequence[Terminal]) -> str:
    """The expression in arrays [C]."""
    return in_text(nested(code, value, known))


def in_text(expression: Expression) -> str:
    """As it is written."""
    if isinstance(expression, tuple):
        return f"({' '.join(map(in_text, expression))})"
    if isinstance(expression, float):
        return str(np.format_float_positional(np.float32(expression), unique=True, trim="-"))
    return expression


def nested(code: np.ndarray, value: np.ndarray, known: Sequence[Terminal]) -> Expression:
    """The expression in arrays [C]."""
    names = {terminal.code: terminal.name for terminal in known}
    functions = {number: name for name, number in FUNCTION_CODES.items()}
    nodes = iter(range(int((np.asarray(code) != EMPTY).sum())))

    def read() -> Expression:
        i = next(nodes)
        if code[i] == CONSTANT:
            return float(value[i])
        if int(code[i]) in names:
            return names[int(code[i])]
        name = functions[int(code[i])]
        return (name, *(read() for _ in range(FUNCTIONS[name])))

    return read()
