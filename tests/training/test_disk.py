"""Disk errors become one sentence with a way out; other errors stay as they are."""

import errno
import os
from pathlib import Path

import pytest

from mjxgait.cli.training import _plot_fitness
from mjxgait.errors import UserError
from mjxgait.training.disk import disk_errors, require_writable, try_room

RUN = Path("runs/a")
WRAPPED = (
    'RESOURCE_EXHAUSTED: Error writing local file "runs/a/_sharding": Failed writing: '
    "Failed to write 1531 bytes to file 8: No space left on device [os_error_code='28']"
)
"""TensorStore's message for a full disk."""


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "x"), "No space left on device; the run is safe .*: make room"),
        (OSError(errno.EDQUOT, "x"), "quota exceeded; .*: make room and go on with --resume"),
        (OSError(errno.EROFS, "x"), "Read-only file system; .*: make it writable and go on"),
        (PermissionError(errno.EACCES, "x"), "Permission denied; .*: make it writable and"),
        (FileNotFoundError(errno.ENOENT, "x"), "No such file or directory; .*: bring it back"),
        (ValueError(WRAPPED), "No space left on device; .*: make room and go on with --resume"),
    ],
    ids=["full", "quota", "read-only", "forbidden", "gone", "full, by TensorStore"],
)
def test_a_disk_error_gives_one_sentence(error: Exception, words: str):
    with pytest.raises(UserError, match=f"^runs/a: cannot be written: .*{words}"), disk_errors(RUN):
        raise error


@pytest.mark.parametrize(
    "error",
    [
        KeyError("best"),
        ValueError("shapes (3,) and (4,) differ"),
        OSError("an error without a number"),
        TimeoutError("a thread has waited too long"),
        BlockingIOError(errno.EAGAIN, "x"),
        UserError("already a sentence"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_any_other_error_is_unchanged(error: Exception):
    with pytest.raises(type(error)) as caught, disk_errors(RUN):
        raise error
    assert caught.value is error


def test_the_caller_states_what_is_safe_and_what_to_do():
    words = "^a.png: .*; the run itself is safe: make room and draw it again$"
    with (
        pytest.raises(UserError, match=words),
        disk_errors(Path("a.png"), "the run itself is safe", "draw it again"),
    ):
        raise OSError(errno.ENOSPC, "x")


def test_checking_for_room_leaves_no_file(tmp_path: Path):
    try_room(tmp_path, 100_000)
    assert not list(tmp_path.iterdir())
    with pytest.raises(OSError, match="No such file"):
        try_room(tmp_path / "gone", 1)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full, a full disk")
def test_a_full_disk_while_drawing_the_curve_gives_one_sentence(tmp_path: Path):
    (tmp_path / "fitness.png").symlink_to("/dev/full")
    names = ("best", "mean", "lower_quartile", "upper_quartile")
    line = '{"generation": %d, "forced": false, ' + ", ".join(f'"{n}": 1.0' for n in names) + "}\n"
    (tmp_path / "metrics.jsonl").write_text("".join(line % i for i in range(3)))
    with pytest.raises(UserError, match=r"fitness\.png: .*No space.* draw it with mjxgait plot"):
        _plot_fitness(tmp_path)


def test_checking_that_a_file_is_writable_changes_nothing(tmp_path: Path):
    kept = tmp_path / "kept.txt"
    kept.write_text("as it was")
    require_writable(kept)
    require_writable(tmp_path / "new.txt")
    assert [file.name for file in tmp_path.iterdir()] == ["kept.txt"]
    assert kept.read_text() == "as it was"
    for path, told in (
        (tmp_path, "cannot be written"),
        (tmp_path / "no" / "a.txt", "the folder .* does not exist"),
        (kept / "a.txt", "the folder .* does not exist"),
    ):
        with pytest.raises(UserError, match=told):
            require_writable(path)
