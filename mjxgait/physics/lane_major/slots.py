"""Slots of a topology: bodies, joints, contacts, limits, watched geoms; no numbers."""

import dataclasses

import mujoco

FREE, BALL, SLIDE, HINGE = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("FREE", "BALL", "SLIDE", "HINGE")
)
ANY = -1
"""Any type of watched shape: none of its numbers is assumed to be zero."""
FREEDOMS = {FREE: 6, BALL: 3, SLIDE: 1, HINGE: 1}


@dataclasses.dataclass(frozen=True)
class JointSlot:
    """Joint. kind: FREE, BALL, SLIDE or HINGE. qpos, dof: addresses."""

    kind: int
    qpos: int
    dof: int


@dataclasses.dataclass(frozen=True)
class BodySlot:
    """Body. parent: index among the bodies, -1 for the world. joints: from the first to move it."""

    parent: int
    joints: tuple[JointSlot, ...]


@dataclasses.dataclass(frozen=True)
class ContactSlot:
    """Sphere of a body that may touch the floor; capsule: whether it is an end of one."""

    body: int
    capsule: bool


@dataclasses.dataclass(frozen=True)
class LimitSlot:
    """Hinge or slide with a limited range; addresses."""

    dof: int
    qpos: int


@dataclasses.dataclass(frozen=True)
class WatchedSlot:
    """Sensed geom. body: -1 for the world's. shape: MuJoCo's type, or `ANY`."""

    body: int
    shape: int


@dataclasses.dataclass(frozen=True)
class Ends:
    """Places of a contact's numbers: the two geoms; side: 1, -1 of a capsule, 0 of a sphere."""

    floor: int
    geom: int
    side: int
