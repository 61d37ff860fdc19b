"""Work for every contestant: the same genomes on the same initial conditions, and the bare model.

Letters: `N` genomes, `R` starts, `K` key poses, `C` poses in a cycle, `J` actuated joints, `nq nv`
as in MuJoCo.
"""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.config.schema import Config, UseConfig
from mjxgait.controllers.key_poses.reference import pose_cycle
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.creature import FLOOR
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


def bare_model(creature: Creature) -> tuple[mujoco.MjModel, np.ndarray]:
    """Return the evolution model without purely visual shapes, its contacts as explicit pairs.

    Pairs save MuJoCo the search for possible contacts. A model that cannot be reduced is returned
    unchanged. Also returns the ids [G] of the watched geoms in the model.
    """
    full = creature.evolution_model
    names = [full.geom(g).name for g in range(full.ngeom)]
    if "" in names or not _only_the_floor_is_touched(full):
        return full, creature.feet.watched
    spec = mujoco.MjSpec.from_string(creature.files["creature.xml"])
    for body in spec.bodies[1:]:
        _keep_inertia(body, full)
    contacts = _contacts(full)
    kept = {FLOOR, *(names[g] for g in creature.feet.watched), *(names[g] for g in contacts)}
    for geom in list(spec.geoms):
        if geom.name in kept:
            geom.contype = geom.conaffinity = 0
        else:
            spec.delete(geom)
    for geom, mixed in contacts.items():
        spec.add_pair(geomname1=FLOOR, geomname2=names[geom], **mixed)
    bare = spec.compile()
    return bare, np.array([bare.geom(names[g]).id for g in creature.feet.watched], int)


def _only_the_floor_is_touched(full: mujoco.MjModel) -> bool:
    moving, solid = full.geom_bodyid != 0, (full.geom_contype | full.geom_conaffinity) != 0
    each_other = full.geom_contype[moving, None] & full.geom_conaffinity[moving]
    alone = np.flatnonzero(solid & ~moving).tolist() == [full.geom(FLOOR).id]
    return alone and not np.any(each_other)


def _keep_inertia(body: mujoco.MjsBody, full: mujoco.MjModel) -> None:
    """Set a body's inertia explicitly, since some of the shapes that define it are deleted."""
    i = full.body(body.name).id
    body.explicitinertial, body.fullinertia = True, [np.nan] * 6
    body.mass, body.inertia = full.body_mass[i], full.body_inertia[i]
    body.ipos, body.iquat = full.body_ipos[i], full.body_iquat[i]


def _contacts(full: mujoco.MjModel) -> dict[int, dict[str, int | float | np.ndarray]]:
    """Return each geom's contact with the floor, as MuJoCo mixes it.

    The contacts are found by sinking the body into the floor.
    """
    data = mujoco.MjData(full)
    data.qpos[int(full.jnt_qposadr[full.jnt_type == mujoco.mjtJoint.mjJNT_FREE][0]) + 2] -= 100.0
    mujoco.mj_forward(full, data)
    return {
        int(max(contact.geom)): {
            "condim": contact.dim,
            "friction": contact.friction.copy(),
            "solref": contact.solref.copy(),
            "solimp": contact.solimp.copy(),
            "margin": contact.includemargin,
        }
        for contact in data.contact
    }
