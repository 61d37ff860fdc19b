"""Groups of a creature's facts, as controllers, tasks and observations use them.

Letters: `J` actuated joints in the model's order, `F` geoms of feet, `G` watched geoms, the feet's
first. Arrays are constants or inputs of a compiled program (`mjxgait/creature/body.py`); tuples
determine its shape.
"""

import dataclasses
import functools
from typing import Any

import numpy as np

STATIC = {"static": True}


def _static() -> Any:
    return dataclasses.field(metadata=STATIC)


@dataclasses.dataclass(frozen=True, eq=False)
class Frame:
    """The trunk's axes and standing place, and the creature's characteristic sizes.

    forward, left, up: [3] unit vectors in the trunk's frame. stand_pos: [3] m, stand_rot: [3, 3],
    of the standing trunk. start_axes: its horizontal unit vectors [3] forward and left, in the
    world. hip_height: m, mean leg length. body_length: m. mass: kg.
    """

    forward: np.ndarray
    left: np.ndarray
    up: np.ndarray
    stand_pos: np.ndarray
    stand_rot: np.ndarray
    start_axes: tuple[np.ndarray, np.ndarray]
    hip_height: float
    body_length: float
    mass: float

    @property
    def stand_height(self) -> Any:
        """Height [] of the standing trunk in m."""
        return self.stand_pos[2]


@dataclasses.dataclass(frozen=True, eq=False)
class Joints:
    """The actuated joints.

    stand: [J] rad, standing. pose_low, pose_high: [J] rad, of targets. low, high: [J] rad, of the
    joints themselves. qpos, dofs: [J] their places in `qpos` and `qvel`. swings: an arm's joint,
    the leg's joint that it swings with, and the share of that one's angle from standing.
    """

    stand: np.ndarray
    pose_low: np.ndarray
    pose_high: np.ndarray
    low: np.ndarray
    high: np.ndarray
    names: tuple[str, ...] = _static()
    qpos: tuple[int, ...] = _static()
    dofs: tuple[int, ...] = _static()
    swings: tuple[tuple[int, int, float], ...] = dataclasses.field(default=(), metadata=STATIC)

    @functools.cached_property
    def qpos_adr(self) -> np.ndarray:
        """Places [J] in `qpos` as an index array."""
        return np.array(self.qpos, dtype=int)

    @functools.cached_property
    def dof_adr(self) -> np.ndarray:
        """Places [J] in `qvel` as an index array."""
        return np.array(self.dofs, dtype=int)


@dataclasses.dataclass(frozen=True, eq=False)
class Gains:
    """Gains of the joints. kp, kd, torque_limit: [J] N·m/rad, N·m·s/rad, N·m."""

    kp: np.ndarray
    kd: np.ndarray
    torque_limit: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Mirror:
    """Mirror image of each joint.

    partners: [J] the joint on the other side. sign: [J] of the angle there. symmetric: whether
    poses are mirrored.
    """

    sign: np.ndarray
    partners: tuple[int, ...] = _static()
    symmetric: bool = _static()

    @functools.cached_property
    def partner(self) -> np.ndarray:
        """Joint [J] on the other side as an index array."""
        return np.array(self.partners, dtype=int)

    def image(self, angles: np.ndarray) -> np.ndarray:
        """Angles [..., J] of the mirrored creature."""
        return self.sign * angles[..., self.partner]


@dataclasses.dataclass(frozen=True, eq=False)
class Stepping:
    """Weights of the joints for steps under a fall.

    ahead, aside: [J] rad per hip height, to move the foot ahead and to the left. turn: [J] rad per
    rad, to turn it to the left. legs: [J] the foot that each joint moves; arbitrary for joints
    without a weight.
    """

    ahead: np.ndarray
    aside: np.ndarray
    turn: np.ndarray
    legs: tuple[int, ...] = _static()


@dataclasses.dataclass(frozen=True, eq=False)
class Corrections:
    """Weights [J] with which joints steer and balance (docs/reference/controller.md).

    stepping: weights for steps under a fall; None where no joint steps.
    """

    steer_bend: np.ndarray
    steer_stride: np.ndarray
    balance_pitch: np.ndarray
    balance_roll: np.ndarray
    stepping: Stepping | None = None

    @property
    def steps(self) -> bool:
        """True if any joint steps under a fall."""
        return self.stepping is not None


@dataclasses.dataclass(frozen=True, eq=False)
class Feet:
    """Feet, and other geoms that may touch the ground.

    names: [N] of the feet. foot_of_geoms: [F] foot of each geom of a foot. watched_ids: [G] ids of
    the geoms with an observed height, those of the feet first. ground_ids: of the other geoms that
    may touch the floor. The same as arrays: `foot_of`, `watched`, `ground`. stations: each foot's
    rank from the front on its side, and whether that side is the left. places: [N, 2] m ahead of
    the trunk and left of it along its nose, where the feet stand.
    """

    names: tuple[str, ...] = _static()
    foot_of_geoms: tuple[int, ...] = _static()
    watched_ids: tuple[int, ...] = _static()
    ground_ids: tuple[int, ...] = _static()
    stations: tuple[tuple[int, bool], ...] = dataclasses.field(default=(), metadata=STATIC)
    places: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def stepping(self) -> tuple[int, ...]:
        """Ids [F] of the feet's geoms."""
        return self.watched_ids[: len(self.foot_of_geoms)]

    def geoms_of(self, foot: int) -> list[int]:
        """Return the ids of one foot's geoms."""
        pairs = zip(self.stepping, self.foot_of_geoms, strict=True)
        return [geom for geom, own in pairs if own == foot]

    @functools.cached_property
    def foot_of(self) -> np.ndarray:
        """Foot [F] of each geom of a foot."""
        return np.array(self.foot_of_geoms, dtype=int)

    @functools.cached_property
    def watched(self) -> np.ndarray:
        """Ids [G] of the geoms with an observed height."""
        return np.array(self.watched_ids, dtype=int)

    @functools.cached_property
    def ground(self) -> np.ndarray:
        """Ids of the other geoms that may touch the floor."""
        return np.array(self.ground_ids, dtype=int)
