"""Work of every contestant: the same genomes on the same starts, in plain NumPy.

Letters: `N` genomes, `R` starts, `K` key poses, `C` poses in a cycle, `J` actuated joints, `nq nv`
as in MuJoCo.
"""

import dataclasses
from pathlib import Path

import numpy as np

from mjxgait.config.schema import Config, UseConfig
from mjxgait.controllers.key_poses.reference import pose_cycle
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.settings import CreatureSettings
from mjxgait.plugins import resolve_config


def walking(settings: CreatureSettings) -> Config:
    """Return the settings of a contest: walking by key poses, whatever else the creature does."""
    use = dataclasses.asdict(UseConfig())
    config = resolve_config(settings.train, settings.creature.name, use=use)
    # The other contestants simulate every genome on all starts of a generation; so do we.
    return dataclasses.replace(config, rollout=dataclasses.replace(config.rollout, promote=1.0))


@dataclasses.dataclass(frozen=True, eq=False)
class Workload:
    """N * R episodes of one creature; episode `e` is genome `e // R` on start `e % R`.

    key_poses: [N, K, J]. tuning: name to [N]. qpos: [R, nq]. qvel: [R, nv]. friction: [R].
    push: [R, nv], added to qvel at step push_step [R]. steps: T, of a full episode.
    """

    folder: Path
    config: Config
    key_poses: np.ndarray
    tuning: dict[str, np.ndarray]
    qpos: np.ndarray
    qvel: np.ndarray
    friction: np.ndarray
    push: np.ndarray
    push_step: np.ndarray
    steps: int

    @property
    def episodes(self) -> int:
        """N * R."""
        return len(self.key_poses) * len(self.qpos)

    def creature(self) -> Creature:
        """Load the creature anew: it cannot be sent to another process."""
        return load_creature(self.folder)

    def cycles(self, creature: Creature) -> np.ndarray:
        """Return the pose cycle [N, C, J] of each genome, in rad."""
        return np.stack([pose_cycle(poses, creature) for poses in self.key_poses])

    def every(self, stride: int) -> "Workload":
        """Keep every `stride`-th genome, for a contestant that is too slow for all."""
        tuning = {name: values[::stride] for name, values in self.tuning.items()}
        return dataclasses.replace(self, key_poses=self.key_poses[::stride], tuning=tuning)


@dataclasses.dataclass(frozen=True)
class Lap:
    """One pass over a workload.

    seconds: of wall time. processor: s of all cores, which other work on the machine changes
    little. steps: useful ones, of creatures still up. forward: m, mean over episodes.
    """

    seconds: float
    steps: int
    forward: float
    processor: float = 0.0

    @property
    def rate(self) -> float:
        """Useful creature-steps per second."""
        return self.steps / self.seconds

    @property
    def cost(self) -> float:
        """Processor time per useful creature-step, in us."""
        return 1e6 * self.processor / self.steps
