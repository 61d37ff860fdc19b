"""Single machine-code kernel for many operations, on CPU."""

import functools
from collections.abc import Callable
from typing import Any

import jax
from jax.experimental.xla_metadata import set_xla_metadata


def one_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile the function on CPU into a single kernel instead of one per fused operation.

    XLA's CPU runtime starts every kernel separately (70 ns or more each), and a physics step has
    hundreds on small arrays. XLA compiles calls that carry this mark whole, as it does by default
    with small loops. Elsewhere this changes nothing.

    The function must have at least two results that are used: XLA mishandles a marked call
    with a single result that it would split over threads.
    """

    @functools.wraps(function)
    def unmarked(*args: Any) -> Any:
        with set_xla_metadata(xla_cpu_small_call=None, inlineable=None):
            return function(*args)

    compiled = jax.jit(unmarked)

    @functools.wraps(function)
    def marked(*args: Any) -> Any:
        if jax.default_backend() != "cpu":
            return function(*args)
        with set_xla_metadata(xla_cpu_small_call="true", inlineable="false"):
            return compiled(*args)

    return marked
