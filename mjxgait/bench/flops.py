"""Count of a program's floating-point operations as written.

A compiler may repeat or save some.
"""

import math
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

# fmt: off
ONE_EACH = frozenset((
    "add", "sub", "mul", "div", "neg", "abs", "max", "min", "sqrt", "rsqrt", "square", "pow", "integer_pow", "exp", "log",
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "floor", "sign", "clamp", "select_n", "lt", "le", "gt", "ge", "eq", "ne",
))
# fmt: on
"""Primitives with one operation per element of their result."""
REDUCTIONS = frozenset(
    ["reduce_sum", "reduce_max", "reduce_min", "reduce_prod", "cumsum", "reduce_and", "reduce_or"]
)


def count_flops(function: Callable[..., Any], *args: Any) -> float:
    """Count the floating-point operations of a function, comparisons and choices included.

    A loop counts as often as it runs, if that is known.
    """
    return _count(jax.make_jaxpr(function)(*args).jaxpr)


def _count(jaxpr: Any) -> float:
    return sum(_equation(equation) for equation in jaxpr.eqns)


def _equation(equation: Any) -> float:
    name, inner = equation.primitive.name, list(_inner(equation.params))
    if name == "cond":
        return max(_count(branch) for branch in inner)
    if inner:
        return equation.params.get("length", 1) * sum(_count(jaxpr) for jaxpr in inner)
    operand = equation.invars[-1].aval if equation.invars else None
    if operand is None or not np.issubdtype(operand.dtype, np.floating):
        return 0.0
    if name == "dot_general":
        (contracted, _), _ = equation.params["dimension_numbers"]
        shape = equation.invars[0].aval.shape
        return 2.0 * equation.outvars[0].aval.size * math.prod(shape[axis] for axis in contracted)
    if name in REDUCTIONS:
        return float(operand.size)
    return float(equation.outvars[0].aval.size) if name in ONE_EACH else 0.0


def _inner(params: dict[str, Any]) -> Any:
    """Yield the programs within an operation: loop bodies, branches, calls."""
    for value in params.values():
        for item in value if isinstance(value, (tuple, list)) else (value,):
            jaxpr = getattr(item, "jaxpr", item)
            if hasattr(jaxpr, "eqns"):
                yield jaxpr
