"""Retargeting of bone rotations to a creature's hinges: names, axes, and a least-squares fit.

A bone at rest corresponds to a part in the creature's rest pose. From there both turn equally, each
relative to the next matched part above it. Axes are [3, 3], from the creature's world to the
file's. Letters: `F` frames, `B` bones, `J` actuated joints.
"""

import dataclasses
import difflib
import re
from collections.abc import Callable, Iterable, Mapping

import mujoco
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import Clip
from mjxgait.creature import Creature
from mjxgait.creature.geometry import ancestors, posed
from mjxgait.errors import UserError, did_you_mean

LIKE = 0.6
"""Likeness from which two names count as the same."""
SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
SAME = {
    "upleg": "thigh",
    "upperleg": "thigh",
    "femur": "thigh",
    "upper": "thigh",
    "calf": "shin",
    "lowerleg": "shin",
    "shank": "shin",
    "tibia": "shin",
    "lower": "shin",
    "rear": "hind",
    "back": "hind",
    "fore": "front",
    "foreleg": "front",
    "hips": "pelvis",
    "pelvis": "pelvis",
    "torso": "trunk",
    "body": "trunk",
    "toe": "foot",
    "toes": "foot",
    "ankle": "foot",
}
"""Names of body parts in rigs, and one common word for each."""


def matched(
    wanted: Iterable[str], found: Iterable[str], table: Mapping[str, object] | None, where: str
) -> dict[str, str]:
    """Name in the file by wanted name, for those with a match.

    Args:
      table: the user's names in the file by wanted name; it takes precedence over likeness.
      where: the table's file, for errors.

    Raises:
      UserError: the table has an unknown name.
    """
    wanted, found = list(wanted), list(found)
    pairs = {}
    for own, other in (table or {}).items():
        for name, known in ((own, wanted), (str(other), found)):
            if name not in known:
                raise UserError(f'{where}: "{name}" is not there; {did_you_mean(name, known)}')
        pairs[own] = str(other)
    pairs |= {name: name for name in wanted if name in found and name not in pairs}
    words = {name: _words(name) for name in {*wanted, *found}}
    likely = sorted(
        ((_likeness(words[a], words[b]), a, b) for a in wanted for b in found), reverse=True
    )
    for likeness, own, other in likely:
        if likeness >= LIKE and own not in pairs and other not in pairs.values():
            pairs[own] = other
    return {name: pairs[name] for name in wanted if name in pairs}


def _words(name: str) -> tuple[frozenset[str], str]:
    """Side in a name, and its other words in sorted order."""
    plain = re.sub(r"^.*:", "", name)
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    words = [word for word in re.split(r"[^a-z]+", plain.lower()) if word]
    joined = re.sub(r"\b(up|upper|lower) leg\b", r"\1leg", " ".join(words)).split()
    sides = frozenset(SIDES[word] for word in joined if word in SIDES)
    return sides, " ".join(sorted(SAME.get(word, word) for word in joined if word not in SIDES))


def _likeness(one: tuple[frozenset[str], str], other: tuple[frozenset[str], str]) -> float:
    """Likeness of two names from 0 to 1; 0 for different sides."""
    if one[0] != other[0]:
        return 0.0
    return difflib.SequenceMatcher(None, one[1], other[1]).ratio()


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
    rest = _world(creature, clip)
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


def _world(creature: Creature, clip: Clip) -> dict[int, np.ndarray]:
    """World rotation [3, 3] of each body in the rest pose of the file, or of our own export."""
    model = creature.model if clip.note else creature.rest_model
    data = posed(model, creature.rest_qpos)
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


WAYS = {"z": (0, 0, 1), "-z": (0, 0, -1), "x": (1, 0, 0), "-x": (-1, 0, 0)}
"""Directions in which the file's creature looks at rest, in the file's axes with Y up."""
USUAL = "z"
TRIED = 12
"""Number of frames on which two guesses are compared."""


def axes_of(
    creature: Creature, clip: Clip, bones: Mapping[str, str], way: str | None
) -> np.ndarray:
    """The axes of a file.

    Without a way these are the usual ones, or those of the file that the creature was imported
    from, if its joints can then follow the motion better.

    Args:
      bones: bone by the name of the part. way: direction in which the file's creature looks, Y
        being up.
    """
    usual, own = facing(creature, way or USUAL), rig_axes(creature)
    if way or own is None or np.allclose(own, usual, atol=1e-3):
        return usual
    few = np.linspace(0, len(clip.times) - 1, TRIED).astype(int)
    short = dataclasses.replace(clip, times=clip.times[few], turned=clip.turned[few])

    def lacks(axes: np.ndarray) -> float:
        errors = retarget(creature, short, bones, axes).errors.values()
        return float(np.mean(np.square([*errors])))

    return min((usual, own), key=lacks)


def facing(creature: Creature, way: str) -> np.ndarray:
    """The axes of a file with Y up and the creature looking along a way.

    Raises:
      UserError: there is no such way.
    """
    if way not in WAYS:
        raise UserError(f'forward = "{way}": must be one of {", ".join(WAYS)}')
    forward, left = creature.frame.start_axes
    own = np.stack([left, [0.0, 0.0, 1.0], forward])
    ahead, up = np.array(WAYS[way], float), np.array([0.0, 1.0, 0.0])
    return np.stack([np.cross(up, ahead), up, ahead], 1) @ own


def rig_axes(creature: Creature) -> np.ndarray | None:
    """The axes of the file that the creature was imported from; None if it was not a rig."""
    if not creature.is_rig:
        return None
    data = posed(creature.model, creature.rest_qpos)
    return np.array(data.xmat[creature.trunk].reshape(3, 3).T)
