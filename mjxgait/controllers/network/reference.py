"""Reference controller for networks, written from docs/reference/network.md alone.

Letters: `S` simulations, `J` actuated joints.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.controllers import Command, Memory

SIDEWAYS = ("roll", "roll_rate", "heading", "aside")
UPRIGHT = ("trunk_height", "up_vel", "pitch", "pitch_rate")


class NetworkReference:
    """Implementation of `ReferenceController`. Its memory holds only the number of simulations."""

    command: ClassVar[Command] = "pose"
    reads = ("joint_pos", "joint_vel", "nose_vel", *UPRIGHT, *SIDEWAYS, "time")

    def __init__(self, creature: Creature, champion: Champion, step: float) -> None:
        self.creature, self.every = creature, int(champion.settings.every)
        self.period, self.genome = float(champion.settings.period), champion.genome
        self.depth = len(champion.genome) // 2

    def init(self, count: int) -> Memory:
        """See `ReferenceController`."""
        return {"still": np.zeros(count)}

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `ReferenceController`."""
        joints, mirror = self.creature.joints, self.creature.mirror
        bent, ahead_left = senses["joint_pos"] - joints.stand, np.array([1.0, -1.0])
        level = [senses[name] for name in UPRIGHT]
        tipped = [senses[name] for name in SIDEWAYS]
        turn = 2 * np.pi * senses["time"] / self.period
        out = self._network(bent, senses["joint_vel"], senses["nose_vel"], level, tipped, turn)
        if mirror.symmetric:
            other = self._network(
                mirror.image(bent),
                mirror.image(senses["joint_vel"]),
                senses["nose_vel"] * ahead_left,
                level,
                [-value for value in tipped],
                turn + np.pi,
            )
            out = (out + mirror.image(other)) / 2
        reach = (joints.pose_high - joints.pose_low) / 2
        target = joints.stand + reach * np.tanh(out)
        return np.clip(target, joints.pose_low, joints.pose_high), memory

    def phase(self, memory: Memory) -> np.ndarray:
        """Return NaN: its clock is no cycle of poses."""
        return np.full(len(memory["still"]), np.nan)

    def _network(
        self,
        bent: np.ndarray,
        speeds: np.ndarray,
        nose: np.ndarray,
        level: list[np.ndarray],
        tipped: list[np.ndarray],
        turn: np.ndarray,
    ) -> np.ndarray:
        """Return the outputs [S, J]."""
        columns = np.stack([*level, *tipped, np.sin(turn), np.cos(turn)], 1)
        layer = np.concatenate([bent, speeds, nose, columns], 1)
        for i in range(self.depth):
            layer = layer @ self.genome[f"weight_{i}"] + self.genome[f"bias_{i}"]
            if i + 1 < self.depth:
                layer = np.tanh(layer)
        return layer
