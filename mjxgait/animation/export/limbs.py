"""Bones along the limbs, as a program draws them in which one animates: from a joint its Y axis leads
to where the next one is, and about its X axis it turns as the part's hinge does.

glTF's axes: Y up, forward +Z, left +X. A joint of glTF has no tail; a program takes the way to its
child for that, so the last one of a limb gets a child at its tip, which is what inverse kinematics
aims with. Letters: `B` joints.
"""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.animation.export.skeleton import Skeleton, world_poses
from mjxgait.animation.export.surface import far_end

TIP = "_tip"
"""Behind the name of a part: the joint at its end."""
CLEAR = 0.25
"""Of the way to the farthest child; where several lead together less far, they lead nowhere."""
ALONG = 0.8
"""Cosine; a bone nearer than that to an axis turns about another one."""
LIKED = np.array([1.0, 0.01, 0.1])
"""To which side a bone's X axis looks: to the left, else ahead, else up."""
LEFT, AHEAD = np.eye(3)[0], np.eye(3)[2]


def along_limbs(
    model: mujoco.MjModel, skeleton: Skeleton, rest: np.ndarray, axes: np.ndarray
) -> Skeleton:
    """The skeleton with its bones along the limbs of a pose [nq], and with their tips.

    The root keeps its axes, and so does a part whose children lie all around it.
    """
    pos, rot = (each[0] for each in world_poses(model, skeleton, rest[None], axes))
    turn, hinges = skeleton.turn.copy(), _hinges(model, rest, axes)
    # From the world to a body's own axes.
    back = skeleton.turn @ rot.transpose(0, 2, 1)
    tips: dict[int, np.ndarray] = {}
    for b in range(1, len(skeleton.names)):
        body = skeleton.bodies[b]
        below = [c for c, parent in enumerate(skeleton.parent) if parent == b]
        if not below:
            tips[b] = axes @ far_end(model, body, rest)
        ways = pos[below] - pos[b] if below else tips[b][None]
        way, reach = ways.mean(0), np.linalg.norm(ways, axis=1).max()
        if np.linalg.norm(way) > CLEAR * reach:
            turn[b] = back[b] @ _frame(way, hinges.get(body))
    return _tipped(dataclasses.replace(skeleton, turn=turn), tips, back, axes)


def _tipped(
    skeleton: Skeleton, tips: Mapping[int, np.ndarray], back: np.ndarray, axes: np.ndarray
) -> Skeleton:
    """With joints at ends, which look ahead. tips: [3] m from the joints above, by their places."""
    ahead = np.stack([LEFT, AHEAD, np.cross(LEFT, AHEAD)], 1)
    offset = [axes.T @ back[b] @ way for b, way in tips.items()]
    return Skeleton(
        names=(*skeleton.names, *(skeleton.names[b] + TIP for b in tips)),
        parent=(*skeleton.parent, *tips),
        bodies=(*skeleton.bodies, *(skeleton.bodies[b] for b in tips)),
        offset=np.concatenate([skeleton.offset, offset]),
        turn=np.concatenate([skeleton.turn, back[list(tips)] @ ahead]),
    )


def _hinges(model: mujoco.MjModel, rest: np.ndarray, axes: np.ndarray) -> dict[int, np.ndarray]:
    """The axis [3] of each body's last hinge: turned about that nothing but its angle changes."""
    data = mujoco.MjData(model)
    data.qpos[:] = rest
    mujoco.mj_kinematics(model, data)
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    return {int(model.jnt_bodyid[j]): axes @ data.xaxis[j] for j in hinges}


def _frame(way: np.ndarray, hinge: np.ndarray | None) -> np.ndarray:
    """[3, 3] with its Y axis along a way [3] and its X axis along the hinge, without one to the left
    or, across that, ahead.
    """
    y = way / np.linalg.norm(way)
    sides = [LEFT, AHEAD] if hinge is None else [hinge, LEFT, AHEAD]
    side = next(axis for axis in sides if abs(axis @ y) < ALONG)
    x = side - (side @ y) * y
    x /= np.copysign(np.linalg.norm(x), x @ LIKED)
    return np.stack([x, y, np.cross(x, y)], 1)
