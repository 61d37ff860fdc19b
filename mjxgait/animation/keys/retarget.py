"""Retargeting of bone rotations to a creature's hinges: least squares within their ranges.

A bone at rest corresponds to a part in the creature's rest pose. From there both turn equally, each
relative to the next matched part above it. Letters: `F` frames, `J` actuated joints.
"""

import dataclasses
from collections.abc import Callable, Mapping

import mujoco
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import Clip
from mjxgait.creature import Creature
from mjxgait.creature.geometry import ancestors
from mjxgait.errors import UserError

ENDLESS = 4 * np.pi
"""rad; limit of a hinge without a range."""


@dataclasses.dataclass(frozen=True, eq=False)
class Retargeted:
    """Retargeted motion.

    angles: [F, J] rad. errors: by joint, rad [F] of rotation that its segment cannot do.
    """

    angles: np.ndarray
    errors: Mapping[str, np.ndarray]


@dataclasses.dataclass(frozen=True, eq=False)
class Segment:
    """Parts between a matched part and the next matched part above it.

    top: the upper end. bodies: from the top down, without it. joints: places [n] in the creature's
    joints.
    """

    top: int
    bodies: tuple[int, ...]
    joints: tuple[int, ...]


def movers(creature: Creature) -> list[str]:
    """Names of the parts that a bone can match: the trunk and all parts with actuated joints."""
    model = creature.model
    bodies = dict.fromkeys([creature.trunk, *_bodies_of_joints(creature)])
    return [str(model.body(b).name) for b in bodies]


def retarget(
    creature: Creature, clip: Clip, bones: Mapping[str, str], axes: np.ndarray
) -> Retargeted:
    """The angles that turn the creature's parts like the bones.

    Joints of parts without a bone keep their standing angles.

    Args:
      bones: bone by the name of the part. axes: [3, 3] from the creature's world to the file's.

    Raises:
      UserError: no part but the trunk has a bone.
    """
    model, frames = creature.model, len(clip.times)
    parts = {model.body(name).id: clip.names.index(bone) for name, bone in bones.items()}
    segments = _segments(creature, parts)
    if not segments:
        raise UserError(
            f"none of its bones is like a part of {creature.name}: {', '.join(movers(creature))}; "
            "name them in a table with --names"
        )
    rest = _world(creature)
    turned = {
        body: axes.T @ clip.turned[:, bone] @ axes
        for body, bone in {creature.trunk: _trunk_bone(clip, parts, creature), **parts}.items()
    }
    angles = np.tile(creature.joints.stand, (frames, 1))
    errors: dict[str, np.ndarray] = {}
    for segment in segments:
        top, end = segment.top, segment.bodies[-1]
        relative = turned[top].transpose(0, 2, 1) @ turned[end]
        wanted = rest[top].T @ relative @ rest[end]
        angles[:, segment.joints], missed = _solved(creature, segment, wanted)
        errors |= {creature.joints.names[j]: missed for j in segment.joints}
    return Retargeted(angles, errors)


def _bodies_of_joints(creature: Creature) -> list[int]:
    return [int(creature.model.joint(name).bodyid[0]) for name in creature.joints.names]


def _segments(creature: Creature, parts: Mapping[int, int]) -> list[Segment]:
    """One segment for each part with a bone below the trunk, if it has a joint."""
    of_joints = _bodies_of_joints(creature)
    found = []
    for end in sorted(parts):
        bodies: list[int] = []
        for body in ancestors(creature.model, end):
            if body == creature.trunk or (body in parts and body != end):
                break
            bodies.insert(0, body)
        else:
            continue
        joints = tuple(j for j, at in enumerate(of_joints) if at in bodies)
        if joints:
            found.append(Segment(body, tuple(bodies), joints))
    return found


def _trunk_bone(clip: Clip, parts: Mapping[int, int], creature: Creature) -> int:
    """The bone of the trunk; if none is matched, the lowest bone above all matched ones."""
    if creature.trunk in parts:
        return parts[creature.trunk]

    def lineage(bone: int) -> list[int]:
        line = [bone]
        while clip.parents[line[-1]] >= 0:
            line.append(clip.parents[line[-1]])
        return line

    common = set.intersection(*(set(lineage(bone)[1:] or [bone]) for bone in parts.values()))
    first = next(iter(parts.values()))
    return next((bone for bone in lineage(first) if bone in common), lineage(first)[-1])


def _world(creature: Creature) -> dict[int, np.ndarray]:
    """World rotation [3, 3] of each body in the rest pose."""
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.rest_qpos
    mujoco.mj_kinematics(creature.model, data)
    return {b: data.xmat[b].reshape(3, 3).copy() for b in range(creature.model.nbody)}


def _solved(
    creature: Creature, segment: Segment, wanted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Angles [F, n] rad for rotations [F, 3, 3], and the remaining error [F] rad."""
    joints = creature.joints
    places = list(segment.joints)
    low, high = (np.clip(edge[places], -ENDLESS, ENDLESS) for edge in (joints.low, joints.high))
    turn = _forward(creature, segment)
    # SciPy's first step is as long as the first guess, so angles are shifted to be never 0.
    zero, width = low - 1.0, high - low
    guess = np.clip(joints.stand[places], low, high) - zero
    found, missed = [], []
    for goal in wanted:

        def lack(counted: np.ndarray, goal: np.ndarray = goal) -> np.ndarray:
            return Rotation.from_matrix(goal.T @ turn(counted + zero)).as_rotvec()

        guess = np.clip(guess, 1.0 + 1e-9, 1.0 + width - 1e-9)
        solved = least_squares(lack, guess, bounds=(1.0, 1.0 + width))
        guess = solved.x
        found.append(guess + zero)
        missed.append(float(np.linalg.norm(solved.fun)))
    return np.array(found), np.array(missed)


def _forward(creature: Creature, segment: Segment) -> Callable[[np.ndarray], np.ndarray]:
    """Function from angles [n] to the rotation [3, 3] of the segment's end against its top."""
    model = creature.model
    of_joints = _bodies_of_joints(creature)
    steps: list[tuple[np.ndarray, list[tuple[int, np.ndarray, float]]]] = []
    for body in segment.bodies:
        hinges = [
            (i, *_axis(creature, j)) for i, j in enumerate(segment.joints) if of_joints[j] == body
        ]
        fixed = Rotation.from_quat(np.roll(model.body_quat[body], -1)).as_matrix()
        steps.append((fixed, [h for h in hinges if h[1].any()]))

    def turn(angles: np.ndarray) -> np.ndarray:
        whole = np.eye(3)
        for fixed, hinges in steps:
            whole = whole @ fixed
            for i, axis, zero in hinges:
                whole = whole @ Rotation.from_rotvec(axis * (angles[i] - zero)).as_matrix()
        return whole

    return turn


def _axis(creature: Creature, joint: int) -> tuple[np.ndarray, float]:
    """Axis [3] of a hinge, zero for a slide, and the angle of its unturned pose in rad."""
    model, at = creature.model, creature.model.joint(creature.joints.names[joint])
    hinge = int(at.type[0]) == int(mujoco.mjtJoint.mjJNT_HINGE)
    zero = float(model.qpos0[creature.joints.qpos[joint]])
    return np.array(at.axis if hinge else np.zeros(3)), zero
