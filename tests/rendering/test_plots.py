"""`mjxgait plot`: every plot as PNG and SVG, for good and bad runs."""

import dataclasses
import os
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from rendering.made_up import falling, metrics_line, treading, write_run

from mjxgait.errors import UserError
from mjxgait.rendering import painter, plots
from mjxgait.rendering.curves import draw_fitness, figure, plot_fitness
from mjxgait.rendering.filmstrip import filmstrip
from mjxgait.rendering.gaitplots import draw_joints, gait_window, subject_of
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


def titles(drawing: Figure) -> list[str]:
    """First title of a figure, of the whole or of a panel."""
    above = [drawing.get_suptitle()] if drawing.get_suptitle() else []
    return above + [axes.get_title(loc="left") for axes in drawing.axes]


def test_every_plot_says_of_what_it_is(stool_run, tmp_path, stool_walk, monkeypatch):
    """Creature, seed and speed begin the title, so that a plot can stand alone."""
    seen: dict[str, str] = {}

    def read(drawing: Figure, path, formats):
        seen[path.name] = titles(drawing)[0].splitlines()[0]
        return []

    monkeypatch.setattr(plots, "save", read)
    plot_run(stool_run, tmp_path / "plots")
    assert seen.keys() == PROGRESS | GAIT
    (said,) = set(seen.values())
    assert said.startswith("stool, seed 0, ")
    assert said.endswith(" m/s")


def test_a_run_without_a_champion_has_creature_and_seed_in_its_titles(stool, tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(
        plots, "save", lambda drawing, *given: seen.append(titles(drawing)[0]) or []
    )
    plot_run(write_run(tmp_path / "run", stool), tmp_path / "plots")
    assert {title.splitlines()[0] for title in seen} == {"stool, seed 0"}


def test_the_speed_in_a_title_is_that_after_the_start(stool_walk):
    """2 m ahead in the seconds from 2 s on, and 1 m aside, which does not count."""
    count, first = len(stool_walk.qpos), round(2.0 / stool_walk.time_step)
    share = np.clip((np.arange(count) - first) / (count - 1 - first), 0, 1)
    still = np.repeat(stool_walk.qpos[:1], count, 0)
    aside = np.array([-stool_walk.forward[1], stool_walk.forward[0]])
    still[:, :2] += share[:, None] * (2 * stool_walk.forward + aside)
    film = dataclasses.replace(stool_walk.trajectory, qpos=still[None])
    sent = dataclasses.replace(stool_walk, trajectory=film)
    expected = 2 / ((count - 1 - first) * stool_walk.time_step)
    assert subject_of(sent) == f"stool, seed 0, {expected:.2f} m/s"
    assert subject_of(dataclasses.replace(sent, fell=1.44)) == "stool, seed 0, fell at 1.4 s"


def test_left_and_right_have_one_scale(stool_walk):
    """Also if one of them moves farther."""
    creature, target = stool_walk.creature, stool_walk.trajectory.target.copy()
    target[..., creature.mirror.partner.max()] += 0.5
    film = dataclasses.replace(stool_walk.trajectory, target=target)
    with figure((9, 6)) as drawing:
        draw_joints(drawing, dataclasses.replace(stool_walk, trajectory=film))
        panels = {axes.get_title(loc="left").replace(" ", "_"): axes for axes in drawing.axes}
        names, partner = creature.joints.names, creature.mirror.partner
        limits = {name: panels[name].get_ylim() for name in names}
        lines = {
            name: np.concatenate([x.get_ydata() for x in panels[name].lines[:2]]) for name in names
        }
    pairs = [(names[j], names[p]) for j, p in enumerate(partner) if j < p]
    assert pairs
    for left, right in pairs:
        assert limits[left] == limits[right]
        both = np.concatenate([lines[left], lines[right]])
        assert limits[left][0] <= both.min() <= both.max() <= limits[left][1]
    assert len({limits[left] for left, _ in pairs}) > 1
