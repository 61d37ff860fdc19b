"""Kinematic model of the creature: poses, feet, and mirror images.

Letters: `J` active joints, `B` bodies in the list's order (MuJoCo's ids less one).
"""

import dataclasses
import functools
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.geometry import quaternion, rotation
from mjxgait.importer.shapes import Shape, shapes_of
from mjxgait.importer.spec import compiled

SHANK_END = 0.7
"""Share of a shank's length from which on it acts as the foot."""


@dataclasses.dataclass(frozen=True, eq=False)
class Tip:
    """A shape of a foot.

    far: [n] mask of the points at the foot's end; the others belong to the shank.
    """

    shape: Shape
    far: np.ndarray

    @functools.cached_property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Points [n, 3] of the shank and of the foot's end; cached for the search."""
        return self.shape.points[~self.far], self.shape.points[self.far]


def tip_points(tips: list[Tip], xpos: np.ndarray, xrot: np.ndarray, far: bool = True) -> np.ndarray:
    """Lowest points [n, 3] of the balls of a foot's end, or of its shank."""
    found = []
    for t in tips:
        low = xpos[t.shape.body] + t.ends[far] @ xrot[t.shape.body].T
        low[:, 2] -= t.shape.radius
        found.append(low)
    return np.concatenate(found) if found else np.zeros((0, 3))


class KinematicModel:
    """Kinematic model of an editable model.

    spec: the editable model. bodies, joints: its own, without the world and the free joint.
    parent: [B] places of the parents, -1 for the trunk. shapes: of each body. low, high: [J] limits
    in rad, infinite where there is none. feet: for each foot the places of its bodies. source: [J]
    joint ids in the file. effort: [J] N·m, nan where the file states none. in_plane: whether the
    file lets the trunk move in a plane only. arms: [J] whether a joint swings an arm.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        feet: list[int],
        source: list[int],
        effort: np.ndarray,
        in_plane: bool,
        swinging: Sequence[int] = (),
    ) -> None:
        """Compile the editable model.

        Args:
          feet: place of each foot's last moving body. swinging: ids in the file of arms' joints.
        """
        self.arms = np.isin(source, swinging)
        self.spec, self.source, self.effort, self.in_plane = spec, source, effort, in_plane
        self.model = compiled(spec)
        self.data = mujoco.MjData(self.model)
        self.bodies, self.joints = spec.bodies[1:], spec.joints[1:]
        self.parent = self.model.body_parentid[1:] - 1
        self.shapes = [shapes_of(spec, body, i) for i, body in enumerate(self.bodies)]
        self.names = [joint.name for joint in self.joints]
        ranges = np.array([joint.range for joint in self.joints]).reshape(-1, 2)
        limited = ranges[:, 0] < ranges[:, 1]
        self.low = np.where(limited, ranges[:, 0], -np.inf)
        self.high = np.where(limited, ranges[:, 1], np.inf)
        self.feet = [self.welded(i) for i in feet]
        self.tips = [self._foot_tips(group) for group in self.feet]
        self.trunk = self.welded(0)
        self.mass = float(self.model.body_mass.sum())

    def copy(self) -> "KinematicModel":
        """Return a copy, compiled anew, that can be edited on its own."""
        feet = [group[0] for group in self.feet]
        swinging = np.array(self.source)[self.arms]
        return KinematicModel(
            self.spec.copy(), feet, self.source, self.effort, self.in_plane, swinging.tolist()
        )

    def welded(self, i: int) -> list[int]:
        """Return a moving body and the bodies fixed to it."""
        group = [i]
        for k in range(i + 1, len(self.bodies)):
            if self.parent[k] in group and not self.model.body_jntnum[k + 1]:
                group.append(k)
        return group

    def segments(self) -> list[list[int]]:
        """Return all moving bodies, the trunk first, each with the bodies fixed to it."""
        return [self.welded(i) for i, count in enumerate(self.model.body_jntnum[1:]) if count]

    def leg(self, foot: int) -> list[int]:
        """Places in `joints` of the joints between the trunk and a foot, the highest first."""
        chain = geometry.ancestors(self.model, self.feet[foot][0] + 1)
        on_leg = np.isin(self.model.jnt_bodyid[1:], chain)
        return [int(j) for j in np.flatnonzero(on_leg)]

    def lowest(self, xpos: np.ndarray, xrot: np.ndarray, chosen: list[int]) -> float:
        """Lowest point in m of the chosen bodies at places [B, 3] with rotations [B, 3, 3]."""
        lows = [np.inf]
        for i in chosen:
            lows += [
                float((xpos[i, 2] + s.points @ xrot[i, 2]).min() - s.radius) for s in self.outer[i]
            ]
        return min(lows)

    @functools.cached_property
    def outer(self) -> list[list[Shape]]:
        """Shapes of each body that touch the floor; those that are drawn where none does."""
        return [
            [s for s in shapes if s.solid] or [s for s in shapes if s.seen]
            for shapes in self.shapes
        ]

    def _foot_tips(self, group: list[int]) -> list[Tip]:
        """Shapes that a limb can step on, at the far end of its last moving and welded bodies."""
        foot, chain = group[0], geometry.ancestors(self.model, group[0] + 1)[:-1]
        above = sum(float(np.linalg.norm(self.model.body_pos[b])) for b in chain)
        places = {foot: (np.zeros(3), np.eye(3))}
        for i in group[1:]:
            at, turn = places[self.parent[i]]
            places[i] = (
                at + turn @ self.bodies[i].pos,
                turn @ rotation(self.bodies[i].quat),
            )
        shapes = [s for i in group for s in self.shapes[i]]
        shapes = [s for s in shapes if s.solid] or [s for s in shapes if s.seen]
        if not shapes:
            return []
        joints = self.bodies[foot].joints
        ankle = joints[-1].pos if joints else np.zeros(3)
        clouds = [places[s.body][0] + s.points @ places[s.body][1].T - ankle for s in shapes]
        cloud = np.concatenate(clouds)
        far = cloud[np.linalg.norm(cloud, axis=1).argmax()]
        reach = float(np.linalg.norm(far))
        # All of a short last part, a foot, may step; only the far end of a long one, a shank.
        share = SHANK_END if reach > 0.25 * (above + reach) else -np.inf
        return [Tip(s, c @ far > share * reach**2) for s, c in zip(shapes, clouds, strict=True)]

    def pose(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [B, 3] m and rotations [B, 3, 3] at joint angles [J], the trunk as placed."""
        self.data.qpos[:] = self.qpos(q)
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.xpos[1:].copy(), self.data.xmat[1:].reshape(-1, 3, 3).copy()

    def qpos(self, q: np.ndarray) -> np.ndarray:
        """Pose [nq] at joint angles [J], with the trunk as placed."""
        root = self.bodies[0]
        return np.concatenate([root.pos, root.quat / np.linalg.norm(root.quat), q])

    def centre_of_mass(self) -> np.ndarray:
        """Centre of mass [3] m in the latest pose."""
        mujoco.mj_comPos(self.model, self.data)
        return self.data.subtree_com[1].copy()

    def sole_points(self, xpos: np.ndarray, xrot: np.ndarray) -> list[np.ndarray]:
        """Sole points [n, 3] m of each foot; without shapes, the place of its farthest part."""
        soles = [tip_points(tips, xpos, xrot) for tips in self.tips]
        return [
            sole if len(sole) else xpos[group[-1:]]
            for sole, group in zip(soles, self.feet, strict=True)
        ]

    def shank_height(self, xpos: np.ndarray, xrot: np.ndarray) -> float:
        """Lowest point in m of the last parts of the legs, without their ends."""
        return min(
            float(tip_points(tips, xpos, xrot, far=False)[:, 2].min(initial=np.inf))
            for tips in self.tips
        )

    def jacobian(self, foot: int, at: np.ndarray) -> np.ndarray:
        """Motion [J, 3] m/rad of a point [3] m of a foot per joint, in the latest pose."""
        moves = np.zeros((len(self.joints), 3))
        for j in self.leg(foot):
            moves[j] = np.cross(self.data.xaxis[j + 1], at - self.data.xanchor[j + 1])
        return moves

    def mirror(self, forward: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Partner and sign [J] under reflection in the vertical plane along `forward` [3].

        None for an unsymmetric body.
        """
        partner, sign = self.images(forward, q, slack=1.0)
        return None if (partner < 0).any() else (partner, sign)

    def images(
        self, forward: np.ndarray, q: np.ndarray, slack: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Partner [J] under that reflection, -1 for a joint without one, and sign [J].

        slack: tolerance of images, in units of the one for a creature's folder.
        """
        self.pose(q)
        mujoco.mj_comPos(self.model, self.data)
        left = np.cross([0.0, 0.0, 1.0], forward)
        frame = np.stack([forward, left, [0.0, 0.0, 1.0]])
        anchors, axes, carried = (
            (self.data.xanchor[1:] - self.data.xpos[1]) @ frame.T,
            self.data.xaxis[1:] @ frame.T,
            (self.data.subtree_com[self.model.jnt_bodyid[1:]] - self.data.xpos[1]) @ frame.T,
        )
        near = 0.02 * float(np.ptp(self.data.xanchor[1:], axis=0).max() + 0.05)
        slides = np.zeros(len(self.joints), bool)
        return geometry.mirror_images(anchors, axes, slides, carried, slack * near, slack)

    def turn(self, matrix: np.ndarray) -> None:
        """Turn the trunk and everything on it about the world's origin. matrix: [3, 3]."""
        root = self.bodies[0]
        root.pos, root.quat = matrix @ root.pos, quaternion(matrix @ rotation(root.quat))
