"""NumPy between batched steps of C MuJoCo (`mujoco.batch`): docs/reference/controller.md in NumPy.

It is as fast as Python allows. Each simulation keeps its MjData, so the step ends with the
velocity stage of the new state and computes nothing twice. An ended simulation takes the next
episode at once, and is no longer stepped when no episode is left; only then are arrays indexed.
It records no statistics but the distance, so it does less than its rivals.
"""

import mujoco
import numpy as np
from mujoco.batch import Batch

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.reference.layout import Layout, LowestPoint
from peers.workload import Workload

VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)
LANES = 128
"""Simulations per core: with fewer NumPy's calls cost more, more do not fit the cache."""


Rows = slice | np.ndarray
"""Some of the simulations; a slice gives views of their arrays."""


class MujocoPeer:
    """One core's share of a workload: the episodes `first`, `first + stride`, ..."""

    def __init__(self, workload: Workload, first: int, stride: int, lanes: int = LANES) -> None:
        check_controller(workload.config)
        self.work, self.creature = workload, workload.creature()
        self.jobs = np.arange(first, workload.episodes, stride)
        self.lanes = min(lanes, len(self.jobs))
        self.model = quiet(self.creature.evolution_model)
        self.batch = Batch(self.model, self.lanes, 1, persistent=True)
        self.friction = self.batch.expand("geom_friction")
        self.usual_friction = self.model.geom_friction[:, 0].copy()
        bind = self.batch.bind
        self.qpos, self.qvel, self.warmstart, self.applied = (
            bind("qpos"),
            bind("qvel"),
            bind("qacc_warmstart"),
            bind("qfrc_applied"),
        )
        self.xpos, self.xmat, self.mass, self.bias = (
            bind("xpos"),
            bind("xmat"),
            bind("M"),
            bind("qfrc_bias"),
        )
        self.geom_xpos, self.geom_xmat = bind("geom_xpos"), bind("geom_xmat")
        self.passive = bind("qfrc_passive") if _has_passive(self.model) else None
        self.forbidden = LowestPoint(
            self.model, self.creature.feet.watched[len(self.creature.feet.foot_of) :]
        )
        self.law = Law(self.creature, workload)
        self.damped = DampedSolve(self.model, self.creature)

    def lap(self) -> tuple[int, float]:
        """Return the useful steps, and the sum over episodes of the distance forward in m."""
        self.job = np.zeros(self.lanes, int)
        self.position = np.zeros(self.lanes, int)
        self.steps = np.zeros(self.lanes, int)
        self.moved = np.zeros(self.lanes)
        self.taken, total, forward = 0, 0, 0.0
        self._refill(np.arange(self.lanes))
        rows: Rows = slice(None)
        while True:
            self._push(rows)
            ended = (self._down(rows) | (self.steps[rows] >= self.work.steps)).nonzero()[0]
            if len(ended):
                ended = ended if isinstance(rows, slice) else rows[ended]
                total, forward = (
                    total + int(self.steps[ended].sum()),
                    forward + float(self.moved[ended].sum()),
                )
                idle = ended[self._refill(ended) :]
                if len(idle):
                    rows = np.setdiff1d(np.arange(self.lanes)[rows], idle)
                if not isinstance(rows, slice) and not len(rows):
                    return total, forward
                continue
            self._step(rows)

    def _step(self, rows: Rows) -> None:
        """Run one control step of the simulations in `rows`."""
        creature, law, genome = self.creature, self.law, self.job[rows] // len(self.work.qpos)
        pos, rot = (
            self.xpos[rows, creature.trunk],
            self.xmat[rows, creature.trunk].reshape(-1, 3, 3),
        )
        q, v = self.qpos[rows][:, law.qpos], self.qvel[rows]
        self.moved[rows] = (pos - law.start) @ law.forward
        self.steps[rows] += 1
        target = law.target(genome, self.position[rows], pos, rot, v)
        bias = self.bias[rows] if self.passive is None else self.bias[rows] - self.passive[rows]
        force = law.kp * (target - q - law.step * v[:, law.dof]) - law.kd * v[:, law.dof]
        pushed = -bias
        pushed[:, law.dof] += force
        acceleration = self.damped.solve(self.mass[rows], pushed)[:, law.dof]
        self.applied[rows, law.dof] = np.clip(
            force - law.step * law.kd * acceleration,
            -creature.gains.torque_limit,
            creature.gains.torque_limit,
        )
        self.position[rows] = law.advance(genome, self.position[rows], target, q, self.steps[rows])
        self.batch.step(None if isinstance(rows, slice) else rows, stage=VELOCITY_STAGE)

    def _refill(self, rows: np.ndarray) -> int:
        """Start waiting episodes in the first of `rows`; return their number."""
        rows = rows[: len(self.jobs) - self.taken]
        if not len(rows):
            return 0
        self.job[rows] = self.jobs[self.taken : self.taken + len(rows)]
        self.taken += len(rows)
        start = self.job[rows] % len(self.work.qpos)
        self.qpos[rows], self.qvel[rows] = self.work.qpos[start], self.work.qvel[start]
        self.warmstart[rows], self.applied[rows] = 0.0, 0.0
        self.friction[rows, :, 0] = self.usual_friction * self.work.friction[start, None]
        self.position[rows] = self.steps[rows] = self.moved[rows] = 0
        self.batch.forward(rows, stage=VELOCITY_STAGE)
        return len(rows)

    def _push(self, rows: Rows) -> None:
        start = self.job[rows] % len(self.work.qpos)
        now = (self.steps[rows] == self.work.push_step[start]).nonzero()[0]
        if len(now):
            lanes = np.arange(self.lanes)[rows][now]
            self.qvel[lanes] += self.work.push[start[now]]
            self.batch.forward(lanes, stage=VELOCITY_STAGE)

    def _down(self, rows: Rows) -> np.ndarray:
        """Apply the rules of `mjxgait.tasks.walk.stats`.

        The comparisons are negated, so that NaN counts as down.
        """
        creature, limits = self.creature, self.creature.settings.termination
        up = self.xmat[rows, creature.trunk, 6:] @ creature.frame.up
        height = self.xpos[rows, creature.trunk, 2] / creature.frame.stand_height
        fine = (up >= limits.min_up) & (height >= limits.height[0]) & (height <= limits.height[1])
        if limits.touch:
            fine &= self.forbidden.lowest(self.geom_xpos[rows], self.geom_xmat[rows]) >= 0
        return ~fine


class Law:
    """Pose tracker of the controller for many simulations; looks constants up once."""

    def __init__(self, creature: Creature, workload: Workload) -> None:
        self.creature, settings = creature, workload.config.controller
        self.cycle, self.tuning = workload.cycles(creature), workload.tuning
        self.step, self.kp, self.kd = (
            float(creature.model.opt.timestep),
            creature.gains.kp,
            creature.gains.kd,
        )
        self.qpos, self.dof = _span(creature.joints.qpos_adr), _span(creature.joints.dof_adr)
        self.interpolation, self.by_clock = settings.interpolation, settings.advance == "clock"
        self.poses = self.cycle.shape[1]
        self.length = self.poses * settings.interpolation
        self.root = Layout(creature.model).root_dof + 3
        self.start = creature.frame.stand_pos
        self.forward, self.left = (
            _horizontal(creature.frame.stand_rot @ axis)
            for axis in (creature.frame.forward, creature.frame.left)
        )
        self.axes = np.stack([creature.frame.forward, creature.frame.left], 1)
        self.balances = any(
            np.any(self.tuning[name]) for name in ("pitch", "pitch_rate", "roll", "roll_rate")
        )

    def target(
        self,
        genome: np.ndarray,
        position: np.ndarray,
        pos: np.ndarray,
        rot: np.ndarray,
        v: np.ndarray,
    ) -> np.ndarray:
        """Return the corrected target [S, J] in rad."""
        creature, gain = self.creature, self.tuning
        a, step = np.divmod(position, self.interpolation)
        here = self.cycle[genome, a]
        target = here + (step / self.interpolation)[:, None] * (
            self.cycle[genome, (a + 1) % self.poses] - here
        )
        axes = rot @ self.axes
        forward = axes[:, :, 0]
        wrong = np.arctan2(forward @ self.left, forward @ self.forward) + (
            pos - self.start
        ) @ self.left / (2 * creature.frame.body_length)
        steer = np.clip(gain["steer"][genome] * wrong, -0.5, 0.5)[:, None]
        target += steer * (
            creature.corrections.steer_bend
            + creature.corrections.steer_stride * (target - creature.joints.stand)
        )
        if self.balances:
            spin = (rot @ v[:, self.root : self.root + 3, None])[:, None, :, 0] @ axes
            lean = np.arcsin(np.clip(axes[:, 2], -1, 1))
            pitch = np.clip(
                gain["pitch_rate"][genome] * spin[:, 0, 1] - gain["pitch"][genome] * lean[:, 0],
                -0.5,
                0.5,
            )
            roll = np.clip(
                gain["roll_rate"][genome] * spin[:, 0, 0] + gain["roll"][genome] * lean[:, 1],
                -0.5,
                0.5,
            )
            target += (
                pitch[:, None] * creature.corrections.balance_pitch
                + roll[:, None] * creature.corrections.balance_roll
            )
        return np.clip(target, creature.joints.low, creature.joints.high, out=target)

    def advance(
        self,
        genome: np.ndarray,
        position: np.ndarray,
        target: np.ndarray,
        q: np.ndarray,
        steps: np.ndarray,
    ) -> np.ndarray:
        """Return the positions in the cycle [S] at the next step."""
        if self.by_clock:
            return (self.length * steps * self.step / self.tuning["period"][genome] + 1e-6).astype(
                int
            ) % self.length
        error = target - q
        reached = (
            np.einsum("sj,sj->s", error, error)
            < error.shape[1] * self.tuning["threshold"][genome] ** 2
        )
        return (position + reached) % self.length


class DampedSolve:
    """Solve `(M + h diag(kd))^-1 force` by LAPACK, from MuJoCo's stored entries in one look-up."""

    def __init__(self, model: mujoco.MjModel, creature: Creature) -> None:
        layout = Layout(model)
        entry = np.full((model.nv, model.nv), model.nC)
        entry[layout.mass_row, layout.mass_column] = entry[layout.mass_column, layout.mass_row] = (
            np.arange(model.nC)
        )
        self.entry, self.size = entry.ravel(), model.nv
        self.damping = np.zeros(model.nC)
        self.damping[entry[creature.joints.dof_adr, creature.joints.dof_adr]] = (
            float(creature.model.opt.timestep) * creature.gains.kd
        )

    def solve(self, mass: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return accelerations [S, nv] for stored entries [S, nC] and forces [S, nv]."""
        stored = np.zeros((len(mass), mass.shape[1] + 1))
        np.add(mass, self.damping, out=stored[:, :-1])
        dense = stored.take(self.entry, axis=1).reshape(-1, self.size, self.size)
        return np.linalg.solve(dense, force[..., None])[..., 0]


def check_controller(config: Config) -> None:
    """Refuse settings that the peers do not support, lest they silently do less work."""
    drive = config.drive
    if (
        drive.law != "spd"
        or drive.constraint_forces
        or (config.controller.mirror, drive.stiffness, drive.damping) != (True, 1, 1)
    ):
        raise ValueError(
            "the peers know mirrored poses and stable PD with the gains of the creature only"
        )


def quiet(model: mujoco.MjModel) -> mujoco.MjModel:
    """Make a simulation that blows up end, not reset; switch off what costs more than it saves."""
    flag = mujoco.mjtDisableBit
    off = [flag.mjDSBL_AUTORESET, flag.mjDSBL_ISLAND]
    if not _has_passive(model):
        off += [flag.mjDSBL_SPRING, flag.mjDSBL_DAMPER]
    for bit in off:
        model.opt.disableflags |= int(bit)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    return model


def _has_passive(model: mujoco.MjModel) -> bool:
    return bool(
        np.any(model.dof_damping)
        or np.any(model.jnt_stiffness)
        or model.opt.density
        or model.opt.viscosity
    )


def _span(adr: np.ndarray) -> Rows:
    """Return consecutive addresses as a slice, which gives a view instead of a copy."""
    return (
        slice(int(adr[0]), int(adr[-1]) + 1)
        if np.array_equal(adr, np.arange(adr[0], adr[0] + len(adr)))
        else adr
    )


def _horizontal(vector: np.ndarray) -> np.ndarray:
    flat = vector * [1.0, 1.0, 0.0]
    return flat / np.linalg.norm(flat)
