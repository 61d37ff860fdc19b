"""MuJoCo's own renderer is used where it works; elsewhere nothing breaks."""

import os
import subprocess
import sys

import numpy as np
import pytest

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


@pytest.mark.parametrize("wanted", ["nonsense", "off"])
def test_missing_gl_is_reported_in_one_line(stage, wanted):
    backend, sentence = working_backend(stage, wanted)
    assert backend is None
    assert sentence.startswith("drawn without GL")
    assert "\n" not in sentence


def test_a_broken_gl_does_not_break_the_command(stool_run, tmp_path):
    """MUJOCO_GL names a missing library: importing MuJoCo would fail."""
    done = subprocess.run(
        [
            *(
                sys.executable,
                "-m",
                "mjxgait",
                "render",
                str(stool_run),
                "--out",
                str(tmp_path / "walk.webp"),
            ),
            *("--seconds", "0.2", "--size", "96", "64"),
        ],
        env=os.environ | {"MUJOCO_GL": "nonsense"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "drawn without GL" in done.stdout
    assert (tmp_path / "walk.webp").exists()
