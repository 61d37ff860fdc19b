"""Steps the simulations of one thread on C MuJoCo, under the twin of the champion's controller.

Letters: `S` simulations, `R` recorded ones (the first of the `S`), `T` control steps, `J` actuated
joints, `nq nv` as in MuJoCo.
"""

import copy
from typing import Protocol

import mujoco
import numpy as np

from mjxgait.certify.bar import Clearance
from mjxgait.certify.batch import batch_of
from mjxgait.certify.config import CertificateConfig
from mjxgait.certify.drive import Drive
from mjxgait.certify.layout import Layout, LowestPoint, colliding_geoms, per_foot, start_frame
from mjxgait.certify.outcome import Fall, Outcome, Trajectory, blank_film
from mjxgait.certify.starts import Starts
from mjxgait.certify.state import FOOT_SENSES, State, sense
from mjxgait.certify.terrain import grounded_model, terrain_of
from mjxgait.certify.twins import twin_of
from mjxgait.certify.water import Bath
from mjxgait.champion import Champion
from mjxgait.creature import Creature

VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)

WARMUP = CertificateConfig().warmup
"""s; who leaps before has not settled yet."""
BLOWN_UP = 1e4
"""m/s or rad/s, from which a simulation is stopped: beyond any walk, and before MuJoCo itself
complains in a log file.
"""


def examined_model(creature: Creature, refine: int = 1) -> mujoco.MjModel:
    """The creature's own body on its ground, with a converged contact solver, and its time step
    divided by `refine`.
    """
    model = copy.copy(grounded_model(creature))
    model.opt.iterations, model.opt.ls_iterations = 100, 50
    model.opt.tolerance = 1e-8
    model.opt.timestep = creature.model.opt.timestep / refine
    # A simulation that blows up must not be put back on its feet in silence.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


class Around(Protocol):
    """What a simulation must know of the task; see `tasks.Demands`."""

    drag: float
    leaps: bool

    def onward(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """See `tasks.Demands`."""
        ...


class Stepping:
    """The simulations of one thread, of which the first `record` are recorded."""

    def __init__(
        self,
        creature: Creature,
        champion: Champion,
        starts: Starts,
        record: int,
        refine: int,
        fall: Fall,
        task: Around,
    ) -> None:
        self.creature, self.starts, self.fall = creature, starts, fall
        self.record, self.refine = record, refine
        self.goal, self.task = starts.goal.copy(), task
        step = float(creature.model.opt.timestep)
        self.twin = twin_of(creature, champion, step)
        self.drive = Drive(creature, champion.drive, self.twin.command, step)
        self.start = start_frame(creature)
        self.model = examined_model(creature, refine)
        self.batch = batch_of(creature, self.model, starts)
        self.layout = Layout(self.model)
        self.terrain = terrain_of(creature)
        self.solid = LowestPoint(self.model, colliding_geoms(self.model), self.terrain)
        others = creature.feet.watched[len(creature.feet.foot_of) :]
        self.forbidden = LowestPoint(self.model, others, self.terrain)
        bind = self.batch.bind
        self.qpos, self.qvel, self.applied = bind("qpos"), bind("qvel"), bind("qfrc_applied")
        self.warm_start = bind("qacc_warmstart")
        self.xpos, self.xmat, self.mass = bind("xpos"), bind("xmat"), bind("M")
        self.bias, self.passive, self.constraint = (
            bind("qfrc_bias"),
            bind("qfrc_passive"),
            bind("qfrc_constraint"),
        )
        self.geom_xpos, self.geom_xmat = bind("geom_xpos"), bind("geom_xmat")
        self.bath = Bath(self.model, self.batch, task.drag) if task.drag else None
        if self.bath is None:
            self._lift()
        self.batch.forward(stage=VELOCITY_STAGE)
        self.memory = dict(self.twin.init(len(starts)))
        self.command = np.zeros_like(starts.stiffness)
        feet = creature.feet.watched[: len(creature.feet.foot_of)]
        self.feet = LowestPoint(self.model, feet, self.terrain)
        self.sees_feet = any(name in FOOT_SENSES for name in self.twin.reads)
        self.sees_light = "light" in self.twin.reads
        self.last_force = np.zeros_like(self.qvel)
        self.bar = Clearance(creature) if np.isfinite(starts.bar).any() else None
        # What the controller has sent last, for those whose torques come late.
        self.sent = np.zeros((int(starts.delay.max()) + 1, *starts.stiffness.shape))

    def to_the_end(self, steps: int, heading: np.ndarray | None) -> Outcome:
        """Steps until the end, leaving out what has fallen and is not recorded.

        heading: [S, T] rad that each is told; None where nobody is told any.
        """
        count, time_step = len(self.starts), self.creature.model.opt.timestep
        fell = np.full(count, np.inf)
        travel, path = np.zeros((count, 3)), np.full((count, steps), np.nan)
        clearance, height = np.full(count, np.inf), np.zeros(count)
        astray = np.full((count, 0 if heading is None else steps), np.nan)
        leader, waiting = self._alike(heading)
        running = np.setdiff1d(np.arange(count), waiting)
        film = blank_film(self.creature, time_step, self.record, steps)
        for k in range(steps):
            if not len(running):
                break
            if len(waiting) and np.isinf(fell[leader]):
                released = waiting[self._pushed(waiting, k)]
                self._follow(released, leader)
                path[released, :k] = path[leader, :k]
                astray[released, :k] = astray[leader, :k]
                clearance[released] = clearance[leader]
                running, waiting = np.union1d(running, released), np.setdiff1d(waiting, released)
            self._push(running, k)
            commanded = None if heading is None else heading[running, k]
            self._control_step(running, k, commanded, film)
            travel[running] = self._travel(running)
            path[running, k] = travel[running, 0]
            if commanded is not None:
                astray[running, k] = self._astray(running, commanded)
            clearance[running] = np.minimum(clearance[running], self._clearance(running))
            if self.task.leaps and (k + 1) * time_step > WARMUP:
                height[running] = np.maximum(height[running], self._height(running))
            down = running[self._down(running)]
            fell[down] = np.minimum(fell[down], (k + 1) * time_step)
            watched = (k + 1) * time_step < self.starts.end[running]
            if len(down) or not watched.all():
                running = running[
                    watched
                    & self._sane(running)
                    & ((running < self.record) | np.isinf(fell[running]))
                ]
        fell[waiting], travel[waiting] = fell[leader], travel[leader]
        path[waiting], clearance[waiting] = path[leader], clearance[leader]
        astray[waiting] = astray[leader]
        return Outcome(fell, travel, path, clearance, film, astray, height)

    def _alike(self, heading: np.ndarray | None) -> tuple[int, np.ndarray]:
        """One simulation that stands for others until they are pushed, and those others.

        Nothing tells them apart before, so a quarter of all steps need not be taken.
        """
        alike, goal = np.flatnonzero(self.starts.undisturbed), self.starts.goal
        if heading is not None and np.ptp(heading, axis=0).any():
            alike = alike[:0]
        if not len(alike):
            return 0, alike
        alike = alike[goal[alike] == goal[alike[0]]]
        leader = int(alike[self.starts.push_time[alike].argmax()])
        return leader, alike[(alike != leader) & (alike >= self.record)]

    def _follow(self, rows: np.ndarray, leader: int) -> None:
        """Puts simulations where another one is."""
        own = (self.qpos, self.qvel, self.warm_start, self.last_force, self.goal, self.command)
        for state in (*own, *self.memory.values()):
            state[rows] = state[leader]
        self.sent[:, rows] = self.sent[:, [leader]]

    def _control_step(
        self, running: np.ndarray, k: int, heading: np.ndarray | None, film: Trajectory
    ) -> None:
        kept = running[running < self.record]
        film.qpos[kept, k], film.qvel[kept, k] = self.qpos[kept], self.qvel[kept]
        film.phase[kept, k] = self.twin.phase({n: m[kept] for n, m in self.memory.items()})
        command, torque = self._physics_step(running, k, heading)
        film.torque[kept, k] = torque[: len(kept)]
        if self.twin.command == "pose":
            film.target[kept, k] = command[: len(kept)]
        for _ in range(self.refine - 1):
            self._step(running)

    def _physics_step(
        self, running: np.ndarray, k: int, heading: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The command, and the torque that acts, [running, J] each."""
        state, starts = self._state(running, k), self.starts
        if k % self.twin.every == 0:
            self.command[running] = self._act(running, state, heading)
        command = self.command[running]
        first, way = self.starts.goal[running], self._travel(running)[:, 0]
        self.goal[running] = self.task.onward(self.goal[running], first, way)
        self.sent[k % len(self.sent), running] = self.drive.torque(
            command, state, starts.stiffness[running], starts.damping[running]
        )
        # Before the first torque has arrived it acts already, as if the body had been held so.
        arrived = np.maximum(k - starts.delay[running], 0) % len(self.sent)
        torque = self.sent[arrived, running]
        self.applied[running[:, None], self.creature.joints.dof_adr] = torque
        self._step(running)
        self.last_force[running] = self.constraint[running]
        return command, torque

    def _step(self, running: np.ndarray) -> None:
        """One step of physics, to the new moment and its velocities."""
        if self.bath:
            self.bath.press(running)
        self.batch.step(running, stage=VELOCITY_STAGE)

    def _act(self, running: np.ndarray, state: State, heading: np.ndarray | None) -> np.ndarray:
        """The command [running, J]; the twin's memory moves on."""
        senses = sense(self.creature, state, self.twin.reads)
        if heading is not None:
            # Told where to go, it does not come back to the line that it left.
            senses["heading"] = wrapped(senses["heading"] - heading)
            senses["aside"] = np.zeros_like(senses["aside"])
        before = {name: values[running] for name, values in self.memory.items()}
        command, after = self.twin.act(before, senses)
        for name, values in after.items():
            self.memory[name][running] = values
        return command

    def _state(self, running: np.ndarray, k: int) -> State:
        """M and bias belong to the current state: each step ends with the velocity stage of the
        new one.
        """
        creature, velocity = self.creature, self.qvel[running]
        rot, root = self.xmat[running, creature.trunk].reshape(-1, 3, 3), self.layout.root_dof
        return State(
            start=self.start,
            ground=self.terrain,
            time=np.full(len(running), k * creature.model.opt.timestep),
            joint_pos=self.qpos[running[:, None], creature.joints.qpos_adr],
            velocity=velocity,
            trunk_pos=self.xpos[running, creature.trunk],
            trunk_rot=rot,
            trunk_vel=velocity[:, root : root + 3],
            # A free joint's angular velocity is in the body's own frame.
            trunk_angvel=(rot * velocity[:, None, root + 3 : root + 6]).sum(2),
            foot_height=self._foot_height(running),
            foot_pos=self._foot_pos(running),
            mass_matrix=self.layout.dense(self.mass[running]),
            bias=self.bias[running] - self.passive[running],
            constraint_force=self.last_force[running],
            light=self._light(running),
            goal=self.goal[running],
            bar=self.starts.bar[running, 0],
        )

    def _foot_height(self, running: np.ndarray) -> np.ndarray:
        if not self.sees_feet:
            return np.zeros((len(running), 0))
        if self.bath:
            return np.full((len(running), len(self.creature.feet.names)), np.inf)
        low = self.feet.heights(self.geom_xpos[running], self.geom_xmat[running])
        return per_foot(self.creature, low)

    def _light(self, running: np.ndarray) -> np.ndarray:
        """[running, F, 3], its direction in each foot's own axes."""
        if not self.sees_light:
            return np.zeros((len(running), 0, 3))
        light = self.starts.light[running][:, None]
        there = self.start.place + light - self.geom_xpos[running][:, self.feet.geoms]
        there = np.where(light.any(2, keepdims=True), there, 0.0)
        there /= np.maximum(np.linalg.norm(there, axis=2, keepdims=True), 1e-9)
        rot = self.geom_xmat[running][:, self.feet.geoms].reshape(*there.shape, 3)
        seen: np.ndarray = (there[:, :, None] @ rot)[:, :, 0]
        return seen

    def _foot_pos(self, running: np.ndarray) -> np.ndarray:
        if not self.sees_feet:
            return np.zeros((len(running), 0, 3))
        feet = self.creature.feet
        pos = self.geom_xpos[running][:, list(feet.stepping)]
        return np.stack(
            [pos[:, feet.foot_of == foot].mean(1) for foot in range(len(feet.names))], 1
        )

    def _lift(self) -> None:
        """Raises each start until no part is deeper in the floor than when standing; else joint
        noise would begin with a kick.
        """
        self.batch.forward(stage=VELOCITY_STAGE)
        standing = mujoco.MjData(self.model)
        standing.qpos[:] = self.creature.stand_qpos
        mujoco.mj_kinematics(self.model, standing)
        usual = self.solid.lowest(standing.geom_xpos[None], standing.geom_xmat[None])
        self.qpos[:, self.layout.root_qpos + 2] += np.maximum(
            usual - self.solid.lowest(self.geom_xpos, self.geom_xmat), 0
        )

    def _push(self, running: np.ndarray, k: int) -> None:
        pushed = running[self._pushed(running, k)]
        if len(pushed):
            self.qvel[pushed, self.layout.root_dof : self.layout.root_dof + 2] += self.starts.push[
                pushed
            ]
            self.batch.forward(pushed, stage=VELOCITY_STAGE)

    def _pushed(self, rows: np.ndarray, k: int) -> np.ndarray:
        """Which of some simulations are pushed at a step."""
        time_step = self.creature.model.opt.timestep
        return np.floor(self.starts.push_time[rows] / time_step) == k

    def _travel(self, running: np.ndarray) -> np.ndarray:
        start = self.start
        moved = self.xpos[running, self.creature.trunk] - start.place
        return np.stack([moved @ start.forward, moved @ start.left, moved[:, 2]], 1)

    def _astray(self, running: np.ndarray, told: np.ndarray) -> np.ndarray:
        rot = self.xmat[running, self.creature.trunk].reshape(-1, 3, 3)
        nose = rot @ self.creature.frame.forward
        heading = np.arctan2(nose @ self.start.left, nose @ self.start.forward)
        return wrapped(heading - told)

    def _clearance(self, running: np.ndarray) -> np.ndarray:
        if self.bar is None:
            return np.full(len(running), np.inf)
        bar = self.starts.bar[running]
        return self.bar.of(self.geom_xpos[running], self.geom_xmat[running], bar)

    def _height(self, running: np.ndarray) -> np.ndarray:
        return self.solid.lowest(self.geom_xpos[running], self.geom_xmat[running])

    def _sane(self, running: np.ndarray) -> np.ndarray:
        return (np.abs(self.qvel[running]) < BLOWN_UP).all(1)

    def _down(self, running: np.ndarray) -> np.ndarray:
        """Negated comparisons, so that a simulation that is NaN counts as down."""
        trunk = self.creature.trunk
        up = self.xmat[running, trunk].reshape(-1, 3, 3)[:, 2] @ self.creature.frame.up
        x, y, z = self.xpos[running, trunk].T
        above = z - self.terrain.height(x, y) if self.terrain else z
        height = above / self.creature.frame.stand_height
        fine = (
            self._sane(running)
            & (up > self.fall.min_up)
            & (height > self.fall.height[0])
            & (height < self.fall.height[1])
        )
        if self.fall.touch:
            fine &= self.forbidden.lowest(self.geom_xpos[running], self.geom_xmat[running]) > 0
        return ~fine


def wrapped(angle: np.ndarray) -> np.ndarray:
    """The same directions in rad from -pi to pi."""
    turned: np.ndarray = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    return turned
