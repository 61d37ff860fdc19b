"""Reference controller that stops: from a given moment its poses blend into the standing pose.

Letters: `S` simulations, `J` actuated joints.
"""

from collections.abc import Mapping

import numpy as np

from mjxgait.champion import Champion
from mjxgait.controllers.key_poses.reference import PoseTwin
from mjxgait.creature import Creature
from mjxgait.reference.controllers.protocol import Memory


class HaltingTwin(PoseTwin):
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
        """See `Twin`; `count` must be the number of `halts`."""
        assert count == len(self.halts), "a halt for each simulation"
        return {**super().init(count), "halt": self.halts.copy(), "fade": self.fades.copy()}

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `Twin`."""
        since = memory["steps"] * self.step - memory["halt"]
        share = np.clip(since / memory["fade"], 0.0, 1.0)[:, None]
        planned = self.planned(memory["position"])
        halted = planned + share * (self.creature.joints.stand - planned)
        target = self.corrected(halted, senses, memory["steps"])
        steps = memory["steps"] + 1
        onward = self.advance(memory["position"], target, senses["joint_pos"], steps)
        position = np.where(since < 0, onward, memory["position"])
        return target, {**memory, "position": position, "steps": steps}
