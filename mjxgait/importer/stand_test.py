"""Stand test in C MuJoCo: whether a body stays up on its feet under stable PD."""

import dataclasses
from collections.abc import Callable

import mujoco
import numpy as np

from mjxgait.creature import Creature

SECONDS = 2.0


@dataclasses.dataclass(frozen=True)
class Held:
    """Result of a stand test.

    up: least product of the trunk's upright axis with the world's. height: least, in standing
    heights. sag: rad. speed: rad/s, root mean square of the joints at the end. touched: a
    part that touched the floor and may not, or "".
    """

    up: float
    height: float
    sag: float
    speed: float
    touched: str

    @property
    def stands(self) -> bool:
        """True if the creature stayed up on its feet and came to rest."""
        return self.up > 0.85 and self.height > 0.75 and not self.touched and self.speed < 1.0

    @property
    def sinks(self) -> bool:
        """True if the creature stayed level, and came down."""
        return not self.stands and self.up > 0.85 and (self.height < 0.9 or bool(self.touched))

    @property
    def score(self) -> float:
        """Score that ranks stand tests, standing or not: higher is better."""
        return (
            2 * self.stands
            + self.up
            + self.height
            - self.sag
            - 0.2 * min(self.speed, 5.0)
            - bool(self.touched)
        )


def stand_test(creature: Creature) -> Held:
    """Run the stand test for two seconds."""
    feet = {
        creature.model.geom(int(g)).name
        for g in [*creature.feet.stepping, *creature.feet.ground_ids]
    }
    return hold(
        creature.model,
        creature.stand_qpos,
        creature.gains.kp,
        creature.gains.kd,
        creature.gains.torque_limit,
        feet,
    )


def hold(
    model: mujoco.MjModel,
    qpos: np.ndarray,
    kp: np.ndarray,
    kd: np.ndarray,
    limit: np.ndarray,
    feet: set[str],
    seconds: float = SECONDS,
    *,
    stand: np.ndarray | None = None,
    correct: Callable[[mujoco.MjData], np.ndarray] | None = None,
) -> Held:
    """Simulate standing for some seconds from `qpos` [nq].

    kp, kd, limit: [J]. feet: names of geoms that may touch.

    Args:
      stand: [J] target angles, those of qpos if None. correct: the change [J] of the target at a
        moment.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    up_axis, start = data.xmat[1].reshape(3, 3).T @ [0.0, 0.0, 1.0], data.xpos[1].copy()
    goal = qpos[7:] if stand is None else stand
    up, height, touched = 1.0, 1.0, ""
    known = feet | {"floor"}
    may_touch = np.array([model.geom(geom).name in known for geom in range(model.ngeom)])
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step1(model, data)
        target = goal + correct(data) if correct else goal
        torque = spd_torque(model, data, target, kp, kd)
        data.qfrc_applied[6:] = np.clip(torque, -limit, limit)
        mujoco.mj_step2(model, data)
        if not np.isfinite(data.qpos).all() or np.abs(data.qvel).max() > 1e3:
            return Held(-1.0, 0.0, 9.0, 9.0, touched)
        up = min(up, float((data.xmat[1].reshape(3, 3) @ up_axis)[2]))
        height = min(height, float(data.xpos[1][2] / max(start[2], 1e-9)))
        touched = touched or _touching(model, data, may_touch)
        if up < 0.3:
            break
    error = data.qpos[7:] - goal
    return Held(
        up,
        height,
        float(np.sqrt((error**2).mean())),
        float(np.sqrt((data.qvel[6:] ** 2).mean())),
        touched,
    )


def spd_torque(
    model: mujoco.MjModel, data: mujoco.MjData, target: np.ndarray, kp: np.ndarray, kd: np.ndarray
) -> np.ndarray:
    """Return the torque [J] in N·m of stable PD, without limits. target: [J] rad. kp, kd: [J]."""
    step, own = model.opt.timestep, np.arange(6, model.nv)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    spring = -kp * (data.qpos[7:] + step * data.qvel[6:] - target) - kd * data.qvel[6:]
    force = data.qfrc_passive - data.qfrc_bias
    force[6:] += spring
    mass[own, own] += step * kd
    acceleration = np.linalg.solve(mass, force)
    torque: np.ndarray = spring - step * kd * acceleration[6:]
    return torque


def _touching(model: mujoco.MjModel, data: mujoco.MjData, may_touch: np.ndarray) -> str:
    """Name of a part that touches something and may not, or "". may_touch: [G] of geoms."""
    touching = data.contact.geom.ravel()
    wrong = touching[~may_touch[touching]]
    return str(model.body(int(model.geom_bodyid[wrong[0]])).name) if len(wrong) else ""
