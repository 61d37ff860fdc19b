"""The parts that a creature's facts fall into: what controllers, tasks and senses know of a body.

Letters: `J` actuated joints in the model's order, `F` geoms of feet, `G` watched geoms, the feet's
first. Numbers are arrays that a compiled program has as constants or as inputs (`mjxgait/creature/body.py`);
what shapes a program is a tuple.
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
    """The trunk's axes, where it stands, and the creature's yardsticks.

    forward, left, up: [3] unit vectors in the trunk's frame. stand_pos: [3] m, stand_rot: [3, 3],
    of the standing trunk. start_axes: horizontal unit vectors [3] forward and left of it, in the
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
    """The actuated joints. stand: [J] rad, standing. pose_low, pose_high: [J] rad, of targets.

    low, high: [J] rad, of the joints themselves. qpos, dofs: [J] their places in `qpos` and `qvel`.
    """

    stand: np.ndarray
    pose_low: np.ndarray
    pose_high: np.ndarray
    low: np.ndarray
    high: np.ndarray
    names: tuple[str, ...] = _static()
    qpos: tuple[int, ...] = _static()
    dofs: tuple[int, ...] = _static()

    @functools.cached_property
    def qpos_adr(self) -> np.ndarray:
        """Places [J] in `qpos`, to index with."""
        return np.array(self.qpos, dtype=int)

    @functools.cached_property
    def dof_adr(self) -> np.ndarray:
        """Places [J] in `qvel`, to index with."""
        return np.array(self.dofs, dtype=int)


@dataclasses.dataclass(frozen=True, eq=False)
class Gains:
    """What drives the joints. kp, kd, torque_limit: [J] N·m/rad, N·m·s/rad, N·m."""

    kp: np.ndarray
    kd: np.ndarray
    torque_limit: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Mirror:
    """Which joint is whose mirror image. sign: [J] of the angle there. partners: [J].

    symmetric: whether poses are mirrored.
    """

    sign: np.ndarray
    partners: tuple[int, ...] = _static()
    symmetric: bool = _static()

    @functools.cached_property
    def partner(self) -> np.ndarray:
        """Joint [J] on the other side, to index with."""
        return np.array(self.partners, dtype=int)

    def image(self, angles: np.ndarray) -> np.ndarray:
        """Angles [..., J] of the mirrored creature."""
        return self.sign * angles[..., self.partner]


@dataclasses.dataclass(frozen=True, eq=False)
class Stepping:
    """Weights [J], rad per hip height, with which joints take their foot ahead, and to the left.

    turn: [J] rad per rad by which they turn it to the left. legs: [J] the foot that each joint moves;
    of joints without a weight any.
    """

    ahead: np.ndarray
    aside: np.ndarray
    turn: np.ndarray
    legs: tuple[int, ...] = _static()


@dataclasses.dataclass(frozen=True, eq=False)
class Corrections:
    """Weights [J] with which joints steer and balance (docs/controller.md).

    stepping: with which they step under a fall; None where none does.
    """

    steer_bend: np.ndarray
    steer_stride: np.ndarray
    balance_pitch: np.ndarray
    balance_roll: np.ndarray
    stepping: Stepping | None = None

    @property
    def steps(self) -> bool:
        """Whether any joint steps under a fall."""
        return self.stepping is not None


@dataclasses.dataclass(frozen=True, eq=False)
class Feet:
    """What meets the ground.

    names: one per foot. foot_of: [F] which foot each geom of a foot belongs to. watched: [G] ids of
    geoms whose height is sensed. ground: ids of the other geoms that may touch the floor.
    stations: of each foot its rank from the front on its side, and whether that is the left.
    places: [N, 2] m ahead of the trunk and left of it along its nose, where the N feet stand.
    """

    names: tuple[str, ...] = _static()
    geoms: tuple[int, ...] = _static()
    seen: tuple[int, ...] = _static()
    others: tuple[int, ...] = _static()
    stations: tuple[tuple[int, bool], ...] = dataclasses.field(default=(), metadata=STATIC)
    places: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def stepping(self) -> tuple[int, ...]:
        """Ids [F] of the feet's geoms."""
        return self.seen[: len(self.geoms)]

    @functools.cached_property
    def foot_of(self) -> np.ndarray:
        """Foot [F] of each geom of a foot."""
        return np.array(self.geoms, dtype=int)

    @functools.cached_property
    def watched(self) -> np.ndarray:
        """Ids [G] of the geoms whose height is sensed."""
        return np.array(self.seen, dtype=int)

    @functools.cached_property
    def ground(self) -> np.ndarray:
        """Ids of the other geoms that may touch the floor."""
        return np.array(self.others, dtype=int)
