"""A robot: similar to the evolved body, cut clear of its parent, as heavy and strong as it is."""

import csv
import dataclasses
import functools
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from hardware.crawler import SECONDS, champion, crawl
from helpers import STOOL, said_by
from rendering.made_up import treading, write_run

from mjxgait.champion import write_champion
from mjxgait.config.layers import find_creature
from mjxgait.controllers.sims_brain.reference import brain_reference
from mjxgait.creature import load_creature
from mjxgait.creature.geometry import posed
from mjxgait.hardware import robot
from mjxgait.hardware.design import PLASTIC, Design, designed, longest_side, parts_of
from mjxgait.hardware.robot import as_built, as_evolved, model_xml, tried, with_servos
from mjxgait.hardware.servos import Catalogue, Servo, read_catalogue
from mjxgait.plugins import build_config
from mjxgait.training.folder import CHAMPION, write_setup

SHORT = 2.5


@functools.cache
def at(length: float, strength: float = 1.0) -> Design:
    """The robot of a length; 0 is that of the evolved body. strength: factor on all servos."""
    servos = tuple(
        dataclasses.replace(s, stall=s.stall * strength, speed=s.speed * strength)
        for s in read_catalogue().servo
    )
    catalogue = Catalogue(read_catalogue().continuous, servos)
    return designed(crawl(), length or longest_side(parts_of(crawl())), 0.002, catalogue)


def test_the_body_at_its_own_size_moves_as_in_the_reference_simulator(
    monkeypatch: pytest.MonkeyPatch,
):
    """Its hinges are not in the order of its parts, and its brain observes angles and contacts."""
    seen = []
    look = robot._Heights.of

    def spy(self: robot._Heights, data: mujoco.MjData) -> np.ndarray:
        seen.append(data.qpos.copy())
        return look(self, data)

    monkeypatch.setattr(robot._Heights, "of", spy)
    tried(at(0), as_evolved(at(0)), SHORT)
    steps = round(SHORT / crawl().time_step)
    assert np.abs(crawl().qpos[:steps, 7:]).max() > 0.2
    assert np.allclose(seen[1 : steps + 1], crawl().qpos[:steps], atol=1e-4)


def test_its_parts_hear_as_many_children_as_in_the_reference_simulator():
    settings = dataclasses.replace(champion().settings, children=2)
    best = dataclasses.replace(champion(), settings=settings)
    design = dataclasses.replace(at(0), walk=dataclasses.replace(crawl(), champion=best))
    examined = brain_reference(best.embodied(load_creature(find_creature("blocks"))), best, 0.01)
    assert robot._brain(design, 0.01).heard == examined.heard
    assert {len(own) for own in examined.heard} == {2}


@pytest.mark.parametrize("length", [0.10, 0.20])
def test_a_similar_body_gets_as_many_lengths_far(length: float):
    here, there = at(0), at(length)
    own, small = (tried(each, as_evolved(each), SHORT) for each in (here, there))
    assert own.distance > 0.01
    scale = there.scale
    assert small.distance == pytest.approx(own.distance * scale.length, rel=1e-3)
    assert small.speed == pytest.approx(own.speed * scale.length / scale.time, rel=1e-3)
    assert small.height == pytest.approx(own.height * scale.length, rel=1e-2)
    assert small.short == own.short == 0


def test_servos_that_suffice_move_it_alike_and_weak_ones_fall_short():
    strong, weak = at(0.2, 10.0), at(0.2, 0.2)
    assert max(hinge.load for hinge in strong.hinges) <= 1
    alike = tried(strong, with_servos(strong), SHORT)
    assert alike.short == 0
    wanted = tried(strong, as_evolved(strong), SHORT)
    assert alike.distance == pytest.approx(wanted.distance, rel=1e-3)
    assert min(hinge.load for hinge in weak.hinges) > 1
    assert tried(weak, with_servos(weak), SHORT).short > 0.05
    assert sum("no servo of the catalogue" in said for said in weak.obstacles) == len(weak.hinges)


def test_a_cut_block_is_clear_of_its_parent_in_the_whole_motion():
    design, parts, model = at(0.2), parts_of(crawl()), crawl().creature.model
    cut = [one for one in design.blocks if one.kept < 1]
    assert cut
    for one in cut:
        part = parts[one.number]
        parent = parts[part.parent]
        corners = one.print.solid.corners() / design.scale.length
        place = (part.place - parent.middle) / parent.half
        face = int(np.argmax(np.abs(place)))
        for qpos in crawl().qpos[::5]:
            data = posed(model, qpos)
            own, on = data.body(one.name), data.body(f"part{part.parent}")
            world = corners @ own.xmat.reshape(3, 3).T + own.xpos
            inside = (world - on.xpos) @ on.xmat.reshape(3, 3) - parent.middle
            beyond = inside[:, face] * np.sign(place[face]) - parent.half[face]
            assert beyond.min() > 0


def test_a_block_that_folds_into_its_parent_is_printed_whole_and_reported():
    wide = dataclasses.replace(crawl().trajectory, qpos=crawl().trajectory.qpos.copy())
    wide.qpos[..., 7:] *= 1.4 / np.abs(wide.qpos[..., 7:]).max(axis=(0, 1))
    walk = dataclasses.replace(crawl(), trajectory=wide)
    design = designed(walk, 0.2, 0.002, read_catalogue())
    folded = [said for said in design.obstacles if "turns into" in said]
    assert folded
    number = int(folded[0].partition(" ")[0].removeprefix("part"))
    assert design.blocks[number].kept == 1


def test_the_model_has_the_masses_and_the_servos_of_the_design():
    design = at(0.2)
    model = mujoco.MjModel.from_xml_string(model_xml(as_built(design), 0.01))
    for one in design.blocks:
        assert model.body(one.name).mass[0] == pytest.approx(one.mass)
        assert one.mass >= one.similar * (1 - 1e-9)
        assert one.mass == pytest.approx(one.plastic + one.servos + one.ballast)
    assert max(one.mass / one.similar for one in design.blocks) == pytest.approx(1)
    for hinge in design.hinges:
        motor = model.actuator(hinge.name)
        assert model.joint(motor.trnid[0]).name == hinge.name
        assert motor.forcerange[1] == pytest.approx(hinge.servo.stall)
        assert -motor.biasprm[2] == pytest.approx(hinge.servo.stall / hinge.servo.fastest)


def test_the_inertia_of_a_block_is_that_of_its_pieces():
    """Against trimesh: the shell as a solid less its cavity, servos as boxes, ballast as a point."""
    design = at(0.2)
    one = max(design.blocks, key=lambda each: each.servos)
    mass, centre, inertia = as_built(design).inertials[one.number]
    outer, cavity = (mesh_of(each) for each in (one.print.solid, one.print.cavity))
    pieces = [(PLASTIC, outer), (-PLASTIC, cavity)]
    for hinge in design.hinges:
        if hinge.carrier == one.number:
            box = trimesh.creation.box(2 * hinge.place.half)
            box.apply_translation(hinge.place.middle)
            pieces.append((hinge.servo.kilograms / box.volume, box))
    ball = trimesh.creation.icosphere(radius=1e-4)
    ball.apply_translation(one.middle)
    pieces.append((one.ballast / ball.volume, ball))
    masses = [density * mesh.volume for density, mesh in pieces]
    assert mass == pytest.approx(sum(masses))
    found = sum(m * mesh.center_mass for m, (_, mesh) in zip(masses, pieces, strict=True)) / mass
    assert centre == pytest.approx(found, abs=1e-6)
    about = np.zeros((3, 3))
    for m, (density, mesh) in zip(masses, pieces, strict=True):
        arm = mesh.center_mass - found
        about += density * mesh.moment_inertia + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    assert np.allclose(inertia, about, rtol=1e-3, atol=1e-8)


def mesh_of(solid: object) -> trimesh.Trimesh:
    return trimesh.convex.convex_hull(solid.corners())


def grown_run(folder: Path, task: str = "roam") -> Path:
    """A run folder with the crawler as its champion."""
    blocks = load_creature(find_creature("blocks"))
    table = {"use": {"controller": "brain", "task": task}}
    table["controller"] = {"nodes": 3, "connections": 1, "central": 1}
    write_setup(folder, blocks, build_config(table, "a test"))
    write_champion(champion(task), blocks, folder / CHAMPION)
    return folder


def test_a_build_folder_holds_closed_parts_a_bill_and_a_model(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("mjxgait.api.robots.SECONDS", SECONDS)
    monkeypatch.setattr("mjxgait.hardware.robot.STARTS", 1)
    out = tmp_path / "robot"
    said = said_by(capsys, "build", grown_run(tmp_path / "run"), "--out", out, code=0)
    assert "5 blocks, the longest 20 cm, 4 servos" in said
    parts = sorted((out / "parts").iterdir())
    assert len(parts) == 10
    volume = 0.0
    for file in parts:
        mesh = trimesh.load_mesh(file)
        assert mesh.is_watertight
        volume += mesh.volume / 1e9
    rows = list(csv.DictReader((out / "bill.csv").open(encoding="utf-8")))
    printed = sum(float(row["mass_g_each"]) for row in rows if row["item"].endswith(".stl"))
    assert printed == pytest.approx(1.24e6 * volume, rel=1e-2)
    servos = [row for row in rows if "e-Manual" in row["source"]]
    assert sum(int(row["quantity"]) for row in servos) == 4
    mujoco.MjModel.from_xml_path(str(out / "robot.xml"))
    page = (out / "README.md").read_text(encoding="utf-8")
    assert all(f"part{number}_shell.stl" in page for number in range(5))
    again = said_by(capsys, "build", tmp_path / "run", "--out", out, code=2)
    assert "holds something already" in again


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--wall", "1.1"), "--wall 1.1: give 1.2 to 10 mm"),
        (("--length", "2"), "--length 2: give 5 to 100 cm"),
        (("--servos", "no.toml"), "no such file"),
    ],
)
def test_what_cannot_be_built_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture, options: tuple[str, ...], said: str
):
    out = tmp_path / "robot"
    found = said_by(capsys, "build", tmp_path / "run", "--out", out, *options, code=2)
    assert said in found
    assert not out.exists()


def test_only_bodies_that_grew_and_walk_or_jump_are_built(
    tmp_path: Path, capsys: pytest.CaptureFixture
):
    stool = load_creature(STOOL)
    legged = write_run(tmp_path / "legged", stool, treading(stool))
    for run in (legged, grown_run(tmp_path / "wet", "swim")):
        said = said_by(capsys, "build", run, "--out", tmp_path / "robot", code=2)
        assert "a robot is built of a body that grew to walk or jump" in said
        assert not (tmp_path / "robot").exists()


def test_a_servo_without_room_is_reported():
    big = Servo("big", 50.0, 500.0, 12.0, 20.0, (300.0, 300.0, 300.0), "current", "none")
    design = designed(crawl(), 0.2, 0.002, Catalogue(1.0, (big,)))
    assert sum("big fits into neither" in said for said in design.obstacles) == 4
    assert all(hinge.place is None for hinge in design.hinges)
