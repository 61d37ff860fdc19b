"""Workers compile a program one after the other with a cache, and all at once without."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import pytest

from mjxgait.distributed.worker import _turn

filelock = pytest.importorskip("filelock", reason='needs "mjxgait[cluster]"')


@pytest.fixture
def cache(tmp_path: Path) -> Iterator[Path]:
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path / "cache"))
    yield tmp_path / "cache"
    jax.config.update("jax_compilation_cache_dir", before)


def another_takes(name: str) -> bool:
    """Whether another worker could compile this now."""

    def take() -> bool:
        try:
            with _turn(name, patience=0):
                return True
        except filelock.Timeout:
            return False

    with ThreadPoolExecutor(1) as other:
        return other.submit(take).result()


def test_while_one_compiles_a_program_the_others_wait(cache: Path):
    with _turn("walk"):
        assert not another_takes("walk")
        assert another_takes("hop")
    assert another_takes("walk")


def test_without_a_usable_cache_no_worker_waits(cache: Path):
    cache.write_text("in the way")
    with _turn("walk"):
        assert another_takes("walk")
