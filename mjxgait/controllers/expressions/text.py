"""Expressions as arrays for evolution and as text for people (`parse` reads the text).

An expression is arrays `code` [C] and `value` [C] in prefix order, up to the first `EMPTY` code.
In text it is a number, a name, or `(function argument ...)`.
"""

import dataclasses
import fnmatch
import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from mjxgait.controllers.expressions.config import FUNCTIONS
from mjxgait.errors import UserError, did_you_mean

EMPTY, CONSTANT, FIRST_FUNCTION, FIRST_ADDED, FIRST_SENSE = 0, 1, 2, 32, 64
FUNCTION_CODES = {name: FIRST_FUNCTION + i for i, name in enumerate(FUNCTIONS)}
ARITY = np.zeros(FIRST_ADDED, np.int32)
ARITY[FIRST_FUNCTION : FIRST_FUNCTION + len(FUNCTIONS)] = list(FUNCTIONS.values())
"""Number of arguments [32] by code; observations take none."""
LEAST_DIVISOR, VALUE_LIMIT = 1e-6, 1e9
"""`/` returns 1 if the divisor is smaller than the first. Function values are clipped to ± the
second, to stay finite.
"""

Expression = str | float | tuple[Any, ...]
"""Name of an observation, a number, or a function with its arguments."""


@dataclasses.dataclass(frozen=True)
class Terminal:
    """Input of an expression: its name, and the observation that holds it.

    index: in the observation's array; None if that is one number.
    """

    name: str
    code: int
    sense: str
    index: int | None = None


class Named(Protocol):
    """Parts with names."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names, one per part."""
        ...


class HasParts(Protocol):
    """Parts of a body that expressions observe."""

    @property
    def joints(self) -> Named:
        """Actuated joints."""
        ...

    @property
    def feet(self) -> Named:
        """Feet, each a body of one or several shapes."""
        ...


ADDED = {"s0": "goal_distance", "b0": "bar_distance"}
"""Names of observations that tasks add."""
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


def every_terminal(body: HasParts) -> tuple[Terminal, ...]:
    """Return the inputs from a body and from all tasks."""
    return terminals(body, tuple(ADDED.values()))


def terminals(body: HasParts, added: Sequence[str]) -> tuple[Terminal, ...]:
    """Return the inputs from a body, and from named observations that a task adds (`added`)."""
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
    """Return the terminals with names that match a pattern.

    Raises:
      UserError: a pattern without wildcards matches none, or all patterns together match none.
    """
    names = [terminal.name for terminal in known]
    for pattern in patterns:
        if not set(pattern) & set("*?[") and pattern not in names:
            raise UserError(
                f'controller.senses: there is no "{pattern}" here; {did_you_mean(pattern, names)}'
            )
    found = tuple(t for t in known if any(fnmatch.fnmatchcase(t.name, p) for p in patterns))
    if not found:
        raise UserError(
            f"controller.senses = {list(patterns)}: no observation matches; name some of "
            f"{', '.join(names)}"
        )
    return found


def to_text(code: np.ndarray, value: np.ndarray, known: Sequence[Terminal]) -> str:
    """Return the text of an expression in arrays [C]."""
    return in_text(nested(code, value, known))


def in_text(expression: Expression) -> str:
    """Return the text of an expression."""
    if isinstance(expression, tuple):
        return f"({' '.join(map(in_text, expression))})"
    if isinstance(expression, float):
        return str(np.format_float_positional(np.float32(expression), unique=True, trim="-"))
    return expression


def nested(code: np.ndarray, value: np.ndarray, known: Sequence[Terminal]) -> Expression:
    """Return the nested expression in arrays [C]."""
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


def simplified(expression: Expression) -> Expression:
    """Fold constants and remove parts that have no effect under any observations.

    Removed parts changed a value by its rounding at most.
    """
    if not isinstance(expression, tuple):
        return expression
    name, *parts = expression
    arguments = [simplified(part) for part in parts]
    numbers = [argument for argument in arguments if isinstance(argument, float)]
    return folded(name, numbers) if len(numbers) == len(parts) else _shorter(name, arguments)


def folded(name: str, values: list[float]) -> float:
    """Return a function's value for numbers."""
    a, b, c = (*values, 0.0, 0.0)[:3]
    results = {
        "+": lambda: a + b,
        "-": lambda: a - b,
        "*": lambda: a * b,
        "/": lambda: a / b if abs(b) >= LEAST_DIVISOR else 1.0,
        "ifltz": lambda: b if a < 0 else c,
        "min": lambda: min(a, b),
        "max": lambda: max(a, b),
        "abs": lambda: abs(a),
        "sin": lambda: math.sin(a),
        "cos": lambda: math.cos(a),
    }
    return min(max(results[name](), -VALUE_LIMIT), VALUE_LIMIT)


def _shorter(name: str, arguments: list[Expression]) -> Expression:
    whole: Expression = (name, *arguments)
    match name, arguments:
        case "+", [0.0, x] | [x, 0.0]:
            return x
        case "-", [x, 0.0]:
            return x
        case "*", [1.0, x] | [x, 1.0]:
            return x
        case "*", [0.0, _] | [_, 0.0]:
            return 0.0
        case "/", [x, 1.0]:
            return x
        case "/", [_, float(b)] if abs(b) < LEAST_DIVISOR:
            return 1.0
        case (("-" | "/" | "min" | "max"), [x, y]) if x == y:
            return {"-": 0.0, "/": 1.0}.get(name, x)
        case "ifltz", [float(a), x, y]:
            return x if a < 0 else y
        case "ifltz", [_, x, y] if x == y:
            return x
        case "ifltz", [condition, _, y] if _never_negative(condition):
            return y
        case "abs", [x] if _never_negative(x):
            return x
    return whole


def _never_negative(expression: Expression) -> bool:
    match expression:
        case ("abs", _):
            return True
        case ("*", x, y) if x == y:
            return True
        case float(a):
            return a >= 0
    return False
