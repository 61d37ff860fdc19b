"""Choice of a standing pose, from the file's poses and those that a search finds."""

import copy
import dataclasses

import mujoco
import numpy as np

from mjxgait.importer.anatomy import Anatomy
from mjxgait.importer.balance import Held, hold
from mjxgait.importer.body import KinematicModel, compile_own, creature_xml
from mjxgait.importer.drive import Drive, plan_drive
from mjxgait.importer.notes import Notes
from mjxgait.importer.parts import Body
from mjxgait.importer.soles import guard_parts, lay_soles
from mjxgait.importer.source import Source
from mjxgait.importer.stance import (
    SPREADS,
    Search,
    drop,
    level,
    stance_of,
)

SINK = 0.0005
"""m, initial depth of the feet in the floor, about as deep as they rest."""
STRAIGHT = 0.97
"""Straightness from which legs count as straight."""
AT_ITS_END = 0.05
"""rad from an end of its range within which a joint rests on it."""


@dataclasses.dataclass(eq=False)
class Candidate:
    """A tried standing pose: bodies with foot geoms, the keyframe, and the stand test."""

    puppet: KinematicModel
    q: np.ndarray
    feet: list[list[str]]
    drive: Drive
    model: mujoco.MjModel
    qpos: np.ndarray
    held: Held
    notes: Notes


def first_pose(puppet: KinematicModel, model: mujoco.MjModel, anatomy: Anatomy) -> np.ndarray:
    """Pose [J] in which the anatomy was found."""
    return _angles(puppet, model, anatomy.qpos)


def offered_poses(
    puppet: KinematicModel,
    model: mujoco.MjModel,
    anatomy: Anatomy,
    source: Source,
    start: np.ndarray,
) -> list[tuple[str, np.ndarray]]:
    """Poses that the file offers, each with its description."""
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
    poses.append(("limbs let down" if anatomy.lowered else "the file's zero pose", start))
    return [(what, q) for what, q in poses if np.isfinite(q).all()]


def _angles(puppet: KinematicModel, model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    hinge = int(mujoco.mjtJoint.mjJNT_HINGE)
    q = np.array(
        [
            qpos[model.jnt_qposadr[j.id]] if int(model.jnt_type[j.id]) == hinge else 0.0
            for j in puppet.joints
        ]
    )
    return np.clip(q, puppet.low, puppet.high)


def standing(
    puppet: KinematicModel,
    offered: list[tuple[str, np.ndarray]],
    mirror: tuple[np.ndarray, np.ndarray] | None,
    planar: bool,
    notes: Notes,
) -> Candidate:
    """Return the first pose that stands, of the file's and the search's; else the best one."""
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
    puppet: KinematicModel,
    q: np.ndarray,
    mirror: tuple[np.ndarray, np.ndarray] | None,
    planar: bool,
    notes: Notes,
) -> Candidate:
    """Add foot geoms in a pose, and run the stand test."""
    notes, bodies = copy.deepcopy(notes), copy.deepcopy(puppet.bodies)
    trial = KinematicModel(bodies, [group[0] for group in puppet.feet])
    level(trial, q)
    drop(trial, q)
    _keep_stops(trial, q)
    stance = stance_of(trial, q)
    drive = plan_drive(trial, q, stance, planar, notes)
    feet = lay_soles(bodies, trial.feet, stance, planar, notes)
    guard_parts(bodies, trial.feet, trial.trunk, trial.segments(), stance, notes)
    _name_shapes(bodies)
    made = KinematicModel(bodies, [group[0] for group in puppet.feet])
    drop(made, q, SINK)
    qpos = made.qpos(q)
    model = compile_own(creature_xml("trial", bodies, qpos))
    held = hold(
        model, qpos, drive.kp, drive.kd, drive.torque, {name for foot in feet for name in foot}
    )
    return Candidate(made, q, feet, drive, model, qpos, held, notes)


def _keep_stops(puppet: KinematicModel, q: np.ndarray) -> None:
    """Keep the stops of joints that stand at an end of their range.

    Such a stop bears weight, like a straight knee's. Other limits are left to the controller,
    because each costs a row of the solver.
    """
    for joint, angle in zip(puppet.joints, q, strict=True):
        joint.stopped = bool(min(angle - joint.low, joint.high - angle) < AT_ITS_END)


def _name_shapes(bodies: list[Body]) -> None:
    """Name each colliding shape without a name."""
    for body in bodies:
        unnamed = [s for s in body.shapes if s.solid and not s.name]
        for i, shape in enumerate(unnamed):
            shape.name = f"{body.name}_guard" + (f"_{i + 1}" if len(unnamed) > 1 else "")
