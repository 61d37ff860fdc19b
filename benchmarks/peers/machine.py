"""The measuring machine, operations of a program, and the distance to what the cores can do.

Operations are counted in the program as written; a compiler may repeat or save some. Operations and
bytes of the compiled step are compared with a measured peak.
"""

import math
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.processes import cores, process_per_core
from mjxgait.simulation.episode import Lane
from mjxgait.training.experiment import Experiment

if TYPE_CHECKING:
    from jax.extend.core import Jaxpr

TRIES = 20


def machine_facts() -> dict[str, object]:
    """Return processor, cores, system, and the load before the measurement."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "processor": _processor(),
        "cores": cores(),
        "system": platform.system(),
        "architecture": platform.machine(),
        "load": load,
    }


def measured_peak() -> dict[str, float]:
    """Measure the peak of all cores, with one process per core at once.

    flops: per s, single precision, in a matrix product. memory_bytes, cache_bytes: per s in an
    addition beyond and within the cache. Each is the best of a few tries, summed over the cores.
    """
    count = cores()
    with process_per_core() as pool:
        return {
            "flops": sum(pool.map(_matrix_product, [1024] * count)),
            "memory_bytes": sum(pool.map(_addition, [1 << 24] * count, [1] * count)),
            "cache_bytes": sum(pool.map(_addition, [1 << 13] * count, [4000] * count)),
        }


def _matrix_product(size: int) -> float:
    a = np.ones((size, size), np.float32)
    out = np.empty_like(a)
    return 2.0 * size**3 / _best(lambda: np.matmul(a, a, out=out))


def _addition(size: int, repeats: int) -> float:
    """Return the bytes per second of `c = a + b` on single-precision arrays.

    Two are read, one is written.
    """
    a, b, c = (np.ones(size, np.float32) for _ in range(3))

    def add() -> None:
        for _ in range(repeats):
            np.add(a, b, out=c)

    return 3.0 * 4.0 * size * repeats / _best(add)


def _best(work: Callable[[], object]) -> float:
    """Return the seconds of the fastest of a few tries."""
    times = []
    for _ in range(TRIES):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


# fmt: off
ONE_EACH = frozenset((
    "add", "sub", "mul", "div", "neg", "abs", "max", "min", "sqrt", "rsqrt", "square", "pow",
    "integer_pow", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "floor", "sign", "clamp",
    "select_n", "lt", "le", "gt", "ge", "eq", "ne",
))
# fmt: on
"""Primitives with one operation per element of their result."""
REDUCTIONS = frozenset(
    ["reduce_sum", "reduce_max", "reduce_min", "reduce_prod", "cumsum", "reduce_and", "reduce_or"]
)


def count_flops(function: Callable[..., object], *args: object) -> float:
    """Count the floating-point operations of a function, comparisons and choices included.

    A loop counts as often as it runs, if that is known.
    """
    return _count(jax.make_jaxpr(function)(*args).jaxpr)


def _count(jaxpr: "Jaxpr") -> float:
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


def _inner(params: Mapping[str, object]) -> "Iterator[Jaxpr]":
    """Yield the programs within an operation: loop bodies, branches, calls."""
    for value in params.values():
        for item in value if isinstance(value, (tuple, list)) else (value,):
            jaxpr: Any = getattr(item, "jaxpr", item)
            if hasattr(jaxpr, "eqns"):
                yield jaxpr


def step_cost(experiment: Experiment) -> dict[str, float]:
    """Return the cost per creature and step, controller and episode statistics included.

    flops_asked: floating-point operations of the program as written. flops: of the compiled one as
    XLA counts them; it computes some values twice rather than store them. bytes: read and written
    by the compiled kernels, mostly in the cache. state_bytes: carried from step to step.
    """
    simulator, lanes = experiment.simulator, experiment.simulator.lanes
    lane = jax.eval_shape(partial(_lanes, experiment, lanes), experiment.abstract().genomes)
    # Private access, only here: the rollout's loop around the step would hide the step's own cost.
    step = partial(simulator._step, jnp.int32(0))
    compiled = jax.jit(step).lower(lane).compile().cost_analysis() or {}
    state = sum(leaf.size * leaf.dtype.itemsize for leaf in jax.tree.leaves(lane))
    costs = {
        "flops_asked": count_flops(step, lane),
        "flops": compiled.get("flops", float("nan")),
        "transcendentals": compiled.get("transcendentals", float("nan")),
        "bytes": compiled.get("bytes accessed", float("nan")),
        "state_bytes": float(state),
    }
    return {name: value / lanes for name, value in costs.items()}


def distance_to_limit(
    cost: dict[str, float], peak: dict[str, float], computed_rate: float
) -> dict[str, object]:
    """Return the shares of the measured peaks that `computed_rate` creature-steps per second use.

    A share of 1 is the machine's limit.
    """
    bound = {
        "flops": peak["flops"] / cost["flops_asked"],
        "cache_bytes": peak["cache_bytes"] / cost["bytes"],
        "memory_bytes": peak["memory_bytes"] / (2 * cost["state_bytes"]),
    }
    return {
        "computed_steps_per_second": computed_rate,
        "bound_steps_per_second": bound,
        "share_of_bound": {name: computed_rate / limit for name, limit in bound.items()},
    }


def _lanes(experiment: Experiment, lanes: int, genomes: object) -> Lane:
    """Start as many simulations as a device holds, of the first of genomes [N, ...]."""
    simulator = experiment.simulator
    genomes = jax.tree.map(lambda leaf: leaf[None, :1], genomes)
    starts, settings = jax.tree.map(
        lambda leaf: leaf[None], (experiment.row.starts, experiment.row.settings)
    )
    jobs = jnp.zeros(lanes, jnp.int32)
    plans = jax.vmap(jax.vmap(simulator.controller.prepare, (0, None)))(
        genomes, settings.controller
    )
    own = simulator._own_starts(genomes, starts)
    lane = jax.vmap(partial(simulator._fresh_lane, plans, starts, settings, own))(jobs, jobs)
    return jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, simulator.plant.lane_axis), lane)
