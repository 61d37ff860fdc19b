"""JAX devices: setup, placement of a run's arrays, and compiler options."""

import os
from typing import Literal

import jax
from jax.sharding import NamedSharding, PartitionSpec

from mjxgait.cores import cores
from mjxgait.simulation.rollout import Simulator


def prepare_devices(devices: int | None = None, kind: str = "") -> None:
    """Set one JAX host device per core, and keep compiled programs in the user's cache folder.

    Call before JAX's first computation.

    Args:
      devices: number of devices; one per core by default.
      kind: machine type. Each type has its own program cache, because a home folder may be shared.
    """
    if jax.config.values["jax_num_cpu_devices"] < 0:
        jax.config.update("jax_num_cpu_devices", devices or cores())
    if jax.config.values["jax_compilation_cache_dir"] is None:
        cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        jax.config.update("jax_compilation_cache_dir", os.path.join(cache, "mjxgait", "jax", kind))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def everywhere(simulator: Simulator) -> NamedSharding:
    """Return the sharding that puts whole arrays on every device of a simulator."""
    return NamedSharding(simulator.mesh, PartitionSpec())


Effort = Literal["best", "some", "least"]
"""Compiler effort for a part of a generation."""


def compiled(lowered: jax.stages.Lowered, effort: Effort = "best") -> jax.stages.Compiled:
    """Compile a lowered program."""
    return lowered.compile(compiler_options=compiler_options(effort))


def compiler_options(effort: Effort) -> dict[str, str | bool]:
    """Return the compiler options for this machine.

    The widest vectors make the lane-major plant a third faster; XLA's CPU compiler does not use
    them by default.
    """
    if jax.default_backend() != "cpu":
        return {}
    if effort == "best":
        return {"xla_cpu_prefer_vector_width": "512"}
    level = {"some": "1", "least": "0"}[effort]
    return {"xla_backend_optimization_level": level, "xla_llvm_disable_expensive_passes": True}
