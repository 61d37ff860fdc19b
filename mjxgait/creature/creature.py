"""The static facts of a body that the other rooms need."""

import dataclasses
import hashlib
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature.settings import CreatureSettings
from mjxgait.ground.spec import LEVEL, GroundSpec, parse_ground

HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
FLOOR = "floor"


@dataclasses.dataclass(frozen=True, eq=False)
class Creature:
    """The static facts of a body. Joints are the actuated ones, in the model's order.

    files: name and text of each file, as read. model: the body as its file describes it.
    forward, left, up: [3] unit vectors in the trunk's frame.
    stand_qpos: [nq], stand_pos: [3] m and stand_rot: [3, 3] of the trunk; the standing pose.
    joint_names: [J]; qpos_adr, dof_adr: [J]; stand, pose_low, pose_high, joint_low, joint_high: [J]
    rad.
    kp, kd, torque_limit: [J] N·m/rad, N·m·s/rad, N·m. partner, sign: [J] mirror map.
    steer_bend, steer_stride, balance_pitch, balance_roll: [J] weights (docs/controller.md).
    watched: [G] geom ids, the foot geoms first; foot_of: [F] which foot each foot geom belongs to;
    foot_names: one per foot.
    ground: ids of the other geoms that may touch the floor.
    hip_height: m, mean leg length. body_length: m. mass: kg.
    terrain: the ground it walks on, which is not in `model`: there the floor is a plane.
    """

    settings: CreatureSettings
    files: Mapping[str, str]
    model: mujoco.MjModel
    trunk: int
    forward: np.ndarray
    left: np.ndarray
    up: np.ndarray
    stand_qpos: np.ndarray
    stand_pos: np.ndarray
    stand_rot: np.ndarray
    joint_names: tuple[str, ...]
    qpos_adr: np.ndarray
    dof_adr: np.ndarray
    stand: np.ndarray
    pose_low: np.ndarray
    pose_high: np.ndarray
    joint_low: np.ndarray
    joint_high: np.ndarray
    kp: np.ndarray
    kd: np.ndarray
    torque_limit: np.ndarray
    partner: np.ndarray
    sign: np.ndarray
    steer_bend: np.ndarray
    steer_stride: np.ndarray
    balance_pitch: np.ndarray
    balance_roll: np.ndarray
    watched: np.ndarray
    foot_of: np.ndarray
    foot_names: tuple[str, ...]
    ground: np.ndarray
    hip_height: float
    body_length: float
    mass: float
    terrain: GroundSpec = LEVEL

    @property
    def name(self) -> str:
        """The name in `creature.toml`."""
        return self.settings.creature.name

    @property
    def stand_height(self) -> float:
        """Height of the standing trunk in m."""
        return float(self.stand_pos[2])

    @property
    def nv(self) -> int:
        """Degrees of freedom."""
        return int(self.model.nv)

    @property
    def start_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Horizontal unit vectors [3] forward and left of the nominal standing pose, in the world."""
        forward = (self.stand_rot @ self.forward) * [1, 1, 0]
        forward = forward / np.linalg.norm(forward)
        return forward.astype(np.float32), np.cross([0, 0, 1], forward).astype(np.float32)

    @property
    def symmetric(self) -> bool:
        """Whether poses are mirrored."""
        return self.settings.mirror.symmetric

    @property
    def digest(self) -> str:
        """Hash of the files that define the body; the README does not count."""
        text = "\0".join(f"{name}\0{self.files[name]}" for name in sorted(self.files))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def evolution_model(self) -> mujoco.MjModel:
        """The model in which evolution simulates, unless its settings say what ends an episode."""
        return self.model_where(self.settings.termination.touch)

    def on(self, ground: str) -> "Creature":
        """The creature on other ground, by its text.

        Raises:
          ValueError: says what is allowed.
        """
        return dataclasses.replace(self, terrain=parse_ground(ground))

    def spanned(self, degrees: float) -> "Creature":
        """The creature with every hinge's pose range so wide, about its middle; 0 changes nothing.

        A range that would reach beyond the joint's own is moved inwards, or cut where it is wider.
        """
        kinds = np.array([self.model.joint(name).type[0] for name in self.joint_names])
        half = np.minimum(np.radians(degrees), self.joint_high - self.joint_low) / 2
        middle = np.clip(
            (self.pose_low + self.pose_high) / 2, self.joint_low + half, self.joint_high - half
        )
        changes = (kinds == HINGE) & (degrees > 0)
        return dataclasses.replace(
            self,
            pose_low=np.where(changes, middle - half, self.pose_low),
            pose_high=np.where(changes, middle + half, self.pose_high),
        )

    def model_where(self, touch_ends: bool) -> mujoco.MjModel:
        """The model in which evolution simulates, depending on whether a touch ends an episode.

        If so it has contacts on feet and ground geoms only: the force of another never matters.
        """
        if not touch_ends:
            return self.model
        model = mujoco.MjModel.from_xml_string(self.files["creature.xml"])
        allowed = {*self.watched[: len(self.foot_of)], *self.ground, model.geom(FLOOR).id}
        silent = [g for g in range(model.ngeom) if g not in allowed]
        model.geom_contype[silent] = 0
        model.geom_conaffinity[silent] = 0
        return model
