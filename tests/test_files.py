"""Reads accept only regular files within bounds; writes are complete or change nothing."""

import errno
import json
import os
from pathlib import Path

import pytest

from mjxgait.errors import UserError
from mjxgait.files import (
    MOST_DEPTH,
    DamagedFile,
    read_bytes,
    read_json,
    read_lines,
    read_text,
    replaced,
    write_text,
)


def put(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def device(path: Path) -> Path:
    path.symlink_to("/dev/zero")
    return path


@pytest.mark.skipif(os.name != "posix", reason="needs pipes and devices")
@pytest.mark.parametrize("make", [folder, pipe, device])
def test_anything_but_a_regular_file_is_refused_at_once(make, tmp_path: Path):
    path = make(tmp_path / "champion.json")
    with pytest.raises(DamagedFile, match=f"^{path}: "):
        read_bytes(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"x" * 11, "larger than"),
        (b"\xff\xfe", "UTF-8"),
        (b"{", "damaged"),
        (b"[" * 100_000, "nested deeper"),
        (b"[" * MOST_DEPTH * 2 + b"]" * MOST_DEPTH * 2, "nested deeper"),
        (b"1" + b"0" * 400, "too large"),
        (b"1" + b"0" * 9000, "damaged"),
        (rb'"\ud800"', "cannot be shown"),
        (rb'{"a": ["\u001b[2J"]}', "cannot be shown"),
    ],
)
def test_content_that_the_program_never_writes_is_refused(
    content: bytes, words: str, tmp_path: Path
):
    path = put(tmp_path / "a.json", content)
    with pytest.raises(DamagedFile, match=words) as refused:
        read_text(path, 10) if words == "larger than" else read_json(path)
    assert str(path) in str(refused.value)


def test_a_missing_file_is_reported(tmp_path: Path):
    with pytest.raises(UserError, match="no such file"):
        read_json(tmp_path / "a.json")
    assert read_lines(tmp_path / "a.jsonl") == []


def test_only_the_last_line_may_be_cut_off(tmp_path: Path):
    path = put(tmp_path / "a.jsonl", b'{"a": 1}\n{"a": 2}\n{"a"')
    assert read_lines(path) == [{"a": 1}, {"a": 2}]
    for damaged in (b"5", b"[1, 2]", b'{"a"'):
        put(path, b'{"a": 1}\n' + damaged + b'\n{"a": 3}\n')
        with pytest.raises(DamagedFile, match=r"line 2: .*take the line out"):
            read_lines(path)


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = put(tmp_path / "a.txt", b"old")

    def full(self: Path, data: bytes) -> int:
        with open(self, "wb") as file:
            file.write(data[:1])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        write_text(path, "new")
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_a_link_stays_and_its_target_is_replaced(tmp_path: Path):
    real = put(tmp_path / "real.png", b"old")
    (tmp_path / "link.png").symlink_to(real)
    with replaced(tmp_path / "link.png") as beside:
        assert beside.suffix == ".png"
        beside.write_bytes(b"new")
    assert (tmp_path / "link.png").is_symlink()
    assert real.read_bytes() == b"new"


def test_a_device_is_written_directly():
    write_text(Path(os.devnull), "text")
    assert not Path(os.devnull).is_file()


def test_json_values_survive_the_file(tmp_path: Path):
    held = {"a": [1, -2.5, None, True, "ü\n"], "b": {}}
    write_text(tmp_path / "a.json", json.dumps(held))
    assert read_json(tmp_path / "a.json") == held
