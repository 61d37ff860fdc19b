"""The add-on for Blender: its commands and jobs without Blender, and its buttons with it."""

import importlib.util
import json
import os
import shlex
import subprocess
import sys
import time
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pygltflib as gltf
import pytest
from animation.skinned import frames_of, skin_at
from importer.rigs import glb

import mjxgait
from addons.blender import commands
from addons.blender.commands import Choices, NotStarted, Progress, progress_after
from addons.blender.footfalls import footfalls_in
from addons.blender.job import LOG, Job
from mjxgait.processes import safe_environment

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
STEP = commands.Step("Evolving", ("mjxgait",), 0.1, 0.9)


def build(folder: Path) -> list[Path]:
    """The archives that the script writes."""
    script = ROOT / "scripts" / "build_addons.py"
    given = [sys.executable, "-P", str(script), "--out", str(folder)]
    done = subprocess.run(given, capture_output=True, text=True, check=True, env=safe_environment())
    return [Path(line) for line in done.stdout.splitlines()]


def test_the_archives_hold_what_their_programs_expect(tmp_path: Path):
    made = build(tmp_path / "dist")
    blender, godot, unity, unreal = made
    with zipfile.ZipFile(blender) as packed:
        manifest = tomllib.loads(packed.read("blender_manifest.toml").decode())
        assert {"__init__.py", "ui.py", "scene.py", "LICENSE"} <= {*packed.namelist()}
    assert manifest["version"] == mjxgait.__version__
    with zipfile.ZipFile(godot) as packed:
        assert {name.split("/")[:2][-1] for name in packed.namelist()} == {"mjxgait"}
        assert "addons/mjxgait/plugin.cfg" in packed.namelist()
    for file, script in (
        (unity, "Assets/mjxgait/Editor/RepertoireImporter.cs"),
        (unreal, "Content/Python/mjxgait/import_repertoire.py"),
    ):
        with zipfile.ZipFile(file) as packed:
            assert script in packed.namelist()
            assert "UNTRIED" in packed.read(script).decode().splitlines()[0]
    again = build(tmp_path / "again")
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in made]


def test_choices_become_options():
    asked = Choices(
        speed=0.5, gait="trot", keep_movable="neck* 'tail 1'", travelling=True, generations=9
    )
    importing, training, exporting = (
        step.words[1:] for step in commands.walk_steps("m", Path("f"), asked, 24)
    )
    assert importing == ("import", str(Path("f/character.glb")), "--out", str(Path("f/creature")),
                         "--keep", "neck*", "--keep", "tail 1")  # fmt: skip
    assert shlex.join(training).endswith(
        "--no-plots --speed 0.5bl/s --gait trot --out f/run --seed 0 --generations 9"
    )
    assert exporting[-3:] == ("--rate", "24", "--travelling")
    plain = commands.walk_steps("m", Path("f"), Choices(), 30)[1].words
    assert not {"--speed", "--gait", "--style", "--turn", "--population"} & {*plain}
    refining = commands.refine_steps("m", Path("f"), Choices(keep=0.7), 30)[1].words
    assert refining[refining.index("--keep") + 1] == "0.7"
    with pytest.raises(NotStarted, match="quotation"):
        commands.walk_steps("m", Path("f"), Choices(more="--speed '"), 30)


@pytest.mark.parametrize("kind", ["train", "refine"])
def test_the_program_takes_every_option(kind: str, capsys: pytest.CaptureFixture):
    """Its help lists each option that the add-on may give."""
    steps = commands.walk_steps if kind == "train" else commands.refine_steps
    everything = Choices(0.5, "trot", "calm", 5.0, "a", "b", 1.0, 0.5, True, 4, 2, 1)
    from mjxgait.cli import main

    for step in steps("m", Path("f"), everything, 30):
        with pytest.raises(SystemExit):
            main([step.words[1], "--help"])
        told = capsys.readouterr().out
        named = {word for word in step.words if word.startswith("--")} - {"--no-plots"}
        assert named - {word for word in named if word in told} == set()


def test_every_gait_and_style_of_the_menus_is_known():
    from mjxgait.tasks.walk.gaits import GAITS

    known = {name for names in GAITS.values() for name in names}
    assert {*commands.GAITS} - {"natural"} == known
    styles = {path.stem for path in (ROOT / "configs" / "styles").glob("*.toml")}
    assert {*commands.STYLES} == styles


def test_progress_is_read_from_lines_of_the_program():
    from rich.console import Console

    from mjxgait.config.schema import Config
    from mjxgait.training.screen import Screen

    config = Config()
    line = {"generation": 15, "best": 2.0, "mean": 1.0, "failures": 3, "episodes": 12,
            "steps_per_second": 90_000, "wall_s": 2.0, "forced": False}  # fmt: skip
    with open(os.devnull, "w") as nowhere:
        console = Console(file=nowhere, highlight=False, soft_wrap=True, markup=False, record=True)
        Screen(console).generation(line, config)
    (said,) = [t for t in console.export_text().splitlines() if t.startswith("generation")]
    found = progress_after(Progress(), STEP, said)
    assert found.share == pytest.approx(0.1 + 0.8 * 15 / config.evolution.generations)
    assert "75 % stay up" in found.text
    assert progress_after(found, STEP, "anything else") == found
    verdict = progress_after(found, STEP, "Not certified (margin -0.1). It is a trot\n").verdict
    assert verdict == "Not certified (margin -0.1). It is a trot"


def test_a_program_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(NotStarted, match="Install it in a terminal"):
        commands.find_program("")
    with pytest.raises(NotStarted, match="here/mjxgait: no such program"):
        commands.find_program("here/mjxgait")


def python(text: str) -> commands.Step:
    return commands.Step("Working", (sys.executable, "-c", text), 0.0, 1.0)


def ended(job: Job, seconds: float = 20.0) -> Job:
    """The job once it has ended by itself."""
    until = time.monotonic() + seconds
    while job.running and time.monotonic() < until:
        job.poll()
        time.sleep(0.01)
    assert not job.running
    return job


def test_steps_run_one_after_the_other(tmp_path: Path):
    job = ended(Job([python("print('Certified: one')"), python("print('two')")], tmp_path))
    assert job.done
    assert job.progress.verdict == "Certified: one"
    assert (tmp_path / LOG).read_text() == "Certified: one\ntwo\n"


def test_an_error_ends_the_job_with_the_programs_own_words(tmp_path: Path):
    fails = "import sys; print('x'); print('mjxgait: no legs', file=sys.stderr); sys.exit(2)"
    job = ended(Job([python(fails), python("open('late', 'w')")], tmp_path))
    assert (job.error, job.done) == ("no legs", False)
    assert "Traceback" in ended(Job([python("raise KeyError('k')")], tmp_path)).error
    missing = commands.Step("Working", (str(tmp_path / "none"),), 0.0, 1.0)
    assert "cannot be started" in Job([missing], tmp_path).error


@pytest.mark.skipif(os.name == "nt", reason="asks the system for processes by signal 0")
def test_cancel_ends_the_process_and_its_children(tmp_path: Path):
    child = "import time; time.sleep(60)"
    parent = (
        "import subprocess, sys, time\n"
        f"print(subprocess.Popen([sys.executable, '-c', {child!r}]).pid, flush=True)\n"
        "time.sleep(60)"
    )
    job = Job([python(parent), python("print('late')")], tmp_path)
    until = time.monotonic() + 20.0
    while not job._lines and time.monotonic() < until:
        job.poll()
        time.sleep(0.01)
    job.cancel()
    assert (job.cancelled, job.running, job.done) == (True, False, False)
    number = int(job._lines[0])
    while alive(number) and time.monotonic() < until:
        time.sleep(0.01)
    assert not alive(number)


def alive(number: int) -> bool:
    """Whether a process runs; one that has ended and waits to be collected does not."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def blender_python() -> str:
    """A Python with Blender as a module: this one, or that of MJXGAIT_BLENDER_PYTHON."""
    if importlib.util.find_spec("bpy") is not None:
        return sys.executable
    if not (named := os.environ.get("MJXGAIT_BLENDER_PYTHON")):
        pytest.skip("needs Blender as a module: name a Python with bpy in MJXGAIT_BLENDER_PYTHON")
    return named


def test_footfalls_are_read_from_the_file(tmp_path: Path):
    file = tmp_path / "walk.glb"
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0"))
    falls = [{"foot": "Paw", "down": 0.25, "up": 0.5}, {"foot": "Hand", "down": 0.0, "up": 0.3}]
    document.animations = [
        gltf.Animation(name="idle"),
        gltf.Animation(name="walk-loop", extras={"contacts": falls}),
    ]
    document.set_binary_blob(b"\0\0\0\0")
    file.write_bytes(b"".join(document.save_to_bytes()))
    assert footfalls_in(file, "walk") == [("Paw", 0.25), ("Hand", 0.0)]
    assert footfalls_in(file, "idle") == footfalls_in(file, "run") == []
    file.write_bytes(file.read_bytes()[:30])
    assert footfalls_in(file, "walk") == []


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Path]:
    """What the buttons did, in words, and the folder with Blender's exports."""
    blender, folder = blender_python(), tmp_path_factory.mktemp("blender")
    character, program = folder / "dog.glb", folder / "mjxgait"
    character.write_bytes(glb(handles=False))
    made_up = [sys.executable, str(HERE / "program.py")]
    program.write_text(f'#!/bin/sh\nexec {shlex.join(made_up)} "$@"\n')
    program.chmod(0o755)
    given = [blender, str(HERE / "in_blender.py"), str(build(folder)[0])]
    given += [str(program), str(character), str(folder)]
    own = safe_environment() | {"BLENDER_USER_RESOURCES": str(folder / "home")}
    done = subprocess.run(given, capture_output=True, text=True, env=own)
    lines = [line for line in done.stdout.splitlines() if line.startswith("told ")]
    assert lines, done.stdout[-2000:] + done.stderr[-2000:]
    return json.loads(lines[0].removeprefix("told ")), folder


@pytest.mark.slow
def test_the_button_makes_an_action(used: tuple[dict, Path]):
    told, _ = used
    assert told["installed"] == told["walked"] == told["fixed"] == ["FINISHED"]
    assert told["said"].startswith("walk: Not certified: "), "export's line"
    assert "it has not been examined" in told["said"]
    action = told["action"]
    markers = action.pop("markers")
    assert action == {"name": "walk", "range": [1, 16], "cyclic": True, "mode": "POSE"}
    assert len(markers) >= 3
    assert markers == [[*mark] for mark in footfalls_by_frame(used[1])]
    assert told["left_behind"] == 0
    assert told["kept"] == ["walk", "walk, fixed"]
    assert "no such program" in told["absent"]


def footfalls_by_frame(folder: Path) -> list[tuple[str, int]]:
    """Foot and frame of each footfall that the first run's file states."""
    first = min((folder / "runs").iterdir(), key=lambda path: path.stat().st_mtime)
    (walk,) = gltf.GLTF2.load(str(first / commands.WALK)).animations
    return sorted(
        (fall["foot"], 1 + round(walk.extras["frames_per_s"] * fall["down"]))
        for fall in walk.extras["contacts"]
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["walk.glb", "fixed.glb"])
def test_the_skin_moves_in_blender_as_in_the_file(used: tuple[dict, Path], name: str):
    """The walk that Blender shows is the walk that `export --onto` wrote, vertex by vertex."""
    _, folder = used
    runs = sorted((folder / "runs").iterdir(), key=lambda path: path.stat().st_mtime)
    walks = [run / commands.WALK for run in runs if (run / commands.WALK).exists()]
    file = walks[["walk.glb", "fixed.glb"].index(name)]
    shown, written = (gltf.GLTF2.load(str(path)) for path in (folder / name, file))
    one, other = (
        np.array([255 * skin_at(document, poses) for poses in frames_of(document, clip)])
        for document, clip in ((shown, shown.animations[0].name), (written, "walk-loop"))
    )  # Blender's weights are shares, not bytes
    assert one.shape == other.shape
    assert len(one) == 16
    size = np.ptp(other[0], axis=0).max()
    assert 0.5 < size < 1.5, "m"
    np.testing.assert_allclose(one, other, atol=1e-3 * size)
    assert np.ptp(one, axis=0).max() > 0.01 * size, "the walk moves"


@pytest.mark.slow
def test_a_timer_reads_the_job_and_cancel_ends_it(used: tuple[dict, Path]):
    modal = used[0]["modal"]
    assert modal["results"] == ["RUNNING_MODAL", "PASS_THROUGH", "PASS_THROUGH", "CANCELLED"]
    assert modal["calls"] == ["timer", "handler", "no timer"]
    assert (modal["reports"], modal["busy"], modal["ended"]) == (["Cancelled"], False, True)
    assert modal["panel"] == ["0.0 0%", "Reading the armature…", "Cancel"]


@pytest.mark.slow
def test_the_panel_shows_both_buttons(used: tuple[dict, Path]):
    drawn = used[0]["drawn"]
    assert {"Make it walk", "Fix this cycle", "Speed", "Gait", "Style", "Keep"} <= {*drawn}
    assert drawn[-1] == "Cancelled"
