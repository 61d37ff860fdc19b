"""`mjxgait plot`: every plot as PNG and SVG, for good and bad runs."""

import os
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from PIL import Image
from rendering.made_up import falling, metrics_line, treading, write_run

from mjxgait.errors import UserError
from mjxgait.rendering import painter, plots
from mjxgait.rendering.curves import draw_fitness, figure, plot_fitness
from mjxgait.rendering.filmstrip import filmstrip
from mjxgait.rendering.gaitplots import gait_window
from mjxgait.rendering.plots import plot_run
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import METRICS
from mjxgait.training.logs import columns

PROGRESS = {"fitness", "terms", "diversity"}
GAIT = {"footfalls", "joints", "trunk", "filmstrip"}


def is_drawn(file):
    """Whether a picture has dark marks, also in grey."""
    if file.suffix == ".svg":
        return (
            len(list(ElementTree.parse(file).iter("{http://www.w3.org/2000/svg}path"))) > 5
            or "<image" in file.read_text()
        )
    grey = np.asarray(Image.open(file).convert("L"))
    return (grey < 100).mean() > 0.002 and grey.max() == 255


def test_all_plots_of_a_run(stool_run, tmp_path):
    files = plot_run(stool_run, tmp_path / "plots")
    assert {file.name for file in files} == {
        f"{name}.{kind}" for name in PROGRESS | GAIT for kind in ("png", "svg")
    }
    assert all(is_drawn(file) for file in files)


def test_a_run_without_a_champion_has_its_curves(stool, tmp_path):
    files = plot_run(write_run(tmp_path / "run", stool), formats=("png",))
    assert {file.stem for file in files} == PROGRESS


@pytest.mark.parametrize("evaluation", [True, False])
def test_a_curve_shows_the_middle_half_only_if_the_log_has_it(evaluation):
    lines = [metrics_line(generation) for generation in range(3)]
    if not evaluation:
        lines = [line | {"lower_quartile": None, "upper_quartile": None} for line in lines]
    with figure((4, 3)) as drawing:
        axes = drawing.subplots()
        draw_fitness(axes, lines)
        told = [text.get_text() for text in axes.get_legend().get_texts()]
    assert ("middle half" in told) == evaluation
    assert {"best", "mean"} <= set(told)


def test_a_champion_that_falls_can_be_plotted(stool, tmp_path, monkeypatch):
    monkeypatch.setattr(plots, "LOOP_SECONDS", 4.0)
    monkeypatch.setattr(painter, "SMOOTH", 1)
    run = write_run(tmp_path / "run", stool, falling(stool))
    assert record_walk(stool, falling(stool), 4.0).fell < 4.0
    assert len(plot_run(run, formats=("png",))) == len(PROGRESS | GAIT)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full, a full disk")
@pytest.mark.parametrize("kind", ["png", "svg"])
def test_a_disk_full_between_two_plots_gives_one_sentence(stool, tmp_path, kind):
    run = write_run(tmp_path / "run", stool)
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / f"terms.{kind}").symlink_to("/dev/full")
    words = "plots: cannot be written: No space left on device; the run itself is safe: make room"
    with pytest.raises(UserError, match=words):
        plot_run(run, tmp_path / "plots")


def test_one_generation_can_be_plotted(stool, tmp_path):
    assert all(
        map(is_drawn, plot_run(write_run(tmp_path / "run", stool, generations=1), formats=("png",)))
    )


def test_nothing_to_plot_is_reported(stool, tmp_path):
    run = write_run(tmp_path / "run", stool)
    (run / METRICS).unlink()
    with pytest.raises(UserError, match="nothing to plot"):
        plot_run(run)
    with pytest.raises(UserError, match="a folder of runs, and this is for one; name it"):
        plot_run(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match="not a run folder"):
        plot_run(tmp_path / "empty")


def test_missing_numbers_are_gaps():
    assert np.isnan(columns([metrics_line(0) | {"best": None}, metrics_line(1)])["best"][0])
    assert np.isnan(columns([metrics_line(0), metrics_line(1) | {"later": 1.0}])["later"][0])


def test_every_run_gets_a_fitness_curve(tmp_path):
    plot_fitness([metrics_line(g) for g in range(5)], tmp_path / "fitness.png")
    assert is_drawn(tmp_path / "fitness.png")


def test_the_gait_window_is_named(stool, stool_walk):
    window, what = gait_window(stool_walk)
    assert what.startswith("2 strides from")
    assert (window.stop - window.start) * stool_walk.time_step == pytest.approx(1.0, abs=0.02)
    window, what = gait_window(record_walk(stool, treading(stool), 0.3))
    assert "no steady stride" in what
    assert window.stop == 60


def test_a_filmstrip_has_a_different_picture_of_each_moment(stool_walk):
    strip = np.asarray(filmstrip(stool_walk, 4, (160, 120)), int)
    assert strip.shape == (244, 324, 3)
    assert np.abs(strip[:120, :160] - strip[124:, :160]).max() > 60
