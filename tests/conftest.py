import contextlib
import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

# One cache of compiled programs for all workers and for the commands that tests start. Without the
# second line it omits the hundreds of programs that compile in less than a second.
os.environ.setdefault(
    "JAX_COMPILATION_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache" / "jax")
)
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
# Most tests and their commands spend most of their time on compilation; see `as_shipped`.
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")
# Runs are compared bit by bit, and the distribution of lanes to devices affects the last bit.
os.environ["JAX_NUM_CPU_DEVICES"] = "2"

import jax
import psutil
import pytest
from helpers import STOOL

from mjxgait.config.layers import data_folder
from mjxgait.creature import Creature, load_creature

OLDER = "--xla_cpu_use_fusion_emitters=false"
"""XLA's older code generation for fused operations, which needs a third less compile time."""
if version("jaxlib").startswith("0.10."):  # an unknown flag ends the process
    os.environ["XLA_FLAGS"] = f"{OLDER} {os.environ.get('XLA_FLAGS', '')}".strip()

FOLDERS = sorted(path.parent for path in data_folder("envs").glob("*/creature.toml"))
SHIPPED = [path.name for path in FOLDERS if not load_creature(path).settings.creature.grows]
"""Creatures that have a body before training."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of tests/end_to_end."""
    parser.addoption(
        "--thorough",
        action="store_true",
        help="run also what is left out for time: tests marked `thorough`, whole trainings",
    )
    parser.addoption(
        "--matrix", type=Path, help="append a row of Markdown for each training that is tried"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip tests marked `thorough`, unless `--thorough` is given or a fault is planted."""
    if config.getoption("--thorough") or "MJXGAIT_PLANTED" in os.environ:
        return
    for item in items:
        if mark := item.get_closest_marker("thorough"):
            item.add_marker(pytest.mark.skip(f"{mark.args[0]}; --thorough runs it"))


def pytest_collection_finish() -> None:
    """Keep modules and lists of tests out of the garbage collection, and collect less often.

    Tracing makes many objects and little garbage.
    """
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)
    write_without_waiting()


def write_without_waiting() -> None:
    """Leave checkpoints to the system to write: no test takes the power away.

    Tests write hundreds, and waiting for the disk is half of the time that one takes.
    """
    stored = sys.modules.get("orbax.checkpoint._src.serialization.tensorstore_utils")
    for name in ("_BASE_TS_CONTEXT", "_DEFAULT_OCDBT_TS_CONTEXT"):
        getattr(stored, name, {})["file_io_sync"] = False


MOST_MEMORY = max(2 * 2**30, psutil.virtual_memory().total // 6)
"""Bytes of a worker above which compiled programs are dropped; the disk cache keeps them."""


@pytest.fixture(scope="module", autouse=True)
def give_memory_back() -> Iterator[None]:
    """Drop compiled programs if they take much memory, and return what the C library holds."""
    yield
    if psutil.Process().memory_info().rss > MOST_MEMORY:
        jax.clear_caches()
        gc.collect()
    with contextlib.suppress(AttributeError, OSError, TypeError):  # only glibc has the function
        ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(scope="session")
def stool() -> Creature:
    """The smallest creature: a plate on four one-joint legs."""
    return load_creature(STOOL)


@pytest.fixture(scope="session", params=SHIPPED)
def shipped(request: pytest.FixtureRequest) -> Creature:
    """Each shipped creature."""
    return load_creature(data_folder("envs") / request.param)


@pytest.fixture(scope="module")
def emitted_as_shipped() -> Iterator[None]:
    """Generate code as users get it, for lowered and compiled programs and for started commands.

    With the older code generation bits depend on the number of rows of a program.
    """
    flags, compile_it = os.environ.get("XLA_FLAGS", ""), jax.stages.Lowered.compile

    def compiled(lowered: jax.stages.Lowered, compiler_options: Any = None) -> Any:
        usual = {"xla_cpu_use_fusion_emitters": True}
        return compile_it(lowered, usual | (compiler_options or {}))

    with pytest.MonkeyPatch.context() as patch:
        if OLDER in flags:
            patch.setenv("XLA_FLAGS", flags.replace(OLDER, "").strip())
            patch.setattr(jax.stages.Lowered, "compile", compiled)
        yield


@pytest.fixture(scope="module")
def as_shipped(emitted_as_shipped: None) -> Iterator[None]:
    """`emitted_as_shipped` with all optimizations."""
    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", True)
