"""The bones of a creature, and their places in a pose, in the axes of glTF and BVH.

glTF is Y-up with +Z forward and +X left, quaternions are (x, y, z, w). Letters: `F` key frames, `B`
joints of the skin (the root on the floor, then the bodies).
"""

import dataclasses

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait.animation.export.loop import WalkLoop

STILL = 1e-6
"""m or unit quaternion; smaller motions are not animated."""


@dataclasses.dataclass(frozen=True, eq=False)
class Skeleton:
    """The joints of the skin in glTF's axes.

    names: [B]. parent: [B] place of the parent, -1 for the root. bodies: [B] MuJoCo's body, 0 (the
    world) for the root. offset: [B, 3] m from the body's origin to the joint, in the body's axes.
    turn: [B, 3, 3] from the joint's axes to the body's.
    """

    names: tuple[str, ...]
    parent: tuple[int, ...]
    bodies: tuple[int, ...]
    offset: np.ndarray
    turn: np.ndarray


def skeleton_of(model: mujoco.MjModel, trunk: int) -> Skeleton:
    """The bodies of the trunk's tree with their own axes, below a root that stays on the floor.

    Other moving bodies (an opponent, a cube) are included.
    """
    own = (model.body_rootid == model.body_rootid[trunk]) | (model.body_treeid >= 0)
    bodies = [0, *(int(b) for b in np.flatnonzero(own))]
    parents = (-1, *(bodies.index(int(model.body_parentid[b])) for b in bodies[1:]))
    names = ("root", *(model.body(b).name or f"body_{b}" for b in bodies[1:]))
    count = len(bodies)
    return Skeleton(
        names, parents, tuple(bodies), np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1))
    )


def gltf_axes(forward: np.ndarray) -> np.ndarray:
    """Rotation [3, 3] from MuJoCo's world to glTF's: left to +X, up to +Y, forward [2] to +Z."""
    way = np.append(forward, 0.0)
    return np.stack([np.cross([0.0, 0.0, 1.0], way), [0.0, 0.0, 1.0], way])


def local_poses(
    model: mujoco.MjModel, skeleton: Skeleton, qpos: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions [F, B, 3] m and quaternions [F, B, 4] of joints against their parents.

    In glTF's axes; quaternions are (x, y, z, w).
    """
    pos, rot = world_poses(model, skeleton, qpos, axes)
    local_pos, quat = pos.copy(), np.zeros((*pos.shape[:2], 4))
    for b, parent in enumerate(skeleton.parent):
        turned = rot[:, b]
        if parent >= 0:
            back = rot[:, parent].transpose(0, 2, 1)
            local_pos[:, b] = (back @ (pos[:, b] - pos[:, parent])[..., None])[..., 0]
            turned = back @ turned
        quat[:, b] = quaternions(turned)
    return local_pos, quat


def world_poses(
    model: mujoco.MjModel, skeleton: Skeleton, qpos: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions [F, B, 3] m and rotations [F, B, 3, 3] of joints in the world, in glTF's axes."""
    data = mujoco.MjData(model)
    bodies, pos, rot = list(skeleton.bodies), [], []
    for row in qpos:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        turned = data.xmat[bodies].reshape(-1, 3, 3)
        place = data.xpos[bodies] + (turned @ skeleton.offset[..., None])[..., 0]
        pos.append(place @ axes.T)
        rot.append(axes @ turned @ axes.T @ skeleton.turn)
    return np.array(pos), np.array(rot)


def moved(
    loop: WalkLoop, skeleton: Skeleton, axes: np.ndarray, travelling: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and quaternions of the joints in each frame; see `local_poses`.

    A loop with a path follows it. Otherwise, if travelling, the root moves on evenly, in a circle
    if the walk turns.
    """
    pos, quat = local_poses(loop.walk.creature.model, skeleton, loop.qpos, axes)
    if loop.path is not None:
        pos[:, 0] = np.pad(loop.path, ((0, 0), (0, 1))) @ axes.T
    elif travelling:
        pos[:, 0], turned = _travel(loop)
        quat[:, 0, 1], quat[:, 0, 3] = np.sin(turned / 2), np.cos(turned / 2)
    return pos, quat


def walked(
    loop: WalkLoop, skeleton: Skeleton, axes: np.ndarray, travelling: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rotations of the joints in each frame; see `world_poses`.

    travelling: all of them move on evenly, in a circle if the walk turns.
    """
    pos, rot = world_poses(loop.walk.creature.model, skeleton, loop.qpos, axes)
    if not travelling:
        return pos, rot
    gone, heading = _travel(loop)
    about = Rotation.from_euler("y", heading[:, None]).as_matrix()[:, None]
    return (about @ pos[..., None])[..., 0] + gone[:, None], about @ rot


def resting(loop: WalkLoop) -> np.ndarray:
    """The rest pose [nq] above the origin."""
    creature = loop.walk.creature
    qpos = creature.rest_qpos.copy()
    place = creature.root_qpos
    qpos[place : place + 2] = 0.0
    return qpos


def _travel(loop: WalkLoop) -> tuple[np.ndarray, np.ndarray]:
    """Even motion of the root: [F, 3] m, and [F] rad to the left; a circle if the walk turns."""
    share = np.linspace(0, 1, len(loop.qpos))
    turned = share * loop.turned
    # A chord is sin(a / 2) / (a / 2) times as long as the way along the circle.
    chord = share * loop.advance * np.sinc(turned / (2 * np.pi))
    ahead = np.stack([np.sin(turned / 2), np.zeros_like(turned), np.cos(turned / 2)], 1)
    return chord[:, None] * ahead, turned


def quaternions(rotations: np.ndarray) -> np.ndarray:
    """Quaternions [F, 4] (x, y, z, w) of rotations [F, 3, 3].

    Neighbours lie on the same side of the sphere, so that they can be interpolated.
    """
    quats = np.zeros((len(rotations), 4))
    for i, rotation in enumerate(rotations):
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(rotation).ravel())
        quats[i] = np.roll(quat, -1)
        if i and quats[i] @ quats[i - 1] < 0:
            quats[i] *= -1
    return quats
