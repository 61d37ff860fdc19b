"""`import_model`: from a model file to the texts of a creature folder, step by step."""

import copy
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.errors import UserError
from mjxgait.importing.anatomy import Anatomy, find_anatomy, in_plane
from mjxgait.importing.balance import steady_balance
from mjxgait.importing.body import Puppet
from mjxgait.importing.drive import Drive, plan_drive
from mjxgait.importing.hold import Held, hold
from mjxgait.importing.mjcf import clean_mjcf
from mjxgait.importing.notes import Notes, listed
from mjxgait.importing.orient import find_forward, find_mirror, is_planar, yaw_to
from mjxgait.importing.parts import Body, one_line, plain_names, rotation
from mjxgait.importing.same import check_same
from mjxgait.importing.skeleton import build_bodies
from mjxgait.importing.soles import guard_parts, lay_soles
from mjxgait.importing.source import Places, Source, parse_xml
from mjxgait.importing.stance import SPREADS, Search, drop, level, stance_of
from mjxgait.importing.urdf import clean_urdf
from mjxgait.importing.worker import compile_apart, compile_here
from mjxgait.importing.write_toml import creature_toml
from mjxgait.importing.write_xml import compile_own, creature_xml

SINK = 0.0005
"""m that feet begin in the floor, about as far as they rest in it."""
STRAIGHT = 0.97
"""Straightness from which legs count as straight."""


@dataclasses.dataclass(frozen=True)
class ImportChoices:
    """What the user says about a model.

    keep, freeze: patterns of joint names. apart: whether to compile in a process of its own.
    """

    name: str | None = None
    search: tuple[Path, ...] = ()
    keep: tuple[str, ...] = ()
    freeze: tuple[str, ...] = ()
    up: str | None = None
    forward: str | None = None
    apart: bool = True


@dataclasses.dataclass(frozen=True)
class Imported:
    """files: name and text of each file of the creature folder.

    stands: whether it stood for two seconds.
    """

    name: str
    files: dict[str, str]
    notes: Notes
    stands: bool


@dataclasses.dataclass(eq=False)
class Candidate:
    """A standing pose that was tried: the bodies with their soles, the keyframe, and how it
    held.
    """

    puppet: Puppet
    q: np.ndarray
    feet: list[list[str]]
    drive: Drive
    model: mujoco.MjModel
    qpos: np.ndarray
    held: Held
    notes: Notes


def import_model(path: Path, choices: ImportChoices | None = None) -> Imported:
    """A creature from somebody's MJCF or URDF file.

    Raises:
      UserError: it cannot be read, or is nothing that could walk; names the element and the way
        out.
    """
    choices, notes = choices or ImportChoices(), Notes()
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
    source = read_source(path, choices.search, notes)
    model, changes = (compile_apart if choices.apart else compile_here)(source.tree, source.assets)
    for what, why in changes:
        notes.change(what, why)
    _tell_dropped(model, notes)
    anatomy = find_anatomy(model, source.coupled, choices.keep, choices.freeze, choices.up, notes)
    _tell_left_out(model, anatomy, notes)
    bodies = build_bodies(model, anatomy, source.efforts, notes)
    puppet = Puppet(
        bodies, [anatomy.bodies.index(b) for b in anatomy.feet], in_plane(model, anatomy.root)
    )
    start = _start(puppet, model, anatomy)
    puppet.turn(yaw_to(find_forward(puppet, start, choices.forward, notes)))
    planar = is_planar(puppet, start) is not None
    mirror = find_mirror(puppet, start, planar, notes)
    best = _stand(puppet, _poses(puppet, model, anatomy, source, start), mirror, planar, notes)
    feet = {name for foot in best.feet for name in foot}
    steady_balance(best.drive, best.puppet.names, best.model, best.qpos, feet, best.notes)
    name = plain_names([choices.name or path.stem], ["creature"])[0]
    check_same(model, anatomy, best.puppet, best.model)
    return _folder(name, one_line(path.name), best, mirror, planar)


def read_source(path: Path, search: Sequence[Path], notes: Notes) -> Source:
    """The cleaned tree of a file.

    Raises:
      UserError: it cannot be read, or is neither MJCF nor URDF.
    """
    source = Source(parse_xml(path))
    places = Places(path, search)
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


def _tell_dropped(model: mujoco.MjModel, notes: Notes) -> None:
    for count, what, why in (
        (model.nu, "actuators", "joint torques are applied directly; their limits were read"),
        (model.ntendon, "tendons", "joint torques are applied directly"),
        (
            int((model.jnt_stiffness != 0).sum() + (model.dof_damping != 0).sum()),
            "springs and dampers",
            "the controller has its own",
        ),
        (
            int((model.dof_frictionloss != 0).sum()),
            "dry joint frictions",
            "the fast physics has none",
        ),
        (
            model.npair + model.nexclude,
            "contact pairs and exclusions",
            "shapes touch the floor only, not each other",
        ),
    ):
        if count:
            notes.change(f"{count} {what} dropped", why)
    notes.change(
        "the floor and all options replaced",
        "a flat floor; time step 5 ms, Newton solver, pyramidal friction: what every physics here "
        "can do",
    )


def _tell_left_out(model: mujoco.MjModel, anatomy: Anatomy, notes: Notes) -> None:
    """Tells what else is in the file's world: other bodies, geoms that can be touched."""
    own = {*anatomy.bodies, *geometry.ancestors(model, anatomy.root)}
    others = [b for b in range(1, model.nbody) if b not in own and model.body_parentid[b] == 0]
    touchable = (model.geom_contype | model.geom_conaffinity) != 0
    things = [
        g
        for g in np.flatnonzero(touchable & (model.geom_bodyid == 0))
        if int(model.geom_type[g]) != mujoco.mjtGeom.mjGEOM_PLANE
    ]
    names = [f'body "{model.body(b).name}"' for b in others]
    names += [f'geom "{model.geom(g).name or g}"' for g in things]
    if names:
        notes.change(f"left out: {listed(names)}", "a walk is evolved on a flat floor, alone")


def _start(puppet: Puppet, model: mujoco.MjModel, anatomy: Anatomy) -> np.ndarray:
    """[J] the pose in which the anatomy was found."""
    return _angles(puppet, model, anatomy.qpos)


def _angles(puppet: Puppet, model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    hinge = int(mujoco.mjtJoint.mjJNT_HINGE)
    q = np.array(
        [
            qpos[model.jnt_qposadr[j.id]] if int(model.jnt_type[j.id]) == hinge else 0.0
            for j in puppet.joints
        ]
    )
    return np.clip(q, puppet.low, puppet.high)


def _poses(
    puppet: Puppet, model: mujoco.MjModel, anatomy: Anatomy, source: Source, start: np.ndarray
) -> list[tuple[str, np.ndarray]]:
    """Poses that the file offers, with what they are."""
    order = sorted(
        range(model.nkey),
        key=lambda k: (
            model.key(k).name.lower() not in ("stand", "standing", "home", "walk", "walking")
        ),
    )
    poses = [
        (f'the keyframe "{model.key(k).name}"', _angles(puppet, model, model.key_qpos[k]))
        for k in order[:3]
    ]
    poses += [
        ("init_qpos", _angles(puppet, model, np.array(p)))
        for p in source.poses
        if len(p) == model.nq
    ]
    poses.append(("the file's zero pose", start))
    return [(what, q) for what, q in poses if np.isfinite(q).all()]


def _stand(
    puppet: Puppet,
    offered: list[tuple[str, np.ndarray]],
    mirror: tuple[np.ndarray, np.ndarray] | None,
    planar: bool,
    notes: Notes,
) -> Candidate:
    """The first pose that stands, of the file's own and those that a search finds; the best one
    where none does.
    """
    tried: list[tuple[str, Candidate]] = []
    search = Search(puppet, offered[0][1], mirror, planar)
    for what, q in offered:
        tried.append((what, _try(puppet, q, mirror, planar, notes)))
        # Legs that are straight out have no length left to step with: such a pose is only the
        # second choice.
        if tried[-1][1].held.stands and search.stretch(q) < STRAIGHT:
            break
    else:
        for seed, spread in enumerate(SPREADS):
            tried.append(
                (
                    "a search over leg bends",
                    _try(puppet, search.run(spread, seed)[0], mirror, planar, notes),
                )
            )
            if tried[-1][1].held.stands and search.stretch(tried[-1][1].q) < STRAIGHT:
                break
    what, best = max(
        tried, key=lambda pair: pair[1].held.score - 0.2 * (search.stretch(pair[1].q) > STRAIGHT)
    )
    held = best.held
    notes.changes, notes.guesses = best.notes.changes, best.notes.guesses
    if held.stands:
        best.notes.guess(
            "standing pose",
            what,
            "high",
            f"stood 2 s: sag {held.sag:.3f} rad, upright {held.up:.2f}",
        )
    else:
        touched = f', "{held.touched}" touches the floor' if held.touched else ""
        best.notes.guess(
            "standing pose",
            what,
            "low",
            f"it falls: upright {held.up:.2f}, height {held.height:.2f} of the start{touched}",
        )
    return best


def _try(
    puppet: Puppet,
    q: np.ndarray,
    mirror: tuple[np.ndarray, np.ndarray] | None,
    planar: bool,
    notes: Notes,
) -> Candidate:
    """Puts the creature on soles in a pose, and lets it stand."""
    notes, bodies = copy.deepcopy(notes), copy.deepcopy(puppet.bodies)
    trial = Puppet(bodies, [group[0] for group in puppet.feet])
    level(trial, q)
    drop(trial, q)
    stance = stance_of(trial, q)
    drive = plan_drive(trial, q, stance, planar, notes)
    feet = lay_soles(bodies, trial.feet, stance, planar, notes)
    guard_parts(bodies, trial.feet, trial.trunk, trial.segments(), stance, notes)
    _name_shapes(bodies)
    made = Puppet(bodies, [group[0] for group in puppet.feet])
    drop(made, q, SINK)
    qpos = made.qpos(q)
    model = compile_own(creature_xml("trial", bodies, qpos))
    held = hold(
        model, qpos, drive.kp, drive.kd, drive.torque, {name for foot in feet for name in foot}
    )
    return Candidate(made, q, feet, drive, model, qpos, held, notes)


def _name_shapes(bodies: list[Body]) -> None:
    """A name for each colliding shape that has none."""
    for body in bodies:
        unnamed = [s for s in body.shapes if s.solid and not s.name]
        for i, shape in enumerate(unnamed):
            shape.name = f"{body.name}_guard" + (f"_{i + 1}" if len(unnamed) > 1 else "")


def _folder(
    name: str,
    origin: str,
    best: Candidate,
    mirror: tuple[np.ndarray, np.ndarray] | None,
    planar: bool,
) -> Imported:
    puppet, notes = best.puppet, best.notes
    feet = [geom for foot in best.feet for geom in foot]
    trunk = puppet.bodies[0].name
    notes.guess("trunk", trunk, "high", "the body that all limbs hang on")
    notes.guess(
        "feet",
        f"{len(best.feet)} feet",
        "high" if math.isfinite(best.held.up) and best.held.stands else "low",
        "limbs that end lowest",
    )
    pairs: dict[str, tuple[str, int]] = {}
    if planar and mirror is not None:  # the geometry alone cannot tell two legs in one place apart
        pairs = {
            n: (puppet.names[mirror[0][j]], int(mirror[1][j])) for j, n in enumerate(puppet.names)
        }
    forward = rotation(puppet.bodies[0].quat).T @ [1.0, 0.0, 0.0]
    length = _stated_length(best)
    toml = creature_toml(
        name,
        origin,
        trunk,
        forward,
        feet,
        puppet.names,
        best.drive,
        (mirror is not None, pairs),
        length,
        notes,
    )
    report = (
        f"# {name}\n\nMade by `mjxgait import` from {origin}.\n\n```text\n{notes.text()}\n```\n"
    )
    files = {
        "creature.xml": creature_xml(name, puppet.bodies, best.qpos),
        "creature.toml": toml,
        "README.md": report,
    }
    return Imported(name, files, notes, best.held.stands)


def _stated_length(best: Candidate) -> float | None:
    """m, of a body that is shorter than its legs, such as a biped's; None for all others.

    Speeds are wanted and judged in body lengths. A biped, measured from its back to its toes, would
    be praised for shuffling.
    """
    model, data = best.model, mujoco.MjData(best.model)
    data.qpos[:] = best.qpos
    mujoco.mj_kinematics(model, data)
    hip = stance_of(best.puppet, best.qpos[7:]).hip
    if geometry.body_length(model, data, np.array([1.0, 0.0, 0.0])) >= hip:
        return None
    best.notes.guess(
        "body_length",
        f"{hip:.3g}",
        "medium",
        "the hip height: the body is shorter than its legs, and speeds count in it",
    )
    return hip
