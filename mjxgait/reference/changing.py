"""Controllers that change or halt during a simulation.

Letters: `S` simulations, `J` actuated joints.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from typing_extensions import override

from mjxgait.champion import Champion
from mjxgait.controllers.key_poses.reference import PoseReference
from mjxgait.creature import Creature
from mjxgait.reference.controllers import Command, Memory

ROUNDING = 1e-6
"""Positions by which a sum of steps may fall short of the next position."""


class ChangingReference:
    """Blend from one key-pose controller to another; both share one phase.

    Memory: `cycles` [S] done, `steps` [S], and `change` [S] s.
    changes: [S] s, moment of the command. seconds: duration of the blend.
    """

    command: ClassVar[Command] = "pose"
    every: ClassVar[int] = 1

    def __init__(
        self,
        creature: Creature,
        before: Champion,
        after: Champion,
        step: float,
        changes: np.ndarray,
        seconds: float,
    ) -> None:
        self.before, self.after = (
            PoseReference(creature, champion, step) for champion in (before, after)
        )
        self.reads = tuple(dict.fromkeys((*self.before.reads, *self.after.reads)))
        self.step, self.changes, self.seconds = step, changes, seconds

    def init(self, count: int) -> Memory:
        """Implementation of `ReferenceController`; `count` must be the number of `changes`."""
        assert count == len(self.changes), "a change for each simulation"
        return {
            "cycles": np.zeros(count),
            "steps": np.zeros(count, dtype=int),
            "change": self.changes.copy(),
        }

    def phase(self, memory: Memory) -> np.ndarray:
        """See `ReferenceController`."""
        return memory["cycles"] % 1.0

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `ReferenceController`."""
        since = memory["steps"] * self.step - memory["change"]
        share = np.clip(since / self.seconds, 0.0, 1.0)
        old, new = (
            reference.target(self._position(reference, memory), senses, memory["steps"])
            for reference in (self.before, self.after)
        )
        target = old + share[:, None] * (new - old)
        slow, fast = (
            self._rate(reference, target, senses["joint_pos"])
            for reference in (self.before, self.after)
        )
        cycles = memory["cycles"] + slow + share * (fast - slow)
        return target, {**memory, "cycles": cycles, "steps": memory["steps"] + 1}

    def _position(self, reference: PoseReference, memory: Memory) -> np.ndarray:
        place = np.floor(self.phase(memory) * reference.length + ROUNDING)
        return place.astype(int) % reference.length

    def _rate(
        self, reference: PoseReference, target: np.ndarray, joint_pos: np.ndarray
    ) -> np.ndarray:
        """Return cycles per step [S]; target, joint_pos: [S, J]."""
        if reference.settings.advance == "clock":
            return np.full(len(target), self.step / reference.tuning["period"])
        error = np.sqrt(((target - joint_pos) ** 2).mean(1))
        return (error < reference.tuning["threshold"]) / reference.length


class HaltingReference(PoseReference):
    """Key-pose controller that stops on command: the cycle freezes, balance continues.

    halts: [S] s, moment of the command. fades: [S] s from the pose at that moment to the standing
    pose.
    """

    def __init__(
        self,
        creature: Creature,
        champion: Champion,
        step: float,
        halts: np.ndarray,
        fades: np.ndarray,
    ) -> None:
        super().__init__(creature, champion, step)
        self.halts, self.fades = halts, fades

    def init(self, count: int) -> Memory:
        """Implementation of `ReferenceController`; `count` must be the number of `halts`."""
        assert count == len(self.halts), "a halt for each simulation"
        return {**super().init(count), "halt": self.halts.copy(), "fade": self.fades.copy()}

    @override
    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        since = memory["steps"] * self.step - memory["halt"]
        share = np.clip(since / memory["fade"], 0.0, 1.0)[:, None]
        planned = self.planned(memory["position"])
        halted = planned + share * (self.creature.joints.stand - planned)
        target = self.corrected(halted, senses, memory["steps"])
        steps = memory["steps"] + 1
        advanced = self.advance(memory["position"], target, senses["joint_pos"], steps)
        position = np.where(since < 0, advanced, memory["position"])
        return target, {**memory, "position": position, "steps": steps}
