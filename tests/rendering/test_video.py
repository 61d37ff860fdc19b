"""`mjxgait render`: videos in common formats, at any frame rate."""

import sys
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image, ImageSequence
from rendering.made_up import falling

from mjxgait.cli import main
from mjxgait.config.layers import find_creature
from mjxgait.creature import load_creature
from mjxgait.extras import install_command
from mjxgait.rendering.floor import VIEWS
from mjxgait.rendering.stage import Stage, smooth
from mjxgait.rendering.video import (
    Runner,
    condition,
    durations,
    frame_rate,
    moving_pictures,
    write_video,
)
from mjxgait.rendering.walk import record_walk

SMALL = ("--seconds", "0.8", "--fps", "10", "--size", "160", "96", "--renderer", "painter")


def render(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(["render", *map(str, arguments)])
    said = capsys.readouterr()
    return ended.value.code, said.out + said.err


@pytest.mark.parametrize("kind", ["webp", "gif"])
def test_a_video_has_its_frames_and_moves(stool_run, tmp_path, capsys, kind):
    out = tmp_path / f"walk.{kind}"
    code, said = render(capsys, stool_run, "--out", out, *SMALL)
    assert (code, str(out) in said) == (0, True)
    frames = [
        np.asarray(frame.convert("RGB"), int) for frame in ImageSequence.Iterator(Image.open(out))
    ]
    assert len(frames) == 8
    assert frames[0].shape == (96, 160, 3)
    assert np.abs(frames[2] - frames[6]).max() > 50
    assert Image.open(out).info["loop"] == 0


@pytest.mark.parametrize("kind", ["mp4", "mov", "webm"])
def test_videos_with_the_extra(stool_run, tmp_path, capsys, kind):
    av = pytest.importorskip("av", reason="the extra [video] is not installed")
    out = tmp_path / f"walk.{kind}"
    assert render(capsys, stool_run, "--out", out, *SMALL)[0] == 0
    with av.open(str(out)) as container:
        assert sum(1 for _ in container.decode(video=0)) == 8


def test_a_video_has_a_size_of_1280_by_720_by_default(stool_run, tmp_path, capsys):
    out = tmp_path / "walk.webp"
    assert render(capsys, stool_run, "--out", out, "--seconds", "0.1", "--fps", "10")[0] == 0
    assert Image.open(out).size == (1280, 720)


@pytest.mark.parametrize(
    ("given", "exact"),
    [
        (25, Fraction(25)),
        (120, Fraction(120)),
        (12.5, Fraction(25, 2)),
        (23.976, Fraction(24000, 1001)),
        (23.98, Fraction(24000, 1001)),
        (29.97, Fraction(30000, 1001)),
        (59.94, Fraction(60000, 1001)),
    ],
)
def test_a_frame_rate_is_exact(given, exact):
    assert frame_rate(given) == exact


@pytest.mark.parametrize("fps", [23.976, 29.97, 60, 120])
@pytest.mark.parametrize("unit", [1, 10])
def test_durations_add_up_to_the_right_time(fps, unit):
    """No frame is late by more than half a unit."""
    each = np.array(durations(200, fps, unit))
    assert (each % unit == 0).all()
    late = np.cumsum(each) - 1000 * np.arange(1, 201) / float(frame_rate(fps))
    assert np.abs(late).max() <= unit / 2 + 1e-9


def moving_bar(count):
    """Pictures that differ: formats may store equal ones once."""
    picture = np.zeros((64, 64, 3), np.uint8)
    picture[:, :8] = 255
    return (Image.fromarray(np.roll(picture, 7 * i, axis=1)) for i in range(count))


def stored(path):
    """Duration of each frame of an animated picture in ms."""
    with Image.open(path) as picture:
        given = []
        for i in range(picture.n_frames):
            picture.seek(i)
            picture.load()
            given.append(picture.info["duration"])
    return given


@pytest.mark.parametrize(("kind", "fps", "each"), [("webp", 120, {8, 9}), ("gif", 29.97, {30, 40})])
def test_pictures_that_move_keep_the_time(tmp_path, kind, fps, each):
    write_video(moving_bar(60), tmp_path / f"walk.{kind}", fps)
    found = stored(tmp_path / f"walk.{kind}")
    assert (len(found), set(found)) == (60, each)
    assert sum(found) == pytest.approx(60_000 / fps, abs=5)


@pytest.mark.parametrize("kind", ["mp4", "mov", "webm"])
def test_a_video_stores_the_exact_rate(tmp_path, kind):
    av = pytest.importorskip("av", reason="the extra [video] is not installed")
    write_video(moving_bar(30), tmp_path / f"walk.{kind}", 29.97)
    with av.open(str(tmp_path / f"walk.{kind}")) as container:
        assert container.streams.video[0].average_rate == Fraction(30000, 1001)
        assert container.duration / 1e6 == pytest.approx(30 * 1.001 / 30, abs=0.05)


def test_mp4_without_the_extra_is_one_sentence(stool_run, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    code, said = render(capsys, stool_run, "--out", tmp_path / "walk.mp4", *SMALL)
    assert code == 2
    assert f"MP4 needs an extra: {install_command('video')};" in said


def test_a_png_is_the_filmstrip(stool_run, tmp_path, capsys):
    assert render(capsys, stool_run, "--out", tmp_path / "walk.png")[0] == 0
    assert Image.open(tmp_path / "walk.png").width > 1600


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "walk.avi"], ".webp, .gif"),
        (["--out", "missing/walk.webp"], "does not exist"),
        (["--out", "walk.webp", "--fps", "0"], "--fps 0: must lie between 1 and 240"),
        (["--out", "walk.webp", "--fps", "240.5"], "--fps 240.5: must lie between 1 and 240"),
        (["--out", "walk.webp", "--fps", "nan"], "--fps nan: must lie between 1 and 240"),
        (["--out", "walk.webp", "--fps", "fast"], "--fps"),
        (["--out", "walk.gif", "--fps", "60"], "a GIF holds at most 50 frames per second"),
        (["--out", "walk.webp", "--generations", "a"], "such as 0,5,20"),
        (["--out", "walk.webp", "--top", "2", "--generations", "1"], "two kinds of race"),
        (["--out", "walk.webp", "--top", "99"], "between 1 and 12"),
        (["--out", "walk.webp", "--top", "2"], "no checkpoint"),
    ],
)
def test_bad_options_are_reported(stool_run, capsys, monkeypatch, tmp_path, arguments, words):
    monkeypatch.chdir(tmp_path)
    code, said = render(capsys, stool_run, *arguments)
    assert code == 2
    assert words in said


def test_a_missing_champion_is_reported(stool, tmp_path, capsys):
    from rendering.made_up import write_run

    code, said = render(capsys, write_run(tmp_path / "run", stool), "--out", tmp_path / "walk.webp")
    assert code == 2
    assert "no champion yet" in said


def test_a_race_has_parallel_lanes_and_labels(stool_walk):
    stage = Stage([stool_walk, stool_walk, stool_walk], 320, 180)
    heights = [stage.behind(50, place)[1] for place in range(3)]
    assert heights[0] > heights[1] > heights[2]
    assert all(0 < height < 180 for height in heights)
    runners = [Runner(stool_walk, f"rank {i}") for i in (1, 2, 3)]
    assert next(moving_pictures(runners, stage, 10)).size == (320, 180)


def test_the_caption_gives_speed_and_fall(stool_walk):
    assert condition(stool_walk, 0.0) == "0.00 m/s"
    assert condition(stool_walk, 2.0).endswith("m/s")
    walk = record_walk(
        creature := load_creature(find_creature("tall_quadruped")), falling(creature), 6.0
    )
    assert condition(walk, 50.0) == f"fell at {walk.fell:.1f} s"


def test_slow_motion_has_more_frames(stool):
    from rendering.made_up import treading

    walk = record_walk(stool, treading(stool), 0.4)
    assert len(list(moving_pictures([Runner(walk)], Stage([walk], 64, 64), 10, slow=2.0))) == 8


def test_the_camera_does_not_shake():
    path = np.column_stack([np.linspace(0, 1, 200), 0.1 * (-1.0) ** np.arange(200)])
    assert smooth(path, 20).shape == path.shape
    assert np.abs(smooth(path, 20)[20:-20, 1]).max() < 0.02


@pytest.mark.parametrize("view", VIEWS)
def test_every_view_has_the_whole_creature_in_the_picture(stool_walk, view: str):
    stage = Stage([stool_walk], 320, 180, view)
    pixels = stage.camera(0).pixels(stage.participants[0].outline)
    assert (pixels > 0).all()
    assert (pixels < [320, 180]).all()
    # It fills at least half of the width or height.
    assert (np.ptp(pixels, axis=0) / [320, 180]).max() > 0.5


def test_views_are_from_the_direction_of_their_names(stool_walk):
    """Direction of walking in the picture: to the right and into it."""
    ways = {}
    for view in VIEWS:
        camera = Stage([stool_walk], 320, 180, view).camera(0)
        ways[view] = camera.axes @ np.append(camera.forward, 0.0)
    right = {view: way[0] for view, way in ways.items()}
    into = {view: way[2] for view, way in ways.items()}
    assert right["side"] == pytest.approx(1.0)
    assert right["top"] == pytest.approx(1.0)
    assert into["front"] < -0.9 < 0.8 < into["follow"]
    assert -0.8 < into["three-quarter"] < -0.3
