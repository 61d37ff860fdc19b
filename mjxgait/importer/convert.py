"""`import_model`: conversion of a model file to the texts of a creature folder."""

import dataclasses
import math
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.creature import ORIGIN
from mjxgait.creature.geometry import posed
from mjxgait.creature.settings import RigSettings
from mjxgait.errors import UserError, listed
from mjxgait.importer.anatomy import Anatomy, in_plane
from mjxgait.importer.balance import steady_balance
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.bones import add_bones
from mjxgait.importer.drive import step_if_narrow, swing_arms
from mjxgait.importer.find import find_anatomy
from mjxgait.importer.notes import Notes, one_line, plain_names, report_dropped, report_left_out
from mjxgait.importer.orient import (
    find_forward,
    find_mirror,
    is_planar,
    yaw_to,
)
from mjxgait.importer.origin import origin_files
from mjxgait.importer.read import source_of
from mjxgait.importer.robots import find_robot, robot_name
from mjxgait.importer.source import Source
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

XML, TOML, README, _ = WRITTEN = ("creature.xml", "creature.toml", "README.md", ORIGIN)
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
    """Import a creature from a model (MJCF, URDF, xacro) or a skeleton (BVH, skinned GLB or FBX).

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
    for folder in choices.search:
        if not folder.is_dir():
            raise UserError(f"--search {folder}: no such folder")
    source = source_of(path, choices.search, choices.up, choices.height, notes)
    model = _compiled(source, choices, notes)
    up = source.up.value if source.up else choices.up
    keep = *choices.keep, *sorted(source.swings)
    anatomy = find_anatomy(model, source.coupled, keep, choices.freeze, up, notes, source.limbs)
    if source.up:
        notes.guess("up", source.up.value, source.up.confidence, source.up.reason)
    report_left_out(model, anatomy.bodies, notes)
    place_bodies(model, anatomy)
    joints = add_joints(model, anatomy, source.efforts, notes)
    add_bones(anatomy.spec, notes)
    feet = [anatomy.bodies.index(b) for b in anatomy.feet]
    kinematics = KinematicModel(
        anatomy.spec, feet, *joints, in_plane(model, anatomy.root), anatomy.swinging
    )
    start = first_pose(kinematics, model, anatomy)
    kinematics.turn(yaw_to(find_forward(kinematics, start, choices.forward, notes)))
    rest = kinematics.qpos(np.zeros(len(kinematics.joints))) if source.up else None
    planar = is_planar(kinematics, start) is not None
    mirror = find_mirror(kinematics, start, planar, notes)
    best = standing(
        kinematics, offered_poses(kinematics, model, anatomy, source, start), mirror, planar, notes
    )
    _balance(best, source, model.body(anatomy.root).name, planar)
    if rest is not None:
        rest[:3] = best.qpos[:3]
    rig = _rig(path, source, model, anatomy)
    imported = _folder(_name(path, choices), rig, best, mirror, planar, rest)
    return dataclasses.replace(imported, files=imported.files | origin_files(path, rig))


def _compiled(source: Source, choices: ImportChoices, notes: Notes) -> mujoco.MjModel:
    """MuJoCo's model of a source; tells what it changed or dropped."""
    parts = source.tree, source.assets, source.missing
    if choices.apart:
        model, changes = compile_apart(*parts, choices.seconds, choices.gigabytes)
    else:
        model, changes = compile_here(*parts)
    for what, why in changes:
        for key, file in source.files.items():
            what = what.replace(f"({key})", f'"{file}"')
        notes.change(what, why)
    report_dropped(model, notes)
    return model


def _balance(best: Candidate, source: Source, root: str, planar: bool) -> None:
    """Set how the body balances, steps and swings its arms; refuse one that lies on the floor."""
    if best.held.height < 0:
        raise UserError(
            f'"{root}" lies on the floor, and all of it that is not a foot falls through: this has '
            "no legs to walk on"
        )
    soles = {name for foot in best.feet for name in foot}
    body = best.kinematics
    steady_balance(best.drive, body.names, body.model, best.qpos, soles, best.notes)
    if planar:
        return
    if source.bones:
        step_if_narrow(body, best.q, best.drive, best.notes)
    arms = {name for name, arm in zip(body.names, body.arms, strict=True) if arm}
    swing_arms(body, best.drive, source.swings | arms, best.notes)


def _name(path: Path, choices: ImportChoices) -> str:
    """Name of the creature."""
    plain = plain_names([choices.name or path.stem.removesuffix(".urdf")], ["creature"])[0]
    return plain.strip(".-") or "creature"


def _rig(path: Path, source: Source, model: mujoco.MjModel, anatomy: Anatomy) -> RigSettings:
    """The file, its bones by part, and the parts that hang; no bones for what is no skeleton."""
    bones = {
        body.name: source.bones[model.body(b).name]
        for body, b in zip(anatomy.spec.bodies[1:], anatomy.bodies, strict=True)
        if source.bones
    }
    turned = {part: _rounded(geometry.quaternion(turn)) for part, turn in source.turned.items()}
    return RigSettings(one_line(path.name), bones, turned)


def _rounded(quat: np.ndarray) -> tuple[float, float, float, float]:
    w, x, y, z = (round(float(value), 9) for value in quat)
    return w, x, y, z


def _folder(
    name: str,
    rig: RigSettings,
    best: Candidate,
    mirror: tuple[np.ndarray, np.ndarray] | None,
    planar: bool,
    rest: np.ndarray | None,
) -> Imported:
    """Write the texts of the folder.

    rig: the file, and its bones, none for others. rest: [nq] rest pose of a skeleton, None for
    other models.
    """
    kinematics, notes = best.kinematics, best.notes
    _tell(best)
    pairs = {} if mirror is None else _stated_pairs(kinematics, best.q, mirror, planar)
    kinematics.pose(best.q)
    passing = planar and bool(geometry.parallel(kinematics.data.xaxis[1:]).all())
    is_rig = bool(rig.bones)
    hip, length, stated = _sizes(best, is_rig)
    if is_rig and len(best.feet) in NATURAL:
        why = "of random poses of its many joints few stand; --gait auto leaves it open"
        notes.guess(GAIT, "natural", "medium", why)
    train = _train(best, mirror is not None, hip, length, is_rig)
    toml = creature_toml(
        name,
        best,
        mirror is not None,
        pairs,
        length if stated else None,
        passing,
        rig,
        train,
    )
    report = (
        f"# {name}\n\nMade by `mjxgait import` from {rig.file}.\n\n```text\n{notes.text()}\n```\n"
    )
    xml = creature_xml(kinematics.spec, name, best.qpos, rest)
    return Imported(name, {XML: xml, TOML: toml, README: report}, notes, best.held.stands)


def _tell(best: Candidate) -> None:
    """Report trunk, feet, and joints that rest on a stop."""
    kinematics, notes = best.kinematics, best.notes
    notes.guess("trunk", kinematics.bodies[0].name, "high", "the body that all limbs hang on")
    sure = math.isfinite(best.held.up) and best.held.stands
    notes.guess(
        "feet", f"{len(best.feet)} feet", "high" if sure else "low", "limbs that end lowest"
    )
    if stopped := [joint.name for joint in kinematics.joints if joint.limited == 1]:
        notes.change(
            f"limits act on {listed(stopped)} only",
            "these stand at the end of their range and rest on it",
        )


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


def _sizes(best: Candidate, between_legs: bool) -> tuple[float, float, bool]:
    """Hip height and body length in m in the standing pose, and whether the length is stated.

    Speeds count in body lengths: a biped measured from its back to its toes would score well for
    shuffling. So it is no shorter than its legs.
    between_legs: whether only the trunk between the legs, and they, count.
    """
    model = best.kinematics.model
    data = posed(model, best.qpos)
    legs = {b for group in best.kinematics.feet for b in geometry.ancestors(model, group[0] + 1)}
    counted = legs if between_legs else None
    length = geometry.body_length(model, data, np.array([1.0, 0.0, 0.0]), counted)
    hip = stance_of(best.kinematics, best.qpos[7:]).hip
    why = "from the hindmost to the foremost leg: tails and necks do not count"
    if length < hip:
        length, why = (
            hip,
            "the hip height: the body is shorter than its legs, and speeds count in it",
        )
    elif not between_legs:
        return hip, length, False
    best.notes.guess("body_length", f"{length:.3g}", "medium", why)
    return hip, length, True


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
