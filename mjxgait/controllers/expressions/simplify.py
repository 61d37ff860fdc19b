"""Simplification of expressions without changing their values."""

import math

from mjxgait.controllers.expressions.text import LARGEST, LEAST_DIVISOR, Expression


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
    return min(max(results[name](), -LARGEST), LARGEST)


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
