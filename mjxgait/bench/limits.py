"""Distance of the step from the limits of the cores.

Operations and bytes are counted in the compiled step and compared with a measured peak.
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.bench.flops import count_flops
from mjxgait.simulation.rollout import Lane
from mjxgait.training.experiment import Experiment


def step_cost(experiment: Experiment) -> dict[str, float]:
    """Return the cost per creature and step, controller and tally included.

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
) -> dict[str, Any]:
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


def _lanes(experiment: Experiment, lanes: int, genomes: Any) -> Lane:
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
