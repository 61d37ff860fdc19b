"""Stand test in C MuJoCo, and weakening of the balance feedback until the creature stands with it.

A loop that is too strong for the body shakes it off its feet.
"""

import dataclasses
from collections.abc import Callable

import mujoco
import numpy as np

from mjxgait.creature.geometry import rotation
from mjxgait.importer.drive import Drive
from mjxgait.importer.notes import Notes
from mjxgait.plugins import resolve_config

SECONDS = 2.0


@dataclasses.dataclass(frozen=True)
class Held:
    """Result of a stand test.

    up: least product of the trunk's upright axis with the world's. height: least, in standing
    heights. moved: m. sag: rad. speed: rad/s, root mean square of the joints at the end. touched: a
    part that touched the floor and may not, or "".
    """

    up: float
    height: float
    moved: float
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
    step, goal, mass = (
        model.opt.timestep,
        qpos[7:] if stand is None else stand,
        np.zeros((model.nv, model.nv)),
    )
    up, height, touched = 1.0, 1.0, ""
    known = feet | {"floor"}
    may_touch = np.array([model.geom(geom).name in known for geom in range(model.ngeom)])
    own = np.arange(6, model.nv)
    for _ in range(round(seconds / step)):
        mujoco.mj_step1(model, data)
        mujoco.mj_fullM(model, data, mass)
        target = goal + correct(data) if correct else goal
        spring = -kp * (data.qpos[7:] + step * data.qvel[6:] - target) - kd * data.qvel[6:]
        force = data.qfrc_passive - data.qfrc_bias
        force[6:] += spring
        mass[own, own] += step * kd
        acceleration = np.linalg.solve(mass, force)
        torque = spring - step * kd * acceleration[6:]
        data.qfrc_applied[6:] = np.clip(torque, -limit, limit)
        mujoco.mj_step2(model, data)
        if not np.isfinite(data.qpos).all() or np.abs(data.qvel).max() > 1e3:
            return Held(-1.0, 0.0, 0.0, 9.0, 9.0, touched)
        up = min(up, float((data.xmat[1].reshape(3, 3) @ up_axis)[2]))
        height = min(height, float(data.xpos[1][2] / max(start[2], 1e-9)))
        touched = touched or _touching(model, data, may_touch)
        if up < 0.3:
            break
    error = data.qpos[7:] - goal
    moved = float(np.linalg.norm(data.xpos[1][:2] - start[:2]))
    return Held(
        up,
        height,
        moved,
        float(np.sqrt((error**2).mean())),
        float(np.sqrt((data.qvel[6:] ** 2).mean())),
        touched,
    )


def _touching(model: mujoco.MjModel, data: mujoco.MjData, may_touch: np.ndarray) -> str:
    """Name of a part that touches something and may not, or "". may_touch: [G] of geoms."""
    touching = data.contact.geom.ravel()
    wrong = touching[~may_touch[touching]]
    return str(model.body(int(model.geom_bodyid[wrong[0]])).name) if len(wrong) else ""


MOST = 0.5
"""rad, where the controller clips the feedback (docs/reference/controller.md)."""
SHARES = (1.0, 0.5, 0.25, 0.12, 0.06, 0.0)
"""Shares of the full weight, tried in this order."""
NUDGE = 0.05
"""rad, initial offset of the joints from the stance, as in perturbed trials.

In perfect rest a loop would tremble late or never.
"""
CALM = 0.3
"""rad/s, root mean square of the joints at the end; more is a tremor."""


def steady_balance(
    drive: Drive,
    names: list[str],
    model: mujoco.MjModel,
    qpos: np.ndarray,
    feet: set[str],
    notes: Notes,
) -> None:
    """Scale the pitch and roll weights of the drive.

    Args:
      names: [J] of the joints. model, qpos: [nq] the creature facing +x in its standing pose. feet:
        names of geoms that may touch.
    """
    tuning = resolve_config({}, "the imported creature").controller.tuning
    strongest = ((tuning.roll[1], tuning.roll_rate[1]), (tuning.pitch[1], tuning.pitch_rate[1]))
    start = qpos.copy()
    start[7:] += np.random.default_rng(0).uniform(-NUDGE, NUDGE, len(names))
    for axis, table in enumerate((drive.roll, drive.pitch)):
        if not table:
            continue
        full = np.array([table.get(name, 0.0) for name in names])
        tried: dict[float, Held] = {}
        for share in SHARES:
            correct = feedback(share * full, axis, qpos, *strongest[axis])
            tried[share] = hold(
                model,
                start,
                drive.kp,
                drive.kd,
                drive.torque,
                feet,
                stand=qpos[7:],
                correct=correct,
            )
            if tried[share].stands and tried[share].speed < CALM:
                break
        else:  # a body that always falls, such as one on two points: the best score
            share = max(tried, key=lambda s: tried[s].score)
        weights = {name: round(share * weight, 3) for name, weight in table.items() if share}
        table.clear()
        table.update(weights)
        if share < 1:
            what = ("balance.roll", "balance.pitch")[axis]
            notes.guess(
                what,
                f"{share:g} of full",
                "medium",
                "with more it shakes itself off its feet at the strongest feedback",
            )


def feedback(
    weights: np.ndarray, axis: int, stand: np.ndarray, gain: float, rate_gain: float
) -> Callable[[mujoco.MjData], np.ndarray]:
    """Return the controller's correction [J] of the target.

    Args:
      weights: [J]. axis: 0 for roll, 1 for pitch. stand: [nq] the standing pose, facing +x.
      gain, rate_gain: of the trunk's angle, 1, and of its rate, s.
    """
    level = rotation(stand[3:7])

    def correct(data: mujoco.MjData) -> np.ndarray:
        turned = data.xmat[1].reshape(3, 3)
        axes = turned @ level.T  # columns: the stance's forward, left and up in the current world
        angle = np.arcsin(np.clip(axes[2, 1] if axis == 0 else -axes[2, 0], -1, 1))
        rate = (turned @ data.qvel[3:6]) @ axes[:, axis]
        return weights * np.clip(gain * angle + rate_gain * rate, -MOST, MOST)

    return correct
