"""Devices: prepared, shared by a run's arrays, and compiled for."""

import os
from typing import Literal

import jax
from jax.sharding import NamedSharding, PartitionSpec

from mjxgait.cores import cores
from mjxgait.simulation.rollout import Simulator


def prepare_devices(devices: int | None = None, kind: str = "") -> None:
    """One JAX host device per core, and compiled programs kept in the user's cache folder. Call before JAX's first computation.

    Args:
      devices: another number of them.
      kind: of machine; its programs lie apart from those of others, for a home folder may be shared.
    """
    if jax.config.values["jax_num_cpu_devices"] < 0:
        jax.config.update("jax_num_cpu_devices", devices or cores())
    if jax.config.values["jax_compilation_cache_dir"] is None:
        cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        jax.config.update("jax_compilation_cache_dir", os.path.join(cache, "mjxgait", "jax", kind))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def everywhere(simulator: Simulator) -> NamedSharding:
    """Arrays that every device of a simulator has whole."""
    return NamedSharding(simulator.mesh, PartitionSpec())


Effort = Literal["best", "some", "least"]
"""Of the compiler, for a part of a generation: what it is worth."""


def compiled(lowered: jax.stages.Lowered, effort: Effort = "best") -> jax.stages.Compiled:
    """The program."""
    return lowered.compile(compiler_options=compiler_options(effort))


def compiler_options(effort: Effort) -> dict[str, str | bool]:
    """Those of this machine's compiler; the fast plant gains a third from the widest vectors, which
    XLA's CPU compiler does not use by itself.
    """
    if jax.default_backend() != "cpu":
        return {}
    if effort == "best":
        return {"xla_cpu_prefer_vector_width": "512"}
    level = {"some": "1", "least": "0"}[effort]
    return {"xla_backend_optimization_level": level, "xla_llvm_disable_expensive_passes": True}
