"""FBX in and out through Blender: what is found and said without one, and skins with one."""

import json
import os
import re
import shlex
import stat
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from animation.skinned import treading_loop
from helpers import said_by
from importer.rigs import glb
from rendering.made_up import treading, write_run
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist

import mjxgait
from mjxgait.animation.clips import fbx
from mjxgait.animation.clips.fbx import find_blender
from mjxgait.animation.clips.read_glb import rig_of_glb
from mjxgait.animation.export import export_glb, export_onto, read_character
from mjxgait.animation.keys import bring
from mjxgait.cli import doctor
from mjxgait.creature import Creature
from mjxgait.creature.load import creature_of
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model
from mjxgait.processes import safe_environment

SCRIPT = Path(__file__).with_name("fbx_in_blender.py")
COPIES = """
import shutil, sys
verb, source, made, *more = sys.argv[sys.argv.index("--") + 1 :]
shutil.copyfile(more[2] if len(more) > 2 else source, made)
"""
"""A Blender for which FBX is GLB by another name, and that only ever copies the character."""
posix = pytest.mark.skipif(os.name == "nt", reason="starts a script by its first line")


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """No Blender on this machine."""
    monkeypatch.delenv(fbx.VARIABLE, raising=False)
    monkeypatch.setattr(fbx.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(fbx.shutil, "which", lambda name: None)


def script(path: Path, text: str) -> Path:
    """An executable of a Python text."""
    path.write_text(f'#!/bin/sh\nexec {shlex.join([sys.executable, "-c", text])} "$@"\n')
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


@pytest.fixture
def copying(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(fbx.VARIABLE, str(script(tmp_path / "python", COPIES)))
    file = tmp_path / "dog.fbx"
    file.write_bytes(glb())
    return file


def test_a_blender_is_found_in_three_ways(nowhere: None, monkeypatch: pytest.MonkeyPatch):
    assert find_blender() == []
    monkeypatch.setattr(fbx.shutil, "which", lambda name: f"/bin/{name}")
    assert find_blender() == [
        *("/bin/blender", "--background", "--factory-startup"),
        *("--python-exit-code", "1", "--python"),
    ]
    monkeypatch.setattr(fbx.importlib.util, "find_spec", lambda name: name)
    assert find_blender() == [sys.executable]
    monkeypatch.setenv(fbx.VARIABLE, "/opt/python")
    assert find_blender() == ["/opt/python"]
    monkeypatch.setenv(fbx.VARIABLE, "/Applications/Blender.app/Contents/MacOS/Blender")
    assert find_blender()[1] == "--background"


def test_without_a_blender_one_sentence_names_the_ways(
    nowhere: None, stool_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture
):
    file, stool = tmp_path / "dog.fbx", mjxgait.open(stool_run).creature
    file.write_text("x")
    said = (
        said_by(capsys, "import", file, "--out", tmp_path / "env", code=2),
        said_by(capsys, "export", stool_run, "--out", tmp_path / "walk.fbx", code=2),
        said_by(capsys, "export", stool_run, "--onto", file, "--out", tmp_path / "a.glb", code=2),
    )
    with pytest.raises(UserError) as raised:
        bring(stool, file)
    for sentence in (*said, str(raised.value)):
        assert ".fbx: FBX takes a Blender, and none is here" in sentence
        for way in ("install bpy", fbx.VARIABLE, "blender on the PATH", "glTF binary (.glb)"):
            assert way in sentence
    assert [*tmp_path.iterdir()] == [file]
    found = doctor.blender([])
    assert (found.needed, fbx.VARIABLE in found.line) == (False, True)


def test_doctor_names_the_blender(tmp_path: Path):
    assert doctor.blender([sys.executable]).remedy == ""
    assert fbx.VARIABLE in doctor.blender([str(tmp_path / "python")]).remedy


@posix
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("raise ModuleNotFoundError(\"No module named 'bpy'\")", "python: has no bpy; install"),
        ("raise RuntimeError('cut off')", r"Blender cannot read it \(RuntimeError: cut off\)"),
        ("raise SystemExit(3)", r"Blender cannot read it \(exit code 3\)"),
        ("", r"Blender cannot read it \(exit code 0\)"),
        ("import time; time.sleep(60)", "did not end within 1 s"),
        (None, r"python: cannot be started \(No such file or directory\)"),
    ],
    ids=["no bpy", "an error", "an exit code", "nothing", "too long", "not there"],
)
def test_what_goes_wrong_in_blender_is_one_sentence(
    text: str | None, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    python, file = tmp_path / "python", tmp_path / "dog.fbx"
    if text is not None:
        script(python, text)
    monkeypatch.setenv(fbx.VARIABLE, str(python))
    monkeypatch.setattr(fbx, "PATIENCE", 1.0 if text and "sleep" in text else 30.0)
    file.write_text("x")
    with pytest.raises(UserError, match=words) as raised:
        import_model(file)
    assert str(file) in str(raised.value)
    assert "\n" not in str(raised.value)


@posix
def test_errors_name_the_users_file(copying: Path):
    copying.write_bytes(b"glTF is no more")
    for read in (read_character, import_model):
        with pytest.raises(UserError, match="not a GLB file") as raised:
            read(copying)
        assert str(raised.value).startswith(str(copying))
        assert "made.glb" not in str(raised.value)


@posix
def test_a_run_of_an_fbx_file_is_put_onto_it_and_the_file_stays(
    copying: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    """By itself, as a walk of a GLB file is; the copying Blender writes the character back."""
    folder = copying.parent
    creature = creature_of(import_model(copying, ImportChoices(apart=False)).files)
    assert creature.settings.rig.file == "dog.fbx"
    run = write_run(folder / "run", creature, treading(creature, degrees=6.0))
    for name in ("walk.glb", "walk.fbx"):
        said = said_by(capsys, "export", run, "--out", folder / name, code=0)
        assert f"on your character {copying}" in said
        assert 'animation "walk-loop"' in said
    assert (folder / "walk.fbx").read_bytes() == glb(), "all but the walk is of the user's file"
    assert "walk-loop" in read_character(folder / "walk.glb").clips
    for more in ((), ("--onto", "none")):
        said = said_by(capsys, "export", run, "--out", copying, *more, code=2)
        assert "is your character, which stays" in said
    assert copying.read_bytes() == glb()
    monkeypatch.setenv(fbx.VARIABLE, str(folder / "no python"))
    said = said_by(capsys, "export", run, "--out", folder / "other.glb", code=0)
    assert "shows the body of capsules, because" in said
    assert not [each for each in folder.iterdir() if each.name.startswith(".")]


Seen = Callable[[Path, str], tuple[dict[str, np.ndarray], dict]]


def blender(*words: object) -> None:
    command = [*find_blender()[:1], str(SCRIPT), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, env=safe_environment())
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two characters, cm.fbx and m.fbx."""
    if len(find_blender()) != 1:
        pytest.skip(f"needs Blender as a module: name a Python with bpy in {fbx.VARIABLE}")
    folder = tmp_path_factory.mktemp("fbx")
    (folder / "dog.glb").write_bytes(glb(handles=False))
    blender("make", folder / "dog.glb", folder)
    return folder


@pytest.fixture(scope="module")
def creatures(made: Path) -> dict[str, Creature]:
    return {
        kind: creature_of(import_model(made / f"{kind}.fbx", ImportChoices(apart=False)).files)
        for kind in ("cm", "m")
    }


def seen(file: Path, name: str, rate: int = 30) -> tuple[np.ndarray, np.ndarray, dict]:
    """Vertices at rest [V, 3] and by frame [F, V, 3], and what else Blender shows."""
    out = file.with_suffix(f"{file.suffix}.npz")
    blender("see", file, name, rate, out)
    with np.load(out) as found:
        return found["still"], found["frames"], json.loads(str(found["told"]))


def assert_same_motion(one: Path, other: Path, names: tuple[str, str], rate: int) -> dict:
    """Check that two files move their skins alike; return what is said of the second."""
    still, frames, _ = seen(one, names[0], rate)
    again, shown, told = seen(other, names[1], rate)
    size = np.ptp(still, axis=0).max()
    assert 0.5 < size < 1.5, "m"
    place = np.arange(len(still))
    if again.shape != still.shape:  # GLB has a vertex more for each normal
        _, place = cKDTree(still).query(again)
    np.testing.assert_allclose(again, still[place], atol=1e-4 * size)
    assert shown.shape == (len(frames), len(again), 3)
    np.testing.assert_allclose(shown, frames[:, place], atol=1e-4 * size)
    assert np.ptp(shown, axis=0).max() > 0.01 * size, "the walk moves"
    return told


def unit(file: Path) -> float:
    """Centimetres of an FBX file's unit, as it states."""
    number = re.search(rb"UnitScaleFactor.{27}D(.{8})", file.read_bytes(), re.DOTALL)
    return struct.unpack("<d", number[1])[0]


@pytest.mark.slow
def test_a_skeleton_is_the_same_in_metres_and_in_centimetres(
    made: Path, creatures: dict[str, Creature]
):
    first = rig_of_glb(made / "dog.glb")
    places = {}
    for kind in ("cm", "m"):
        rig = fbx.rig_of_fbx(made / f"{kind}.fbx")  # which has more bones: a root, and ends
        places[kind] = rig.places[[rig.names.index(name) for name in first.names]]
    assert places["m"] == pytest.approx(first.places, abs=1e-4)
    # The other is turned in its scene.
    assert pdist(places["cm"]) == pytest.approx(pdist(first.places), abs=1e-4)
    names = {kind: creature.settings.rig.bones for kind, creature in creatures.items()}
    assert names["cm"] == names["m"]


@pytest.mark.slow
@pytest.mark.parametrize("travelling", [False, True])
def test_the_walk_moves_the_users_own_skin(
    made: Path, creatures: dict[str, Creature], tmp_path: Path, travelling: bool
):
    """As on the GLB route, vertex by vertex; and all else of the file stays."""
    source = made / "cm.fbx"
    before, character = source.read_bytes(), read_character(source)
    loop = treading_loop(creatures["cm"])
    for name in ("walk.glb", "walk.fbx"):
        assert export_onto(loop, character, tmp_path / name, travelling) == "walk-loop"
    both = ("walk-loop", "walk-loop")
    told = assert_same_motion(tmp_path / "walk.glb", tmp_path / "walk.fbx", both, 30)
    assert (told["rate"], told["actions"]) == (30, ["Armature|nod", "walk-loop"])
    assert source.read_bytes() == before
    _, nods, was = seen(source, "Armature|nod", 24)
    assert told["lengths"]["Armature|nod"] == pytest.approx(21 * 30 / 24, abs=0.5), "frames"
    _, kept, _ = seen(tmp_path / "walk.fbx", "Armature|nod", 30)
    ends = [0, -1]
    np.testing.assert_allclose(kept[ends], nods[ends], atol=1e-4)
    assert {key: told[key] for key in ("bones", "colours", "faces")} == {
        key: was[key] for key in ("bones", "colours", "faces")
    }
    assert told["scale"] == pytest.approx(was["scale"])
    assert unit(tmp_path / "walk.fbx") == unit(source) == 1.0


@pytest.mark.slow
def test_a_file_in_metres_stays_so_and_refine_reads_the_walk_back(
    made: Path, creatures: dict[str, Creature], tmp_path: Path
):
    out, loop = tmp_path / "walk.fbx", treading_loop(creatures["m"])
    export_onto(loop, read_character(made / "m.fbx"), out)
    assert unit(out) == unit(made / "m.fbx") == 100.0
    brought = bring(creatures["m"], out, tolerance=np.radians(90.0))
    angles = loop.qpos[:, creatures["m"].joints.qpos_adr]
    assert brought.track.angles == pytest.approx(angles, abs=np.radians(1.5))


@pytest.mark.slow
def test_a_body_and_a_character_of_gltf_are_written_as_fbx(
    made: Path, creatures: dict[str, Creature], tmp_path: Path
):
    loop = treading_loop(creatures["m"])
    for name in ("body.glb", "body.fbx"):
        export_glb(loop, tmp_path / name)
    both = ("walk-loop", "walk-loop")
    assert_same_motion(tmp_path / "body.glb", tmp_path / "body.fbx", both, 30)
    export_onto(loop, read_character(made / "m.fbx"), tmp_path / "first.glb")
    export_onto(loop, read_character(tmp_path / "first.glb"), tmp_path / "walk.fbx")
    told = assert_same_motion(
        tmp_path / "first.glb", tmp_path / "walk.fbx", ("walk-loop", "walk_2-loop"), 30
    )
    assert told["actions"] == ["walk-loop", "walk_2-loop"]
    assert unit(tmp_path / "walk.fbx") == 100.0
