"""`import_model`: conversion of a model file to the texts of a creature folder."""

import dataclasses
import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.animation.clips.clip import ELSEWHERE
from mjxgait.creature import geometry
from mjxgait.creature.settings import RigSettings
from mjxgait.errors import UserError
from mjxgait.files import read_bytes
from mjxgait.importer.anatomy import in_plane
from mjxgait.importer.balance import steady_balance
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.bones import add_bones
from mjxgait.importer.clean import clean_mjcf, clean_urdf
from mjxgait.importer.drive import step_if_narrow, swing_arms
from mjxgait.importer.find import find_anatomy
from mjxgait.importer.notes import Notes, listed, one_line, plain_names, tell_dropped, tell_left_out
from mjxgait.importer.orient import (
    find_forward,
    find_mirror,
    is_planar,
    yaw_to,
)
from mjxgait.importer.rigged import RIGS, model_of
from mjxgait.importer.robots import find_robot, robot_name
from mjxgait.importer.source import MOST_XML, Places, Source, parse_text, parse_xml
from mjxgait.importer.spec import add_joints, creature_xml, place_bodies
from mjxgait.importer.stance import stance_of
from mjxgait.importer.standing import (
    Candidate,
    first_pose,
    offered_poses,
    standing,
)
from mjxgait.importer.train_table import Settings, Traits, train_table
from mjxgait.importer.worker import (
    GIGABYTES,
    SECONDS,
    compile_apart,
    compile_here,
)
from mjxgait.importer.write_toml import GAIT, creature_toml
from mjxgait.importer.xacro import TEMPLATE, expanded

XML, TOML, README = WRITTEN = ("creature.xml", "creature.toml", "README.md")
"""Files of a creature folder that an import makes."""
NATURAL = (4, 6, 8)
"""Numbers of feet on which a character has a natural gait unless it is given another."""


@dataclasses.dataclass(frozen=True)
class ImportChoices:
    """Import options set by the user.

    keep, freeze: patterns of joint names. height: m, of a skeleton at rest. apart: compile in a
    separate process, limited to `seconds` of processor time and `gigabytes` of memory.
    """

    name: str | None = None
    search: tuple[Path, ...] = ()
    keep: tuple[str, ...] = ()
    freeze: tuple[str, ...] = ()
    up: str | None = None
    forward: str | None = None
    height: float | None = None
    apart: bool = True
    seconds: float = SECONDS
    gigabytes: float = GIGABYTES


@dataclasses.dataclass(frozen=True)
class Imported:
    """Imported creature.

    files: name and text of each file of the creature folder. stands: whether it stood for two
    seconds.
    """

    name: str
    files: dict[str, str]
    notes: Notes
    stands: bool


def import_model(path: Path, choices: ImportChoices | None = None) -> Imported:
    """Import a creature from an MJCF, URDF or xacro file, or from a skeleton (BVH, skinned GLB).

    path: of the file; or `robot:NAME`, a robot of the package robot_descriptions.

    Raises:
      UserError: the file cannot be read, or the model cannot walk; names the element and the
        remedy.
    """
    choices, notes = choices or ImportChoices(), Notes()
    if name := robot_name(path):
        robot = find_robot(name)
        search = (*choices.search, *robot.search)
        path, choices = (
            robot.file,
            dataclasses.replace(choices, name=choices.name or name, search=search),
        )
    try:
        return _import(path, choices, notes)
    except UserError as error:
        text = str(error)
        raise UserError(text if str(path) in text else f"{path}: {text}") from None
    except (
        np.linalg.LinAlgError,
        FloatingPointError,
        OverflowError,
        mujoco.FatalError,
        MemoryError,
    ) as error:
        raise UserError(
            f"{path}: its numbers cannot be computed with ({error}); correct the file"
        ) from None


def _import(path: Path, choices: ImportChoices, notes: Notes) -> Imported:
    source = _read(path, choices, notes)
    parts = source.tree, source.assets, source.missing
    if choices.apart:
        model, changes = compile_apart(*parts, choices.seconds, choices.gigabytes)
    else:
        model, changes = compile_here(*parts)
    for what, why in changes:
        for key, file in source.files.items():
            what = what.replace(f"({key})", f'"{file}"')
        notes.change(what, why)
    tell_dropped(model, notes)
    up = source.up.value if source.up else choices.up
    anatomy = find_anatomy(
        model, source.coupled, choices.keep, choices.freeze, up, notes, source.limbs
    )
    if source.up:
        notes.guess("up", source.up.value, source.up.confidence, source.up.reason)
    tell_left_out(model, anatomy.bodies, notes)
    place_bodies(model, anatomy)
    joints = add_joints(model, anatomy, source.efforts, notes)
    add_bones(anatomy.spec, notes)
    feet = [anatomy.bodies.index(b) for b in anatomy.feet]
    kinematics = KinematicModel(anatomy.spec, feet, *joints, in_plane(model, anatomy.root))
    start = first_pose(kinematics, model, anatomy)
    kinematics.turn(yaw_to(find_forward(kinematics, start, choices.forward, notes)))
    rest = kinematics.qpos(np.zeros(len(kinematics.joints))) if source.up else None
    planar = is_planar(kinematics, start) is not None
    mirror = find_mirror(kinematics, start, planar, notes)
    best = standing(
        kinematics, offered_poses(kinematics, model, anatomy, source, start), mirror, planar, notes
    )
    if best.held.height < 0:
        raise UserError(
            f'"{model.body(anatomy.root).name}" lies on the floor, and all of it that is not a foot '
            "falls through: this has no legs to walk on"
        )
    soles = {name for foot in best.feet for name in foot}
    steady_balance(
        best.drive, best.kinematics.names, best.kinematics.model, best.qpos, soles, best.notes
    )
    if source.bones and not planar:
        step_if_narrow(best.kinematics, best.q, best.drive, best.notes)
        swing_arms(best.kinematics, best.drive, source.swings, best.notes)
    name = (
        plain_names([choices.name or path.stem.removesuffix(".urdf")], ["creature"])[0].strip(".-")
        or "creature"
    )
    if rest is not None:
        rest[:3] = best.qpos[:3]
    bones = {
        body.name: source.bones[model.body(b).name]
        for body, b in zip(anatomy.spec.bodies[1:], anatomy.bodies, strict=True)
        if source.bones
    }
    turned = {part: _rounded(geometry.quaternion(turn)) for part, turn in source.turned.items()}
    origin = one_line(path.name)
    rig = RigSettings(origin, bones, turned)
    return _folder(name, origin, best, mirror, planar, rest, rig)


def _rounded(quat: np.ndarray) -> tuple[float, float, float, float]:
    w, x, y, z = (round(float(value), 9) for value in quat)
    return w, x, y, z


def _read(path: Path, choices: ImportChoices, notes: Notes) -> Source:
    """Read a model file, or build the tree of a skeleton."""
    kind = path.suffix.lower()
    if kind in ELSEWHERE:
        raise UserError(f'{path}: cannot read "{kind}"; {ELSEWHERE[kind]}')
    if kind not in RIGS:
        if choices.height is not None:
            raise UserError(
                f"--height is for skeletons ({', '.join(RIGS)}); {path} has its lengths"
            )
        return read_source(path, choices.search, notes)
    return model_of(path, choices.up, choices.height, notes)


def read_source(path: Path, search: Sequence[Path], notes: Notes) -> Source:
    """Read and clean the tree of a file.

    Raises:
      UserError: it cannot be read, or is neither MJCF nor URDF.
    """
    source, places = Source(_parsed(path, search)), Places(path, search)
    match source.tree.tag:
        case "mujoco":
            clean_mjcf(source, path, places, notes)
        case "robot":
            clean_urdf(source, path, places, notes)
        case other:
            raise UserError(
                f"{path}: begins with <{other[:40]}>; a model file begins with <mujoco> (MJCF) or <robot> (URDF)"
            )
    return source


def _parsed(path: Path, search: Sequence[Path]) -> ET.Element:
    if path.suffix.lower() == TEMPLATE:
        read_bytes(path, MOST_XML)
        return parse_text(expanded(path, search), path)
    return parse_xml(path)


def _folder(
    name: str,
    origin: str,
    best: Candidate,
    mirror: tuple[np.ndarray, np.ndarray] | None,
    planar: bool,
    rest: np.ndarray | None,
    rig: RigSettings,
) -> Imported:
    """Write the texts of the folder.

    rest: [nq] rest pose of a skeleton, None for other models. rig: its bones, none for others.
    """
    kinematics, notes = best.kinematics, best.notes
    notes.guess("trunk", kinematics.bodies[0].name, "high", "the body that all limbs hang on")
    notes.guess(
        "feet",
        f"{len(best.feet)} feet",
        "high" if math.isfinite(best.held.up) and best.held.stands else "low",
        "limbs that end lowest",
    )
    pairs = {} if mirror is None else _stated_pairs(kinematics, best.q, mirror, planar)
    if stopped := [joint.name for joint in kinematics.joints if joint.limited == 1]:
        notes.change(
            f"limits act on {listed(stopped)} only",
            "these stand at the end of their range and rest on it",
        )
    kinematics.pose(best.q)
    passing = planar and bool(geometry.parallel(kinematics.data.xaxis[1:]).all())
    is_rig = bool(rig.bones)
    hip, length = _sizes(best, is_rig)
    shorter = length < hip
    if is_rig and not shorter:
        why = "from the hindmost to the foremost leg: tails and necks do not count"
        notes.guess("body_length", f"{length:.3g}", "medium", why)
    if shorter:
        # Speeds count in body lengths: a biped measured from its back to its toes would score well
        # for shuffling.
        length = hip
        why = "the hip height: the body is shorter than its legs, and speeds count in it"
        notes.guess("body_length", f"{hip:.3g}", "medium", why)
    if is_rig and len(best.feet) in NATURAL:
        why = "of random poses of its many joints few stand; --gait auto leaves it open"
        notes.guess(GAIT, "natural", "medium", why)
    train = _train(best, mirror is not None, hip, length, is_rig)
    toml = creature_toml(
        name,
        origin,
        best,
        mirror is not None,
        pairs,
        length if shorter or is_rig else None,
        passing,
        rig,
        train,
    )
    report = (
        f"# {name}\n\nMade by `mjxgait import` from {origin}.\n\n```text\n{notes.text()}\n```\n"
    )
    files = {
        XML: creature_xml(kinematics.spec, name, best.qpos, rest),
        TOML: toml,
        README: report,
    }
    return Imported(name, files, notes, best.held.stands)


def _stated_pairs(
    kinematics: KinematicModel, q: np.ndarray, mirror: tuple[np.ndarray, np.ndarray], planar: bool
) -> dict[str, tuple[str, int]]:
    """Partner and sign of each joint that the geometry alone does not determine.

    These are joints with inexact mirror images, and all joints of a planar body, because its legs
    coincide.
    """
    partner, sign = mirror
    found, turned = kinematics.images(np.array([1.0, 0.0, 0.0]), q, slack=0.5)
    known = (found == partner) & (turned == sign) & (not planar)
    return {
        name: (kinematics.names[partner[j]], int(sign[j]))
        for j, name in enumerate(kinematics.names)
        if not known[j]
    }


def _sizes(best: Candidate, between_legs: bool) -> tuple[float, float]:
    """Hip height and body length in m in the standing pose.

    between_legs: whether only the trunk between the legs, and they, count.
    """
    model, data = best.kinematics.model, mujoco.MjData(best.kinematics.model)
    data.qpos[:] = best.qpos
    mujoco.mj_kinematics(model, data)
    legs = {b for group in best.kinematics.feet for b in geometry.ancestors(model, group[0] + 1)}
    counted = legs if between_legs else None
    length = geometry.body_length(model, data, np.array([1.0, 0.0, 0.0]), counted)
    return stance_of(best.kinematics, best.qpos[7:]).hip, length


def _train(best: Candidate, symmetric: bool, hip: float, length: float, skeleton: bool) -> Settings:
    """Return the table `[train]`. hip, length: m, of the hip height and the body."""
    body = best.kinematics
    traits = Traits(
        steps=best.drive.must_step,
        legs=len(body.feet),
        hinges=len(body.joints),
        symmetric=symmetric,
        hip=hip,
        length=length,
        mass=body.mass,
        time_step=float(body.model.opt.timestep),
        rotor=float(np.median([joint.armature for joint in body.joints])),
        skeleton=skeleton,
    )
    return train_table(traits, best.notes)
