"""Test of a GL backend in a separate process: `python -m mjxgait.rendering.gl_probe` makes one
context.
"""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from mjxgait.processes import python_command, safe_environment

OFF = ("disable", "disabled", "off", "false", "0")
"""Values of MUJOCO_GL for no GL."""
PATIENCE = 5.0
"""Longest time for a context, s."""


def candidates(wanted: str | None) -> list[str]:
    """Return the GL backends to try. wanted: value of MUJOCO_GL, the only one to try."""
    if wanted:
        return [wanted]
    return ["egl", "osmesa"] if sys.platform == "linux" else ["default"]


def environment_of(backend: str) -> dict[str, str]:
    """Return the environment of a process that draws with a backend."""
    chosen = {} if backend == "default" else {"MUJOCO_GL": backend, "PYOPENGL_PLATFORM": backend}
    return {key: value for key, value in safe_environment().items() if key != "MUJOCO_GL"} | chosen


def working(backends: list[str]) -> list[str]:
    """Return the backends that make a context, tried side by side."""
    with ThreadPoolExecutor() as pool:
        found = list(pool.map(_works, backends))
    return [backend for backend, works in zip(backends, found, strict=True) if works]


def _works(backend: str) -> bool:
    try:
        done = subprocess.run(
            python_command("mjxgait.rendering.gl_probe"),
            env=environment_of(backend),
            capture_output=True,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


if __name__ == "__main__":
    import mujoco

    mujoco.GLContext(64, 64).make_current()
