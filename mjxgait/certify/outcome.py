"""What a simulation ends with: when a creature is down, what became of it, and its motion.

Letters: `S` simulations, `R` recorded ones (the first of the `S`), `T` control steps, `J` actuated
joints, `nq nv` as in MuJoCo.
"""

import dataclasses
from typing import Annotated

import numpy as np
import pydantic

from mjxgait.creature import Creature
from mjxgait.settings.tables import STRICT, NonNegative, Positive


@dataclasses.dataclass(frozen=True)
class Fall:
    """When a creature is down; criterion 1.

    min_up: least product of the trunk's up axis with the world's. height: range of the trunk's
    height in standing heights.
    touch: whether a part that is neither foot nor ground contact is down when it touches the floor.
    """

    __pydantic_config__ = STRICT
    min_up: Annotated[float, pydantic.Field(ge=-1, le=1)] = 0.5
    height: tuple[NonNegative, Positive] = (0.5, 1.5)
    touch: bool = True

    def __post_init__(self) -> None:
        if not self.height[0] < 1 < self.height[1]:
            raise ValueError(
                f"height = {list(self.height)}: must be a range around 1, the standing height"
            )


@dataclasses.dataclass(frozen=True, eq=False)
class Trajectory:
    """Everything needed to look at the recorded simulations again; frames are control steps, before
    their torque acts.

    time_step: s between frames. qpos: [R, T, nq]. qvel: [R, T, nv]. torque: [R, T, J] N·m.
    target: [R, T, J] rad that the joints were pulled to; NaN under a controller that sends torques.
    phase: [R, T] where the controller was in its own cycle, in [0, 1); NaN for one without. A simulation that blew up is NaN from there on.
    """

    time_step: float
    qpos: np.ndarray
    qvel: np.ndarray
    torque: np.ndarray
    target: np.ndarray
    phase: np.ndarray


def blank_film(creature: Creature, time_step: float, rows: int, steps: int) -> Trajectory:
    """What nobody has recorded yet: NaN."""

    def blank(*width: int) -> np.ndarray:
        return np.full((rows, steps, *width), np.nan)

    model, joints = creature.model, len(creature.joints.names)
    return Trajectory(
        time_step,
        qpos=blank(model.nq),
        qvel=blank(model.nv),
        torque=blank(joints),
        target=blank(joints),
        phase=blank(),
    )


@dataclasses.dataclass(frozen=True, eq=False)
class Outcome:
    """What became of the simulations.

    fell: [S] s, infinite for those that stayed up. travel: [S, 3] m along the start's forward and
    left and upwards until the end or the fall.
    path: [S, T] m forward after each control step; NaN from the fall on, or where nobody looked.
    astray: [S, T] rad, the heading less the one it was told; NaN from the fall on; empty where
    nobody was told one.
    height: [S] m, the greatest of the lowest solid part above the ground, once the warm-up is over;
    0 where nobody watches it.
    aside: [S, T] m to the left after each control step, as `path`.
    clearance: [S] m, the least to the bar, `certify.bar.FAR` at most; infinite where there is none.
    """

    fell: np.ndarray
    travel: np.ndarray
    path: np.ndarray
    clearance: np.ndarray
    trajectory: Trajectory
    astray: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))
    height: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0))
    aside: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def stayed_up(self) -> np.ndarray:
        """[S] whether never down."""
        return np.isinf(self.fell)

    def copy(self, leader: int, rows: np.ndarray) -> None:
        """Says of some simulations what it says of one that they have been alike to."""
        paths = (self.path, self.aside, self.astray)
        for values in (self.fell, self.travel, *paths, self.clearance, self.height):
            values[rows] = values[leader]


def blank_outcome(count: int, steps: int, told: bool, film: Trajectory) -> Outcome:
    """Of S simulations that have not begun. told: whether they are told a heading."""
    return Outcome(
        fell=np.full(count, np.inf),
        travel=np.zeros((count, 3)),
        path=np.full((count, steps), np.nan),
        aside=np.full((count, steps), np.nan),
        clearance=np.full(count, np.inf),
        trajectory=film,
        astray=np.full((count, steps if told else 0), np.nan),
        height=np.zeros(count),
    )
