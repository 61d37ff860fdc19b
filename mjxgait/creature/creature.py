"""The static facts of a body that the other packages need."""

import copy
import dataclasses
import hashlib
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature.anatomy import Corrections, Feet, Frame, Gains, Joints, Mirror
from mjxgait.creature.ground.spec import LEVEL, GroundSpec, Place, parse_ground
from mjxgait.creature.settings import CreatureSettings

HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
FLOOR = "floor"
REST = "rest"
"""Keyframe of the rest pose of an animator's skeleton, where it is not the standing pose."""
ORIGIN = "character.toml"
"""File of a creature folder that says where the character's own file was (`importer/origin.py`)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Creature:
    """The static facts of a body.

    files: name and text of each file, as read. model: the body as its file describes it.
    trunk: id of its body. stand_qpos: [nq], the standing pose. terrain: the ground; it is not in
    `model`, where the floor is a plane.
    """

    settings: CreatureSettings
    files: Mapping[str, str]
    model: mujoco.MjModel
    trunk: int
    stand_qpos: np.ndarray
    frame: Frame
    joints: Joints
    gains: Gains
    mirror: Mirror
    corrections: Corrections
    feet: Feet
    terrain: GroundSpec = LEVEL

    @property
    def name(self) -> str:
        """The name in `creature.toml`."""
        return self.settings.creature.name

    @property
    def title(self) -> str:
        """Return the name in words."""
        return self.name.replace("_", " ")

    @property
    def nv(self) -> int:
        """Degrees of freedom."""
        return int(self.model.nv)

    @property
    def root_qpos(self) -> int:
        """First place of the trunk's joints in qpos; a free trunk has x, y, z and a quaternion."""
        return int(self.model.jnt_qposadr[self.model.body_jntadr[self.trunk]])

    @property
    def root_dof(self) -> int:
        """First place of the trunk's joints in qvel."""
        return int(self.model.jnt_dofadr[self.model.body_jntadr[self.trunk]])

    @property
    def gravity(self) -> float:
        """Gravity in m/s², downwards."""
        return float(-self.model.opt.gravity[2])

    @property
    def unit_speed(self) -> float:
        """Unit of pushes and of speeds of body parts: √(g · hip height), m/s."""
        return float(np.sqrt(self.gravity * self.frame.hip_height))

    @property
    def digest(self) -> str:
        """Hash of the files that define the body; the README and `character.toml` do not count."""
        names = sorted(set(self.files) - {ORIGIN})
        text = "\0".join(f"{name}\0{self.files[name]}" for name in names)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def rest_qpos(self) -> np.ndarray:
        """Rest pose [nq] of the bones in animation files."""
        return np.array(self.model.key(REST).qpos) if self.is_rig else self.stand_qpos

    @property
    def rest_model(self) -> mujoco.MjModel:
        """The model with arms as the file's skeleton rests: spread, where the body's arms hang."""
        model = copy.copy(self.model)
        for part, quat in self.settings.rig.turned.items():
            hangs, back = model.body(part).quat, np.zeros(4)
            mujoco.mju_negQuat(back, quat)
            mujoco.mju_mulQuat(hangs, hangs.copy(), back)
        return model

    @property
    def is_rig(self) -> bool:
        """True if the creature was imported from a skeleton, which has its own rest pose."""
        return mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_KEY, REST) >= 0

    @property
    def evolution_model(self) -> mujoco.MjModel:
        """The model that evolution simulates if the run's settings do not set termination."""
        return self.model_where(self.settings.termination.touch)

    def on(self, ground: str) -> "Creature":
        """Return the creature on other ground, given as text.

        Raises:
          ValueError: says what is allowed.
        """
        return dataclasses.replace(self, terrain=parse_ground(ground))

    def spanned(self, degrees: float) -> "Creature":
        """Return the creature with pose ranges of this width for every hinge; 0 changes nothing.

        Each range keeps its middle from creature.toml. A range that would reach beyond the joint's
        own range is moved inwards, and cut where it is wider.
        """
        if not degrees:
            return self
        joints = self.joints
        kinds = np.array([self.model.joint(name).type[0] for name in joints.names])
        changes = kinds == HINGE
        half = np.minimum(np.radians(degrees), joints.high - joints.low) / 2
        middle = (joints.pose_low + joints.pose_high) / 2
        middle = np.clip(middle, joints.low + half, joints.high - half)
        spanned = dataclasses.replace(
            joints,
            pose_low=np.where(changes, middle - half, joints.pose_low),
            pose_high=np.where(changes, middle + half, joints.pose_high),
        )
        return dataclasses.replace(self, joints=spanned)

    def model_where(self, touch_ends: bool) -> mujoco.MjModel:
        """The model that evolution simulates, depending on whether a touch ends an episode.

        If so, only feet and ground geoms have contacts: the force on other geoms never matters.
        """
        if not touch_ends:
            return self.model
        model = mujoco.MjModel.from_xml_string(self.files["creature.xml"])
        allowed = {*self.feet.stepping, *self.feet.ground_ids, model.geom(FLOOR).id}
        silent = [g for g in range(model.ngeom) if g not in allowed]
        model.geom_contype[silent] = 0
        model.geom_conaffinity[silent] = 0
        return model


def start_place(creature: Creature) -> Place:
    """Start place of the creature on its ground."""
    return Place(
        creature.frame.stand_pos,
        creature.frame.start_axes[0],
        creature.frame.hip_height,
        creature.frame.body_length,
    )


def horizontal_freedoms(creature: Creature) -> np.ndarray:
    """Generalised velocities [2, nv] of the trunk moving at 1 m/s along the world's x and y.

    Zero where the root cannot move so.
    """
    model = creature.model
    moves = np.zeros((2, model.nv))
    for joint in range(model.njnt):
        if model.jnt_bodyid[joint] != creature.trunk:
            continue
        dof = model.jnt_dofadr[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            moves[:, dof : dof + 2] = np.eye(2)
        elif model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            moves[:, dof] = model.jnt_axis[joint][:2]
    return moves.astype(np.float32)


def vertical_freedom(model: mujoco.MjModel) -> np.ndarray:
    """Change of the positions [nq] that lifts every root by 1 m; zero if a root cannot rise."""
    rises = np.zeros(model.nq)
    for joint in range(model.njnt):
        place = model.jnt_qposadr[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            rises[place + 2] = 1.0
        elif model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            at_root = model.body_parentid[model.jnt_bodyid[joint]] == 0
            rises[place] = (
                at_root * (abs(model.jnt_axis[joint][2]) > 0.99) * model.jnt_axis[joint][2]
            )
    return rises
