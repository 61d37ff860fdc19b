"""What a simulation ends with: when a creature is down, what became of it, and its motion.

Letters: `S` simulations, `R` recorded ones (the first of the `S`), `T` control steps, `J` actuated
joints, `nq nv` as in MuJoCo.
"""

import dataclasses
from typing import Annotated

import numpy as np
import pydantic

from mjxgait.config.tables import STRICT, NonNegative, Positive
from mjxgait.creature import Creature


@dataclasses.dataclass(frozen=True)
class Fall:
    """When a creature is down; criterion 1.

    min_up: least product of the trunk's up axis with the world's. height: range of the trunk's
    height in standing heights.
    touch: whether a part that is neither foot nor ground contact is down when it touches the floor.
    tilt: most deg by which the trunk of a walk leans more than in the standing pose; who leans more
    is not down, but no walk.
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
    """Results of the simulations.

    fell: [S] s, infinite for those that stayed up. travel: [S, 3] m along the start's forward and
    left and upwards until the end or the fall.
    The next five have a value after each control step, NaN from the fall on, and are empty where the
    task does not need them (`path` and `aside` are always there):
    path, aside: [S, T] m of the trunk forward, and to the left. astray: [S, T] rad, the heading less the commanded one.
    middle: [S, T, 3] m in the world's axes, from where the trunk starts to the centre of all mass.
    low: [S, T] m, lowest solid part above the ground.
    clearance: [S] m, the least to the bar, `certify.bar.FAR` at most; infinite where there is none.
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

    @property
    def stayed_up(self) -> np.ndarray:
        """[S] whether never down."""
        return np.isinf(self.fell)

    def copy(self, leader: int, rows: np.ndarray) -> None:
        """Gives some simulations the results of the one that they have been identical to."""
        own = (self.fell, self.travel, self.path, self.aside, self.clearance, self.astray)
        for values in (*own, self.middle, self.low):
            values[rows] = values[leader]


def blank_outcome(
    count: int, steps: int, film: Trajectory, *, told: bool, middle: bool, low: bool
) -> Outcome:
    """Of S simulations that have not begun.

    told: whether they follow a commanded heading. middle, low: whether these are recorded.
    """
    return Outcome(
        fell=np.full(count, np.inf),
        travel=np.zeros((count, 3)),
        path=np.full((count, steps), np.nan),
        aside=np.full((count, steps), np.nan),
        clearance=np.full(count, np.inf),
        trajectory=film,
        astray=np.full((count, steps if told else 0), np.nan),
        middle=np.full((count, steps if middle else 0, 3), np.nan),
        low=np.full((count, steps if low else 0), np.nan),
    )
