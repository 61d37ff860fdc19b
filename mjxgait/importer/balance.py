"""Weakening of the balance feedback until the creature stands with it.

A loop that is too strong for the body shakes it off its feet.
"""

from collections.abc import Callable

import mujoco
import numpy as np

from mjxgait.creature.geometry import rotation
from mjxgait.importer.drive import Drive
from mjxgait.importer.notes import Notes
from mjxgait.importer.stand_test import Held, hold
from mjxgait.plugins import resolve_config

MAX_FEEDBACK = 0.5
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
        return weights * np.clip(gain * angle + rate_gain * rate, -MAX_FEEDBACK, MAX_FEEDBACK)

    return correct
