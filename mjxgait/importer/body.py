"""Kinematic model of the creature as it will be written, for poses and mirror images.

Letters: `J` active joints, `B` bodies in the list's order (MuJoCo's ids less one).
"""

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.importer.parts import Body, quaternion, rotation
from mjxgait.importer.skeleton import foot_tips, tip_points
from mjxgait.importer.write_xml import compile_own, creature_xml

FREE_POS, FREE_DOF = 7, 6


class Puppet:
    """Kinematic model of the bodies.

    low, high: [J] limits in rad, infinite where there is none. feet: for each foot the places of
    its bodies.
    """

    def __init__(self, bodies: list[Body], feet: list[int], in_plane: bool = False) -> None:
        """Compile the bodies. in_plane: whether the file lets the trunk move in a plane only."""
        self.bodies, self.in_plane = bodies, in_plane
        self.model = compile_own(creature_xml("puppet", bodies, None))
        self.data = mujoco.MjData(self.model)
        self.joints = [joint for body in bodies for joint in body.joints]
        self.names = [joint.name for joint in self.joints]
        self.low = np.array([joint.low for joint in self.joints])
        self.high = np.array([joint.high for joint in self.joints])
        self.feet = [self.welded(i) for i in feet]
        self.tips = [foot_tips(bodies, group) for group in self.feet]
        self.trunk = self.welded(0)
        self.mass = float(self.model.body_mass.sum())

    def welded(self, i: int) -> list[int]:
        """Return a moving body and the bodies fixed to it."""
        group = [i]
        for k in range(i + 1, len(self.bodies)):
            if self.bodies[k].parent in group and not self.bodies[k].joints:
                group.append(k)
        return group

    def segments(self) -> list[list[int]]:
        """Return all moving bodies, the trunk first, each with the bodies fixed to it."""
        return [self.welded(i) for i, body in enumerate(self.bodies) if i == 0 or body.joints]

    def leg(self, foot: int) -> list[int]:
        """Places in `joints` of the joints between the trunk and a foot, the highest first."""
        chain, i = [], self.feet[foot][0]
        while i > 0:
            chain.append(i)
            i = self.bodies[i].parent
        order = [name for i in reversed(chain) for name in (j.name for j in self.bodies[i].joints)]
        return [self.names.index(name) for name in order]

    def pose(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [B, 3] m and rotations [B, 3, 3] at joint angles [J], the trunk as placed."""
        self.data.qpos[:] = self.qpos(q)
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.xpos[1:].copy(), self.data.xmat[1:].reshape(-1, 3, 3).copy()

    def qpos(self, q: np.ndarray) -> np.ndarray:
        """Pose [nq] at joint angles [J], with the trunk as placed."""
        return np.concatenate(
            [self.bodies[0].pos, self.bodies[0].quat / np.linalg.norm(self.bodies[0].quat), q]
        )

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

    def mirror(
        self, forward: np.ndarray, q: np.ndarray, slack: float = 1.0
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Partner and sign [J] under reflection in the vertical plane along `forward` [3].

        None for an unsymmetric body. slack: see `images`.
        """
        partner, sign = self.images(forward, q, slack)
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
