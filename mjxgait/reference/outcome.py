"""Results of simulations: conditions of a fall, metrics and recorded motion.

Letters: `S` simulations, `R` recorded ones (the first of the `S`), `T` control steps, `J` actuated
joints, `nq nv` as in MuJoCo.
"""

import dataclasses
from collections.abc import Callable, Collection
from typing import Annotated

import numpy as np
import pydantic

from mjxgait.config.tables import STRICT, NonNegative, Positive
from mjxgait.creature import Creature


@dataclasses.dataclass(frozen=True)
class Fall:
    """Conditions of a fall; criterion 1.

    min_up: least dot product of the trunk's up axis and the world's. height: range of the trunk's
    height in standing heights.
    touch: whether floor contact of a part other than feet and permitted geoms is a fall.
    tilt: largest tilt in deg of a walk's trunk beyond the standing pose; more is not a fall, but no
    walk either.
    """

    __pydantic_config__ = STRICT
    min_up: Annotated[float, pydantic.Field(ge=-1, le=1)] = 0.5
    tilt: Positive = 35.0
    height: tuple[NonNegative, Positive] = (0.5, 1.5)
    touch: bool = True

    def __post_init__(self) -> None:
        if not self.height[0] < 1 < self.height[1]:
            raise ValueError(
                f"height = {list(self.height)}: must be a range around 1, the standing height"
            )


@dataclasses.dataclass(frozen=True, eq=False)
class Trajectory:
    """Recorded simulations, complete enough to replay.

    A frame is a control step before its torque acts. After a simulation blew up its frames are NaN.

    time_step: s between frames. qpos: [R, T, nq]. qvel: [R, T, nv]. torque: [R, T, J] N·m.
    target: [R, T, J] rad, target angles; NaN under a controller that sends torques.
    phase: [R, T] of the controller's own cycle, in [0, 1); NaN without a cycle.
    """

    time_step: float
    qpos: np.ndarray
    qvel: np.ndarray
    torque: np.ndarray
    target: np.ndarray
    phase: np.ndarray

    def taken(self, frames: slice | np.ndarray) -> "Trajectory":
        """Return some of the frames."""
        arrays = (self.qpos, self.qvel, self.torque, self.target, self.phase)
        return Trajectory(self.time_step, *(array[:, frames] for array in arrays))


def blank_film(creature: Creature, time_step: float, rows: int, steps: int) -> Trajectory:
    """Return an empty recording, filled with NaN."""

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
    """Results of the simulations.

    fell: [S] s, infinite without a fall. travel: [S, 3] m forward, left and up from the start until
    the end or the fall.
    clearance: [S] m, least distance to the bar, `bar.FAR` at most; infinite without a bar.
    The next six have a value after each control step and NaN from the fall on. They are empty if
    the task does not need them (`path` and `aside` are never empty):
    path, aside: [S, T] m of the trunk forward, and to the left.
    astray: [S, T] rad, heading less the commanded one.
    middle: [S, T, 3] m in world axes, from the trunk's start to the centre of mass.
    low: [S, T] m, lowest solid part above the ground.
    gaps: [S, T, 2] m of body and opponent from the cube of a contest.
    """

    fell: np.ndarray
    travel: np.ndarray
    path: np.ndarray
    clearance: np.ndarray
    trajectory: Trajectory
    astray: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))
    middle: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0, 3)))
    low: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))
    aside: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))
    gaps: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0, 2)))

    @property
    def stayed_up(self) -> np.ndarray:
        """Whether simulations [S] never fell."""
        return np.isinf(self.fell)

    def copy(self, leader: int, rows: np.ndarray) -> None:
        """Copy the results of one simulation to others that have been identical to it."""
        own = (self.fell, self.travel, self.path, self.aside, self.clearance, self.astray)
        for values in (*own, self.middle, self.low, self.gaps):
            values[rows] = values[leader]


def blank_outcome(
    count: int, steps: int, film: Trajectory, *, commanded: bool, kept: Collection[str]
) -> Outcome:
    """Return the results of S simulations before their first step.

    commanded: whether they follow a commanded heading. kept: which of `middle`, `low` and `gaps`
    are recorded.
    """

    def blank(name: str, *width: int) -> np.ndarray:
        return np.full((count, steps if name in kept else 0, *width), np.nan)

    return Outcome(
        fell=np.full(count, np.inf),
        travel=np.zeros((count, 3)),
        path=np.full((count, steps), np.nan),
        aside=np.full((count, steps), np.nan),
        clearance=np.full(count, np.inf),
        trajectory=film,
        astray=np.full((count, steps if commanded else 0), np.nan),
        middle=blank("middle", 3),
        low=blank("low"),
        gaps=blank("gaps", 2),
    )


class Watch:
    """Lost simulations of one call of `simulate`.

    lost: [S] whether one can no longer succeed. over: whether the result is decided.
    """

    def __init__(self, count: int, hopeless: Callable[[np.ndarray], bool]) -> None:
        """hopeless: whether the losses [S] decide the result; more losses never improve it."""
        self.lost, self.over = np.zeros(count, bool), False
        self._hopeless = hopeless

    def tell(self, lost: np.ndarray) -> bool:
        """Record the lost simulations [S]; return whether all may end."""
        self.lost |= lost
        self.over = self.over or self._hopeless(self.lost)
        return self.over
