"""Transparent backgrounds: bodies and their shadow alone, in each format that holds them."""

import numpy as np
import pytest
from PIL import Image
from rendering.grown import grown_walk, straight

from mjxgait.cli import main
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.surroundings import backdrop
from mjxgait.rendering.video import Runner, moving_pictures, write_video

SIZE = (320, 180)
SMALL = ("--seconds", "0.3", "--fps", "10", "--size", "160", "96")


def render(capsys, *arguments) -> tuple[object, str]:
    with pytest.raises(SystemExit) as ended:
        main(["render", *map(str, arguments), "--background", "transparent"])
    return ended.value.code, "".join(capsys.readouterr())


def alpha(picture: Image.Image) -> np.ndarray:
    return np.asarray(picture.convert("RGBA"), int)[..., 3]


def test_over_the_floor_it_is_the_usual_picture(stool_walk):
    usual, clear = Stage([stool_walk], *SIZE), Stage([stool_walk], *SIZE, clear=True)
    picture = clear.picture(100)
    assert picture.mode == "RGBA"
    floor = backdrop(usual.camera(100), usual.origin, None, usual.around).convert("RGBA")
    floor.alpha_composite(picture)
    apart = np.abs(np.asarray(floor.convert("RGB"), int) - np.asarray(usual.picture(100), int))
    assert apart.max() <= 4


def test_bodies_are_opaque_the_shadow_is_soft_and_the_rest_is_clear(stool_walk):
    found = alpha(Stage([stool_walk], *SIZE, clear=True).picture(100))
    assert (found == 255).mean() > 0.04
    shadow = (found > 20) & (found < 100)
    assert shadow[SIZE[1] // 2 :].mean() > 0.01
    assert not found[0].any()
    # No numbers stand at the lower edge.
    assert not found[-14:].any()


def test_a_swimmer_has_neither_water_nor_shadow():
    walk = grown_walk("follow", straight(1.0, 0.0, 0.3), light=(0.3, 0.1, 0.2))
    found = alpha(Stage([walk], *SIZE, clear=True).picture(50))
    # Only pixels at edges are in between.
    assert ((found > 0) & (found < 255)).mean() < 0.05 < (found == 255).mean()
    assert not found[:, :8].any()


def test_nothing_is_written_on_it(stool_walk):
    stage = Stage([stool_walk], *SIZE, clear=True)
    (first,) = moving_pictures([Runner(stool_walk)], stage, 0.2)
    assert (np.asarray(first) == np.asarray(stage.picture(0))).all()


@pytest.mark.parametrize("kind", ["webp", "gif", "png"])
def test_a_picture_file_holds_it(stool_run, tmp_path, capsys, kind):
    out = tmp_path / f"walk.{kind}"
    assert render(capsys, stool_run, "--out", out, *SMALL)[0] == 0
    with Image.open(out) as picture:
        for frame in range(getattr(picture, "n_frames", 1)):
            picture.seek(frame)
            found = alpha(picture)
            assert (found == 0).mean() > 0.5
            assert (found == 255).mean() > 0.02
            # A GIF has whole pixels only, so no shadow.
            assert ((found > 20) & (found < 100)).any() == (kind != "gif")


@pytest.mark.parametrize("kind", ["webp", "gif"])
def test_no_frame_shows_the_one_before(tmp_path, kind):
    """A bar that moves to the right leaves nothing behind."""
    bar = np.zeros((64, 64, 4), np.uint8)
    bar[:, :8] = [200, 30, 30, 255]
    out = tmp_path / f"bar.{kind}"
    write_video((Image.fromarray(np.roll(bar, 7 * i, axis=1)) for i in range(6)), out, 10)
    with Image.open(out) as picture:
        for frame in range(6):
            picture.seek(frame)
            shown = np.flatnonzero(alpha(picture)[32] > 128)
            assert shown.tolist() == list(range(7 * frame, 7 * frame + 8))


@pytest.mark.parametrize(("kind", "codec"), [("mov", "prores"), ("webm", "libvpx-vp9")])
def test_a_video_file_holds_it(stool_run, tmp_path, capsys, kind, codec):
    av = pytest.importorskip("av", reason="the extra [video] is not installed")
    out = tmp_path / f"walk.{kind}"
    assert render(capsys, stool_run, "--out", out, *SMALL)[0] == 0
    # The usual decoder of VP9 leaves alpha out.
    decoder = av.CodecContext.create(codec, "r")
    with av.open(str(out)) as container:
        if kind == "mov":
            frames = list(container.decode(video=0))
        else:
            packets = list(container.demux(video=0))
            frames = [f for packet in packets if packet.size for f in decoder.decode(packet)]
        assert len(frames) == 3
        for frame in frames:
            assert frame.format.name.startswith("yuva")
            found = frame.to_ndarray(format="rgba")[..., 3]
            assert (found < 3).mean() > 0.5
            assert (found > 252).mean() > 0.02
            assert ((found > 20) & (found < 100)).any()


def test_a_race_has_no_labels_on_it(stool_run, tmp_path, capsys):
    out = tmp_path / "race.png"
    assert render(capsys, stool_run, stool_run, "--out", out, *SMALL)[0] == 0
    with Image.open(out) as picture:
        assert (alpha(picture) == 0).mean() > 0.5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "walk.mp4"], "walk.mp4: MP4 holds no transparency; end the name with .webp,"),
        (["--out", "walk.webp", "--renderer", "gl"], "--renderer gl draws no transparent"),
    ],
)
def test_what_cannot_hold_it_is_refused_in_one_sentence(
    stool_run, tmp_path, capsys, monkeypatch, arguments, words
):
    monkeypatch.chdir(tmp_path)
    code, said = render(capsys, stool_run, *arguments)
    assert (code, said.count("\n"), words in said) == (2, 1, True)
    assert not list(tmp_path.iterdir())
