"""Reference controller for key poses, written from docs/reference/controller.md alone.

Letters: `S` simulations, `J` actuated joints, `K` key poses, `C` poses in the cycle.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from mjxgait.champion import Champion
from mjxgait.controllers.key_poses.config import gene_names
from mjxgait.creature import Creature
from mjxgait.creature.anatomy import Stepping
from mjxgait.reference.controllers import Command, Memory

READS = ("joint_pos", "heading", "aside", "pitch", "roll", "pitch_rate", "roll_rate")
STEP_READS = ("foot_height", "foot_place", "nose_vel")


class PoseReference:
    """Reference controller of a pose cycle. Memory: `position` [S] in the cycle, `steps` [S]."""

    command: ClassVar[Command] = "pose"
    every: ClassVar[int] = 1

    def __init__(self, creature: Creature, champion: Champion, step: float) -> None:
        self.creature, self.settings, self.step = creature, champion.settings, step
        names = gene_names(creature.corrections.steps)
        self.tuning = dict(zip(names, map(float, champion.genome["tuning"]), strict=True))
        self.reads = READS + (STEP_READS if creature.corrections.steps else ())
        poses = np.asarray(champion.genome["key_poses"], float)
        self.cycle = pose_cycle(poses, creature) if champion.settings.mirror else poses
        self.length = len(self.cycle) * champion.settings.interpolation

    def init(self, count: int) -> Memory:
        """See `ReferenceController`."""
        return {name: np.zeros(count, dtype=int) for name in ("position", "steps")}

    def phase(self, memory: Memory) -> np.ndarray:
        """See `ReferenceController`."""
        return memory["position"] / self.length

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `ReferenceController`."""
        target = self.target(memory["position"], senses, memory["steps"])
        steps = memory["steps"] + 1
        position = self.advance(memory["position"], target, senses["joint_pos"], steps)
        return target, {"position": position, "steps": steps}

    def planned(self, position: np.ndarray) -> np.ndarray:
        """Return the uncorrected target [S, J] in rad at cycle positions [S]."""
        a, step = np.divmod(position, self.settings.interpolation)
        f = (step / self.settings.interpolation)[:, None]
        return (1 - f) * self.cycle[a] + f * self.cycle[(a + 1) % len(self.cycle)]

    def target(
        self, position: np.ndarray, senses: Mapping[str, np.ndarray], steps: np.ndarray
    ) -> np.ndarray:
        """Return the target [S, J] in rad at cycle positions [S], after `steps` [S]."""
        return self.corrected(self.planned(position), senses, steps)

    def corrected(
        self, planned: np.ndarray, senses: Mapping[str, np.ndarray], steps: np.ndarray
    ) -> np.ndarray:
        """Return a planned target [S, J] in rad with corrections, within the joint ranges.

        The corrections are the start, steering and balance. steps: [S] taken before.
        """
        creature = self.creature
        if creature.corrections.steps:
            planned = self._begun(planned, steps)
        steer, pitch, roll = (part[:, None] for part in self.corrections(senses))
        steer = steer * self.settings.steering
        stretched = creature.joints.stand + (planned - creature.joints.stand) * (
            1 + steer * creature.corrections.steer_stride
        )
        target = (
            stretched
            + steer * creature.corrections.steer_bend
            + pitch * creature.corrections.balance_pitch
            + roll * creature.corrections.balance_roll
        )
        if creature.corrections.stepping is not None:
            target = target + self.stepping(creature.corrections.stepping, senses)
        return np.clip(target, creature.joints.low, creature.joints.high)

    def _begun(self, planned: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Return the target blended from the standing pose, over the time `begin`."""
        passed, begin = (steps + 1) * self.step, max(self.tuning["begin"], self.step)
        stand = self.creature.joints.stand
        return stand + np.minimum(1, passed / begin)[:, None] * (planned - stand)

    def stepping(self, weights: Stepping, senses: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the change of the target by stepping under a fall, [S, J] rad."""
        gain, hip = self.tuning, self.creature.frame.hip_height
        swings = np.clip(senses["foot_height"] / (0.02 * hip), 0, 1)
        stands = 1 - swings
        carried = np.maximum(stands.sum(1), 1)
        astray = senses["foot_place"] - self.creature.feet.places
        over_ahead, over_left = (-(stands[:, :, None] * astray).sum(1) / carried[:, None] / hip).T
        fast_ahead, fast_left = senses["nose_vel"].T / np.sqrt(9.81 * hip)

        def clipped(one: np.ndarray, gene: str, other: np.ndarray, rate: str) -> np.ndarray:
            return np.clip(gain[gene] * one + gain[rate] * other, -0.5, 0.5)[:, None]

        ahead = clipped(over_ahead, "step", fast_ahead, "step_rate")
        left = clipped(over_left, "side", fast_left, "side_rate")
        pitch = clipped(senses["pitch"], "hold", senses["pitch_rate"], "hold_rate")
        roll = clipped(senses["roll"], "sway", senses["roll_rate"], "sway_rate")
        yaw = np.clip(gain["turn"] * self._wrong(senses), -0.5, 0.5)[:, None]
        legs = np.array(weights.legs)
        by_foot_ahead, by_foot_left, turned_left = (
            swings * ahead - stands * pitch,
            swings * left + stands * roll,
            stands * yaw - swings * yaw,
        )
        found: np.ndarray = (
            weights.ahead * by_foot_ahead[:, legs]
            + weights.aside * by_foot_left[:, legs]
            + weights.turn * turned_left[:, legs]
        )
        return found

    def corrections(
        self, senses: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return [S] each: `u` (without `steering`), `p`, `r` of docs/reference/controller.md."""
        gain = self.tuning
        pitch = gain["pitch"] * senses["pitch"] + gain["pitch_rate"] * senses["pitch_rate"]
        roll = gain["roll"] * senses["roll"] + gain["roll_rate"] * senses["roll_rate"]
        return (
            np.clip(gain["steer"] * self._wrong(senses), -0.5, 0.5),
            np.clip(pitch, -0.5, 0.5),
            np.clip(roll, -0.5, 0.5),
        )

    def _wrong(self, senses: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the deviation [S] in rad from the path: heading plus lateral offset."""
        wrong: np.ndarray = senses["heading"] + senses["aside"] / (
            2 * self.creature.frame.body_length
        )
        return wrong

    def advance(
        self, position: np.ndarray, target: np.ndarray, joint_pos: np.ndarray, steps: np.ndarray
    ) -> np.ndarray:
        """Return the positions [S] at the next control step.

        target, joint_pos: [S, J] of this step. steps: [S] taken, this one included.
        """
        if self.settings.advance == "clock":
            return self._by_clock(steps)
        error = np.sqrt(((target - joint_pos) ** 2).mean(1))
        return np.where(error < self.tuning["threshold"], (position + 1) % self.length, position)

    def _by_clock(self, steps: np.ndarray) -> np.ndarray:
        turn = int(float(np.float32(self.step) / np.float32(self.tuning["period"])) * 2**32)
        place = steps * (turn % 2**32) % 2**32 // 2**16
        return (place + 1) * self.length // 2**16 % self.length


def pose_cycle(key_poses: np.ndarray, creature: Creature) -> np.ndarray:
    """Return the cycle [C, J] in rad: key poses [K, J] and, if symmetric, their mirror images."""
    if not creature.mirror.symmetric:
        return key_poses
    return np.concatenate([key_poses, creature.mirror.sign * key_poses[:, creature.mirror.partner]])
