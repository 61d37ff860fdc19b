"""The controller of key poses, written from docs/controller.md alone.

Letters: `S` simulations, `J` actuated joints, `K` key poses, `C` poses in the cycle.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from mjxgait.certify.twins.protocol import Command, Memory
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.settings.control import TUNING


class PoseTwin:
    """Tracks a champion's pose cycle. Its memory: `position` [S] in the cycle, `steps` [S]."""

    reads = ("joint_pos", "heading", "aside", "pitch", "roll", "pitch_rate", "roll_rate")
    command: ClassVar[Command] = "pose"
    every: ClassVar[int] = 1

    def __init__(self, creature: Creature, champion: Champion, step: float) -> None:
        self.creature, self.settings, self.step = creature, champion.settings, step
        self.tuning = dict(zip(TUNING, map(float, champion.genome["tuning"]), strict=True))
        poses = np.asarray(champion.genome["key_poses"], float)
        self.cycle = pose_cycle(poses, creature) if champion.settings.mirror else poses
        self.length = len(self.cycle) * champion.settings.interpolation

    def init(self, count: int) -> Memory:
        """See `Twin`."""
        return {name: np.zeros(count, dtype=int) for name in ("position", "steps")}

    def phase(self, memory: Memory) -> np.ndarray:
        """See `Twin`."""
        return memory["position"] / self.length

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `Twin`."""
        target = self.target(memory["position"], senses)
        steps = memory["steps"] + 1
        position = self.advance(memory["position"], target, senses["joint_pos"], steps)
        return target, {"position": position, "steps": steps}

    def planned(self, position: np.ndarray) -> np.ndarray:
        """Uncorrected target [S, J] in rad at cycle positions [S]."""
        a, step = np.divmod(position, self.settings.interpolation)
        f = (step / self.settings.interpolation)[:, None]
        return (1 - f) * self.cycle[a] + f * self.cycle[(a + 1) % len(self.cycle)]

    def target(self, position: np.ndarray, senses: Mapping[str, np.ndarray]) -> np.ndarray:
        """Target [S, J] in rad with steering and balance, within the joints' ranges."""
        creature = self.creature
        steer, pitch, roll = (part[:, None] for part in self.corrections(senses))
        stretched = creature.joints.stand + (self.planned(position) - creature.joints.stand) * (
            1 + steer * creature.corrections.steer_stride
        )
        target = (
            stretched
            + steer * creature.corrections.steer_bend
            + pitch * creature.corrections.balance_pitch
            + roll * creature.corrections.balance_roll
        )
        return np.clip(target, creature.joints.low, creature.joints.high)

    def corrections(
        self, senses: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`u`, `p` and `r` of docs/controller.md, [S] each."""
        gain = self.tuning
        wrong = senses["heading"] + senses["aside"] / (2 * self.creature.frame.body_length)
        pitch = gain["pitch"] * senses["pitch"] + gain["pitch_rate"] * senses["pitch_rate"]
        roll = gain["roll"] * senses["roll"] + gain["roll_rate"] * senses["roll_rate"]
        return (
            np.clip(gain["steer"] * wrong, -0.5, 0.5),
            np.clip(pitch, -0.5, 0.5),
            np.clip(roll, -0.5, 0.5),
        )

    def advance(
        self, position: np.ndarray, target: np.ndarray, joint_pos: np.ndarray, steps: np.ndarray
    ) -> np.ndarray:
        """Positions [S] at the next control step.

        target, joint_pos: [S, J] of this step. steps: [S] taken then, this one included.
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
    """[C, J] rad: the key poses [K, J], followed by their mirror images where the creature is
    symmetric.
    """
    if not creature.mirror.symmetric:
        return key_poses
    return np.concatenate([key_poses, creature.mirror.sign * key_poses[:, creature.mirror.partner]])
