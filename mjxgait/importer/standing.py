"""Choice of a standing pose, from the file's poses and those that a search finds."""

import copy
import dataclasses
import functools
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from mjxgait.importer.anatomy import HINGE, Anatomy
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.drive import Drive, plan_drive
from mjxgait.importer.notes import Notes
from mjxgait.importer.soles import guard_parts, lay_soles
from mjxgait.importer.source import Source
from mjxgait.importer.spec import tidy
from mjxgait.importer.stance import (
    AT_ITS_END,
    CAREFUL,
    SEARCHES,
    Sampling,
    Search,
    drop,
    level,
    stance_of,
)
from mjxgait.importer.stand_test import Held, hold

TOUCH, GIVE = 0.35, 0.01
"""The floor's impedance at first touch, and depth in hip heights at which it reaches MuJoCo's usual
0.95. At the usual first 0.9 the floor kicks a foot that barely touches, and loaded feet flicker.
"""
SINK = 0.0005
"""m, initial depth of the feet in the floor, about as deep as they rest."""
FOLDED, STRAIGHT, STRAIGHTER = 0.4, 0.97, 0.99
"""Straightness below which legs count as folded up, and from which as straight; a figure's."""
STEADY = 0.97
"""Uprightness after 2 s with which a figure with arms stands steadily; else others are tried."""
STRONGER = (2.0, 4.0)
"""Factors of strength for a body that sinks, tried in this order."""
SEARCHED = "a search over leg bends"
Pose = Callable[[], np.ndarray]
"""Computes a pose [J]."""


@dataclasses.dataclass(eq=False)
class Candidate:
    """A tried standing pose: bodies with foot geoms, the keyframe, and the stand test."""

    kinematics: KinematicModel
    q: np.ndarray
    feet: list[list[str]]
    drive: Drive
    qpos: np.ndarray
    held: Held
    notes: Notes


def first_pose(kinematics: KinematicModel, model: mujoco.MjModel, anatomy: Anatomy) -> np.ndarray:
    """Pose [J] in which the anatomy was found."""
    return _angles(kinematics, model, anatomy.qpos)


def offered_poses(
    kinematics: KinematicModel,
    model: mujoco.MjModel,
    anatomy: Anatomy,
    source: Source,
    start: np.ndarray,
) -> list[tuple[str, np.ndarray]]:
    """Poses that the file offers, each with its description; arms hang in all."""
    order = sorted(
        range(model.nkey),
        key=lambda k: (
            model.key(k).name.lower() not in ("stand", "standing", "home", "walk", "walking")
        ),
    )
    poses = [
        (f'the keyframe "{model.key(k).name}"', _angles(kinematics, model, model.key_qpos[k]))
        for k in order[:3]
    ]
    poses += [
        ("init_qpos", _angles(kinematics, model, np.array(p)))
        for p in source.poses
        if len(p) == model.nq
    ]
    poses.append(("limbs let down" if anatomy.lowered else "the file's zero pose", start))
    return [
        (what, np.where(kinematics.arms, start, q)) for what, q in poses if np.isfinite(q).all()
    ]


def _angles(kinematics: KinematicModel, model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    hinges = model.jnt_type[kinematics.source] == HINGE
    q = np.where(hinges, qpos[model.jnt_qposadr[kinematics.source]], 0.0)
    return np.clip(q, kinematics.low, kinematics.high)


def standing(
    kinematics: KinematicModel,
    offered: list[tuple[str, np.ndarray]],
    mirror: tuple[np.ndarray, np.ndarray] | None,
    planar: bool,
    notes: Notes,
) -> Candidate:
    """Return the first pose that stands, of the file's and the search's; else the best one.

    A body that falls off its two feet is searched again, with them beneath its weight. If the best
    one sinks, all are tried again with more strength.
    """
    search = Search(kinematics, offered[0][1], mirror, planar)

    def searched(samplings: Sequence[Sampling], seed: int) -> list[tuple[str, Pose]]:
        # Each is searched once, when it is first needed.
        runs = [functools.partial(search.run, s, seed + i) for i, s in enumerate(samplings)]
        return [(SEARCHED, functools.cache(run)) for run in runs]

    poses = [(what, lambda q=q: q) for what, q in offered] + searched(SEARCHES, 0)
    attempt = functools.partial(_try, kinematics, planar, notes)
    found = _best_pose(search, poses, functools.partial(attempt, 1.0))
    falls = len(kinematics.feet) == 2 and not (found[1].held.stands or found[1].held.sinks)
    if falls or (search.upright and not _can_step(search, found[1].q)):
        careful = searched(CAREFUL, len(SEARCHES))
        found = _best_pose(search, careful, functools.partial(attempt, 1.0), found)
    for stronger in STRONGER:
        if not found[1].held.sinks:
            break
        found = _best_pose(search, poses, functools.partial(attempt, stronger), found)
    what, best = found
    notes.changes, notes.guesses = best.notes.changes, best.notes.guesses
    _guess_pose(what, best)
    return best


def _guess_pose(what: str, best: Candidate) -> None:
    """Note a candidate's standing pose as a guess. what: where the pose is from."""
    held = best.held
    if held.stands:
        reason = f"stood 2 s: sag {held.sag:.3f} rad, upright {held.up:.2f}"
        best.notes.guess("standing pose", what, "high", reason)
        return
    touched = f', "{held.touched}" touches the floor' if held.touched else ""
    reason = f"it falls: upright {held.up:.2f}, height {held.height:.2f} of the start{touched}"
    best.notes.guess("standing pose", what, "low", reason)


def _best_pose(
    search: Search,
    poses: Sequence[tuple[str, Pose]],
    attempt: Callable[[np.ndarray], Candidate],
    *before: tuple[str, Candidate],
) -> tuple[str, Candidate]:
    """Return a pose with its description; see `standing`.

    attempt: runs the stand test. before: poses that were tried.
    """
    tried: list[tuple[str, Candidate]] = []
    for what, pose in poses:
        tried.append((what, attempt(pose())))
        held, able = tried[-1][1].held, _can_step(search, tried[-1][1].q)
        if held.stands and able and (held.up > STEADY or not search.upright):
            break
    return max(
        [*before, *tried],
        key=lambda pair: pair[1].held.score - 0.2 * (not _can_step(search, pair[1].q)),
    )


def _can_step(search: Search, q: np.ndarray) -> bool:
    """Return whether the legs are neither straight nor folded up in a pose [J].

    Straight ones have no length left to step with, and folded ones do not swing. Such a pose is
    only the second choice. A figure's knee at its end is as good as straight: half of the poses
    near it are out of its range.
    """
    straight = STRAIGHTER if search.upright else STRAIGHT
    if search.upright and search.at_ends(q):
        return False
    return FOLDED < search.stretch(q) < straight


def _try(
    kinematics: KinematicModel,
    planar: bool,
    notes: Notes,
    stronger: float,
    q: np.ndarray,
) -> Candidate:
    """Add foot geoms in a pose, and run the stand test. stronger: see `plan_drive`."""
    notes, trial = copy.deepcopy(notes), kinematics.copy()
    level(trial, q)
    drop(trial, q)
    _keep_stops(trial, q)
    stance = stance_of(trial, q)
    trial.spec.geom("floor").solimp[:3] = (TOUCH, 0.95, GIVE * stance.hip)
    drive = plan_drive(trial, q, stance, planar, notes, stronger)
    feet = lay_soles(trial, stance, planar, notes)
    guard_parts(trial, stance, notes)
    tidy(trial.spec)
    made = trial.copy()
    drop(made, q, SINK)
    qpos = made.qpos(q)
    held = hold(
        made.model, qpos, drive.kp, drive.kd, drive.torque, {name for foot in feet for name in foot}
    )
    return Candidate(made, q, feet, drive, qpos, held, notes)


def _keep_stops(kinematics: KinematicModel, q: np.ndarray) -> None:
    """Keep the stops of joints that stand at an end of their range.

    Such a stop bears weight, like a straight knee's. Other limits are left to the controller,
    because each costs a row of the solver.
    """
    for joint, low, high in zip(
        kinematics.joints, q - kinematics.low, kinematics.high - q, strict=True
    ):
        joint.limited = int(min(low, high) < AT_ITS_END)
