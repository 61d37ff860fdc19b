"""Where the WebAssembly build of a page with physics comes from, without a network."""

import io
import tarfile

import pytest
from web.engine import engine_folder

from mjxgait.errors import UserError
from mjxgait.web.wasm import CHECKSUMS, VERSION, cache_folder, engine_from

NPM = """#!/bin/sh
echo "$@" >> "{folder}/asked"
{work}
"""


@pytest.fixture
def npm(tmp_path, monkeypatch):
    """Put a program `npm` with this text, or none, alone on the path; the cache is empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def put(work):
        (tmp_path / "bin").mkdir()
        monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/bin:/usr/bin" if work else "")
        if work:
            program = tmp_path / "bin" / "npm"
            program.write_text(NPM.format(folder=tmp_path, work=work), encoding="utf-8")
            program.chmod(0o755)

    return put


def archive(path, contents):
    with tarfile.open(path, "w:gz") as packed:
        for name, data in contents.items():
            member = tarfile.TarInfo(f"package/{name}")
            member.size = len(data)
            packed.addfile(member, io.BytesIO(data))


def test_npm_fetches_it_once(npm, tmp_path):
    folder = engine_folder()
    contents = {name: (folder / name).read_bytes() for name in CHECKSUMS}
    archive(tmp_path / "made.tgz", contents | {"../../evil": b"outside"})
    npm(f'cp "{tmp_path / "made.tgz"}" .')
    engine = engine_from(None)
    assert engine.binary == contents["mujoco.wasm"]
    assert engine_from(None) == engine
    assert (tmp_path / "asked").read_text().splitlines() == [f"pack @mujoco/mujoco@{VERSION}"]
    assert sorted(file.name for file in cache_folder().iterdir()) == sorted(CHECKSUMS)


@pytest.mark.parametrize("contents", [dict.fromkeys(CHECKSUMS, b"something else"), {}, None])
def test_what_npm_fetches_is_checked(npm, tmp_path, contents):
    if contents is None:
        (tmp_path / "made.tgz").write_bytes(b"no archive")
    else:
        archive(tmp_path / "made.tgz", contents)
    npm(f'cp "{tmp_path / "made.tgz"}" .')
    with pytest.raises(UserError, match=r"mujoco\.js: not the file of @mujoco/mujoco 3"):
        engine_from(None)
    assert not cache_folder().exists()


def test_without_npm_or_network_one_sentence_names_the_way_out(npm, tmp_path):
    npm("echo 'npm error code ENOTFOUND' >&2; exit 1")
    with pytest.raises(UserError, match=r"ENOTFOUND.*network.*--wasm"):
        engine_from(None)
    assert not cache_folder().exists()


def test_a_missing_npm_is_named(npm):
    npm("")
    with pytest.raises(UserError, match=r"install npm, or .*--wasm"):
        engine_from(None)


def test_a_named_folder_must_hold_the_build(tmp_path):
    with pytest.raises(UserError, match=r"mujoco\.js: no such file"):
        engine_from(tmp_path)
    for name in CHECKSUMS:
        (tmp_path / name).write_bytes(b"another")
    with pytest.raises(UserError, match="not the file of"):
        engine_from(tmp_path)
    assert engine_from(engine_folder()).script.startswith("var loadMujoco")
