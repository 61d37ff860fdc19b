"""Bones along the limbs, as animation programs draw them.

A joint's Y axis leads to the next joint, and its X axis is the axis of the part's hinge. glTF's
axes: Y up, forward +Z, left +X. A glTF joint has no tail; programs use the way to its child
instead, so the last joint of a limb gets a child at its tip, the end for inverse kinematics.
Letters: `B` joints.
"""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.animation.export.skeleton import Skeleton, world_poses
from mjxgait.animation.export.surface import far_end

TIP = "_tip"
"""Suffix to a part's name for the joint at its end."""
CLEAR = 0.25
"""Share of the way to the farthest child; if the mean way is shorter, the bone keeps its axes."""
ALONG = 0.8
"""Cosine; an axis nearer than that to the bone is not used as its X axis."""
LIKED = np.array([1.0, 0.01, 0.1])
"""Side that a bone's X axis points to: left, else ahead, else up."""
LEFT, AHEAD = np.eye(3)[0], np.eye(3)[2]


def along_limbs(
    model: mujoco.MjModel, skeleton: Skeleton, rest: np.ndarray, axes: np.ndarray
) -> Skeleton:
    """The skeleton with its bones along the limbs of a pose [nq], and with their tips.

    The root keeps its axes, and so does a part with children all around it.
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
    """The skeleton with joints at its tips, which look ahead.

    tips: [3] m from the joint above, by its place.
    """
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
    """Axis [3] of each body's last hinge: a turn about it changes only the hinge's angle."""
    data = mujoco.MjData(model)
    data.qpos[:] = rest
    mujoco.mj_kinematics(model, data)
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    return {int(model.jnt_bodyid[j]): axes @ data.xaxis[j] for j in hinges}


def _frame(way: np.ndarray, hinge: np.ndarray | None) -> np.ndarray:
    """Axes [3, 3] with Y along a way [3] and X along the hinge.

    Without a usable hinge X points to the left, or ahead if the way leads to a side.
    """
    y = way / np.linalg.norm(way)
    sides = [LEFT, AHEAD] if hinge is None else [hinge, LEFT, AHEAD]
    side = next(axis for axis in sides if abs(axis @ y) < ALONG)
    x = side - (side @ y) * y
    x /= np.copysign(np.linalg.norm(x), x @ LIKED)
    return np.stack([x, y, np.cross(x, y)], 1)
