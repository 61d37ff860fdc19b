"""MuJoCo's own renderer is used on request where it works; elsewhere nothing breaks."""

import os
import subprocess
import sys

import numpy as np
import pytest

from mjxgait.cli import main
from mjxgait.rendering.gl import gl_pictures, working_backend
from mjxgait.rendering.stage import Stage


@pytest.fixture(scope="module")
def stage(stool_walk):
    return Stage([stool_walk, stool_walk], 320, 180)


@pytest.fixture(scope="module")
def backend(stage):
    found, sentence = working_backend(stage)
    if found is None:
        pytest.skip(f"needs GL (apt: libegl1 and libgl1-mesa-dri, or libosmesa6): {sentence}")
    return found


def test_both_renderers_draw_the_creature_at_the_same_place(stage, backend):
    (gl,) = gl_pictures(stage, [150], backend)
    painter = stage.picture(150)
    assert gl.size == painter.size
    difference = np.abs(np.asarray(gl.convert("L"), int) - np.asarray(painter.convert("L"), int))
    assert np.median(difference) < 40
    floor = [np.median(np.asarray(picture.convert("L"))) for picture in (gl, painter)]
    masks = [
        np.abs(np.asarray(p.convert("L"), int) - f) > 45
        for p, f in zip((gl, painter), floor, strict=True)
    ]
    # Shadows differ; the creatures' outlines do not.
    assert (masks[0] & masks[1]).sum() > 0.6 * min(masks[0].sum(), masks[1].sum())


def test_frames_move(stage, backend):
    first, second = gl_pictures(stage, [100, 150], backend)
    assert np.abs(np.asarray(first, int) - np.asarray(second, int)).max() > 40


@pytest.mark.parametrize(
    ("wanted", "reason"),
    [
        ("nonsense", "it does not work here (nonsense: RuntimeError: invalid value"),
        ("off", "MUJOCO_GL=off forbids it"),
    ],
)
def test_missing_gl_has_a_reason_in_one_line(stage, wanted, reason):
    backend, said = working_backend(stage, wanted)
    assert backend is None
    assert said.startswith(reason)
    assert "\n" not in said


def rendered(run, out, *options):
    """Ended command, with a MUJOCO_GL that names a missing library: importing MuJoCo would fail."""
    short = ("--seconds", "0.2", "--size", "96", "64")
    return subprocess.run(
        [sys.executable, "-m", "mjxgait", "render", str(run), "--out", str(out), *short, *options],
        env=os.environ | {"MUJOCO_GL": "nonsense"},
        capture_output=True,
        text=True,
    )


def test_a_broken_gl_does_not_break_the_command(stool_run, tmp_path):
    done = rendered(stool_run, tmp_path / "walk.webp")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "walk.webp").exists()


def test_a_broken_gl_by_name_is_refused_in_one_sentence(stool_run, tmp_path):
    done = rendered(stool_run, tmp_path / "walk.webp", "--renderer", "gl")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "--renderer gl: it does not work here (nonsense: " in done.stderr
    assert done.stderr.endswith("leave the option out\n")
    assert not (tmp_path / "walk.webp").exists()


def test_gl_is_used_only_by_name(stool_run, tmp_path, capsys, monkeypatch):
    """It would be tried if anything but its name led to it."""
    monkeypatch.setattr("mjxgait.rendering.gl.working_backend", lambda *given: (None, "tried"))
    given = (str(stool_run), "--out", str(tmp_path / "walk.webp"))
    short = ("--seconds", "0.1", "--size", "64", "64")
    for options, code in (((), 0), (("--renderer", "auto"), 0), (("--renderer", "gl"), 2)):
        with pytest.raises(SystemExit) as ended:
            main(["render", *given, *short, *options])
        said = "".join(capsys.readouterr())
        assert (ended.value.code, "tried" in said) == (code, code == 2)
