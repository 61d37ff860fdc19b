"""Facts about the measuring machine, and the measured peak of its cores."""

import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.cores import cores, process_per_core

TRIES = 20


def machine_facts() -> dict[str, Any]:
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
