"""Checkpoints are whole or refused; each refusal names a way out."""

import dataclasses
import json
import logging
import os
import re
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from evolution.test_evolution import advance, begin, inputs, toy

from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import EvolutionState
from mjxgait.training.checkpoint import FOLDER, Checkpoints

DIGEST = "0123456789abcdef"


@pytest.fixture(scope="module")
def evolution():
    return toy()


@pytest.fixture(scope="module")
def states(evolution) -> list[EvolutionState]:
    """The states of generations 0 to 6."""
    given, found = inputs(evolution), []
    state = begin(*given, key_of(0))
    for _ in range(7):
        state, *_ = advance(*given, state)
        found.append(state)
    return found


@pytest.fixture
def run(tmp_path: Path, states: list[EvolutionState]) -> Path:
    """A run folder with checkpoints of generations 0 to 6, every third of which is kept."""
    checkpoints = Checkpoints(tmp_path, keep_every=3)
    for state in states:
        checkpoints.save(state, "toy", DIGEST)
    checkpoints.close()
    return tmp_path


def restore(run: Path, evolution, digest: str = DIGEST, **where) -> EvolutionState:
    return Checkpoints(run).restore(
        jax.eval_shape(lambda: evolution.init(key_of(0), 1, 1, 1)), digest, **where
    )


def test_the_latest_three_and_every_third_are_kept(run: Path):
    assert Checkpoints(run).generations() == [0, 3, 4, 5, 6]


def test_a_restored_state_equals_the_saved_one_bit_for_bit(
    run: Path, states: list[EvolutionState], evolution
):
    for wanted, generation in ((states[6], None), (states[3], 3)):
        found = restore(run, evolution, generation=generation)
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
            if jnp.issubdtype(a.dtype, jax.dtypes.prng_key):
                a, b = jax.random.key_data(a), jax.random.key_data(b)
            assert a.dtype == b.dtype
            assert np.array_equal(a, b)


def test_a_restored_key_continues_the_saved_sequence(
    run: Path, states: list[EvolutionState], evolution
):
    restored, whole = (
        advance(*inputs(evolution), jax.device_get(state))[0]
        for state in (restore(run, evolution), states[6])
    )
    assert np.array_equal(restored.fitness, whole.fitness)


def corrupt(run: Path, generation: int) -> None:
    """Flips bytes in the middle of the files that hold the arrays of a checkpoint."""
    for path in (run / FOLDER / str(generation) / "state").rglob("d/*"):
        data = bytearray(path.read_bytes())
        middle = len(data) // 2
        data[middle : middle + 16] = bytes(16 * [255])
        path.write_bytes(data)


def test_a_damaged_checkpoint_is_refused_and_the_newest_intact_one_offered(run: Path, evolution):
    corrupt(run, 6)
    corrupt(run, 5)
    with pytest.raises(
        UserError,
        match=r"checkpoints/6: the checkpoint is damaged .*generation 4 is intact: `mjxgait train "
        r"--resume .* --generation 4`",
    ):
        restore(run, evolution)


def test_a_cut_off_checkpoint_is_refused(run: Path, evolution):
    for path in (run / FOLDER / "6" / "state").rglob("*"):
        if path.is_file():
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(UserError, match="damaged"):
        restore(run, evolution)


def test_values_changed_by_hand_are_noticed(run: Path, evolution):
    """Even where the storage format finds no error: the manifest has a hash of the values."""
    manifest = run / FOLDER / "6" / "manifest" / "metadata"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"arrays": "0" * 64}))
    with pytest.raises(UserError, match="not those that were written"):
        restore(run, evolution)


def test_another_body_is_refused(run: Path, evolution):
    with pytest.raises(UserError, match="belongs to another body than toy as it is now"):
        restore(run, evolution, digest="f" * 16)


def test_another_schema_is_refused(run: Path, evolution):
    manifest = run / FOLDER / "6" / "manifest" / "metadata"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"schema": 99}))
    with pytest.raises(UserError, match="written with schema 99, this version reads 2"):
        restore(run, evolution)


def test_other_settings_are_refused_with_the_array_that_differs(run: Path):
    with pytest.raises(
        UserError, match=r"does not fit the settings of this run: born is \(\(20,\), 'int32'\)"
    ):
        restore(run, toy(population=12))


def test_a_missing_generation_lists_the_stored_ones(run: Path, evolution):
    with pytest.raises(UserError, match="no checkpoint of generation 2; there are 0, 3, 4, 5, 6"):
        restore(run, evolution, generation=2)


def test_a_run_without_checkpoints_says_so(tmp_path: Path, evolution):
    with pytest.raises(UserError, match="no checkpoint yet; the run ended before"):
        restore(tmp_path, evolution)


def test_a_half_written_checkpoint_does_not_count(run: Path, evolution):
    """A kill during a save leaves a temporary folder, which is not a checkpoint."""
    (run / FOLDER / "7.orbax-checkpoint-tmp-123").mkdir()
    assert Checkpoints(run).generations()[-1] == 6
    assert int(restore(run, evolution).generation) == 6


def test_resuming_an_earlier_checkpoint_drops_the_later_ones(
    run: Path, states: list[EvolutionState], evolution
):
    (run / FOLDER / "notes.txt").write_text("the user's own")
    checkpoints = Checkpoints(run)
    assert checkpoints.drop_after(3) == [4, 5, 6]
    checkpoints.save(states[4], "toy", DIGEST)
    checkpoints.close()
    assert Checkpoints(run).generations() == [0, 3, 4]
    assert int(restore(run, evolution).generation) == 4
    assert (run / FOLDER / "notes.txt").exists()


def test_nothing_is_dropped_where_nothing_is_later(run: Path):
    assert Checkpoints(run).drop_after(6) == []
    assert Checkpoints(run).generations() == [0, 3, 4, 5, 6]


def test_a_damaged_checkpoint_is_dropped_too(run: Path, states: list[EvolutionState]):
    """The way out offered for a damaged checkpoint works."""
    corrupt(run, 6)
    checkpoints = Checkpoints(run)
    assert checkpoints.drop_after(5) == [6]
    checkpoints.save(states[6], "toy", DIGEST)
    checkpoints.close()
    assert Checkpoints(run).generations()[-1] == 6


def test_a_program_error_is_not_blamed_on_the_disk(
    tmp_path: Path, states: list[EvolutionState], monkeypatch: pytest.MonkeyPatch
):
    checkpoints = Checkpoints(tmp_path)

    def mistaken(*_: object, **__: object) -> None:
        raise KeyError("born")

    monkeypatch.setattr(checkpoints._manager, "save", mistaken)
    checkpoints.save(states[0], "toy", DIGEST)
    with pytest.raises(KeyError, match="born"):
        checkpoints.save(states[1], "toy", DIGEST)
    with pytest.raises(KeyError, match="born"):
        checkpoints.close()


FILLS = """
import dataclasses, resource, sys
from pathlib import Path
import jax
from evolution.test_evolution import begin, inputs, toy
from mjxgait.errors import UserError
from mjxgait.training import checkpoint
from mjxgait.evolution.chance import key_of

begun = begin(*inputs(toy()), key_of(0))
state, later = (dataclasses.replace(begun, generation=jax.numpy.int32(g)) for g in (0, 1))
limits = resource.getrlimit(resource.RLIMIT_FSIZE)
for folder in sys.argv[1:]:
    checkpoints = checkpoint.Checkpoints(Path(folder))
    checkpoints.save(state, "toy", "0" * 16)
    checkpoints.wait()
    if folder.endswith("after the trial"):
        checkpoint.try_room = lambda *_: None
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    said = []
    for write in (lambda: checkpoints.save(later, "toy", "0" * 16), checkpoints.close):
        try:
            write()
        except UserError as error:
            said.append(error)
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    print(said[0], flush=True)
"""


def test_a_full_disk_prints_one_sentence_and_nothing_else(tmp_path: Path):
    """A limit of 100 bytes per file stands for a full disk, before and after the check for room."""
    folders = [tmp_path / moment for moment in ("before", "after the trial")]
    done = subprocess.run(
        [sys.executable, "-c", FILLS, *map(str, folders)],
        capture_output=True,
        text=True,
        timeout=100,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "JAX_PLATFORMS": "cpu"},
    )
    assert done.stderr == ""
    sentences = done.stdout.splitlines()
    for folder, sentence in zip(folders, sentences, strict=True):
        assert re.fullmatch(r".*File too large; .*make room and go on with --resume", sentence)
        assert Checkpoints(folder).generations() == [0]


def test_a_state_is_a_pytree_that_holds_everything(states: list[EvolutionState]):
    assert {field.name for field in dataclasses.fields(EvolutionState)} >= {
        "key",
        "genomes",
        "terms",
        "forced",
        "best_history",
    }
    assert all(hasattr(leaf, "dtype") for leaf in jax.tree.leaves(states[0]))


@pytest.mark.parametrize(
    ("file", "level", "shown"),
    [
        ("/lib/orbax/checkpoint/checkpoint_manager.py", logging.WARNING, False),
        ("/lib/orbax/checkpoint/checkpoint_manager.py", logging.ERROR, True),
        ("/lib/jax/_src/xla_bridge.py", logging.WARNING, True),
    ],
)
def test_advice_on_a_slow_disk_stays_off_the_screen(tmp_path, file, level, shown, caplog):
    Checkpoints(tmp_path).close()
    log = logging.getLogger("absl")
    log.handle(log.makeRecord("absl", level, file, 1466, "Waiting for previous save", (), None))
    assert ("Waiting" in caplog.text) == shown
