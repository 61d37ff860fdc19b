"""Simulations on C MuJoCo, under the champion's reference controller.

Letters: `S` simulations, `R` recorded ones (the first of the `S`), `T` control steps, `J` actuated
joints, `nq nv` as in MuJoCo.
"""

import copy
from collections.abc import Callable
from typing import Protocol

import mujoco
import numpy as np

from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.bar import Clearance
from mjxgait.reference.bodies import Bodies, wrapped
from mjxgait.reference.contest import Opponent
from mjxgait.reference.controllers import ReferenceController, opponent_of, reference_of
from mjxgait.reference.outcome import (
    Fall,
    Outcome,
    blank_film,
    blank_outcome,
)
from mjxgait.reference.starts import Starts
from mjxgait.reference.state import Drive, State, sense
from mjxgait.reference.terrain import grounded_model

EVERY = 10
"""Control steps between two checks for simulations that can no longer succeed."""


def examined_model(creature: Creature) -> mujoco.MjModel:
    """Return the creature's model on its ground, with a converged contact solver."""
    model = copy.copy(grounded_model(creature))
    model.opt.iterations, model.opt.ls_iterations = 100, 50
    model.opt.tolerance = 1e-8
    # MuJoCo must not silently reset a simulation that blows up.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    # MuJoCo puts the centre of mass of a part without mass twice as far out as the part.
    model.body_ipos[model.body_mass == 0] = 0.0
    return model


class TaskRules(Protocol):
    """Properties of the task that a simulation needs; see `acceptance.AcceptanceCriteria`."""

    drag: float
    grown: bool
    leaps: bool

    def next_goal(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """See `acceptance.AcceptanceCriteria`."""
        ...


class ReferenceSimulation:
    """Simulations; the first `record` of them are recorded."""

    def __init__(
        self,
        creature: Creature,
        champion: Champion,
        starts: Starts,
        record: int,
        fall: Fall,
        task: TaskRules,
        reference: ReferenceController | None = None,
        threads: int = 1,
    ) -> None:
        self.creature, self.starts, self.fall = creature, starts, fall
        self.record, self.goal, self.task = record, starts.goal.copy(), task
        step = float(creature.model.opt.timestep)
        self.reference = reference or reference_of(creature, champion, step)
        self.drive = Drive(creature, champion.drive, self.reference.command, step)
        model = examined_model(creature)
        self.bodies = Bodies(creature, model, starts, self.reference.reads, task.drag, threads)
        self.memory = dict(self.reference.init(len(starts)))
        self.opponent: Opponent | None = None
        if self.bodies.contest is not None:
            theirs = opponent_of(creature, champion, step)
            self.opponent = Opponent(self.bodies.contest, theirs, len(starts))
        self.command = np.zeros_like(starts.stiffness)
        self.bar = Clearance(creature) if np.isfinite(starts.bar).any() else None
        self.finest = int(starts.refine.max())
        self.push_step = np.floor(starts.push_time / step)
        # The latest torques, for simulations with a delay.
        self.sent = np.zeros((int(starts.delay.max()) + 1, *starts.stiffness.shape))

    def to_the_end(
        self,
        steps: int,
        heading: np.ndarray | None,
        tell: Callable[[Outcome, int], bool] | None = None,
    ) -> Outcome:
        """Run to the end; a fallen simulation stops unless it is recorded.

        heading: [S, T] rad, commanded; None without commands. tell: called every `EVERY` steps with
        the outcome so far and the number of steps; returns whether all may end.
        """
        count, time_step = len(self.starts), self.creature.model.opt.timestep
        film = blank_film(self.creature, time_step, self.record, steps)
        commanded = heading is not None
        needed = {"middle": self.task.grown, "low": self.task.leaps, "gaps": bool(self.opponent)}
        kept = {name for name, is_needed in needed.items() if is_needed}
        seen = blank_outcome(count, steps, film, commanded=commanded, kept=kept)
        seen.travel[:] = self.bodies.travel(np.arange(count))
        leader, waiting = self._alike(heading)
        running = np.setdiff1d(np.arange(count), waiting)
        for k in range(steps):
            if not len(running):
                break
            if tell is not None and k % EVERY == 0 and tell(seen, k):
                break
            released = waiting[self.push_step[waiting] == k]
            if len(released) and np.isinf(seen.fell[leader]):
                self._follow(released, leader)
                seen.copy(leader, released)
                running, waiting = np.union1d(running, released), np.setdiff1d(waiting, released)
            pushed = running[self.push_step[running] == k]
            if len(pushed):
                self.bodies.push(pushed)
            wanted = None if heading is None else heading[running, k]
            self._control_step(running, k, wanted, seen)
            down = self._watch(seen, running, k, wanted)
            watched = (k + 1) * time_step < self.starts.end[running]
            if down.any() or not watched.all():
                running = running[
                    watched
                    & self.bodies.sane(running)
                    & ((running < self.record) | np.isinf(seen.fell[running]))
                ]
        seen.copy(leader, waiting)
        return seen

    def _watch(
        self, seen: Outcome, running: np.ndarray, k: int, commanded: np.ndarray | None
    ) -> np.ndarray:
        """Record the results of a control step; return which of the running [running] are down."""
        bodies, now = self.bodies, (k + 1) * self.creature.model.opt.timestep
        seen.travel[running] = bodies.travel(running)
        seen.path[running, k], seen.aside[running, k] = seen.travel[running, :2].T
        if commanded is not None:
            seen.astray[running, k] = bodies.astray(running, commanded)
        if self.bar is not None:
            clear = self.bar.of(
                bodies.geom_xpos[running], bodies.geom_xmat[running], self.starts.bar[running]
            )
            seen.clearance[running] = np.minimum(seen.clearance[running], clear)
        if self.task.grown:
            seen.middle[running, k] = bodies.middle(running)
        if self.task.leaps:
            seen.low[running, k] = bodies.height(running)
        if self.opponent is not None:
            seen.gaps[running, k] = bodies.gaps(running)
        down = bodies.down(running, self.fall)
        seen.fell[running[down]] = np.minimum(seen.fell[running[down]], now)
        return down

    def _alike(self, heading: np.ndarray | None) -> tuple[int, np.ndarray]:
        """Return one of the simulations that are identical until pushed, and those it represents.

        ReferenceSimulation only this one until then saves a quarter of all steps.
        """
        starts, alike = self.starts, np.flatnonzero(self.starts.undisturbed)
        lights = starts.light, starts.moved_light, starts.light_time
        aims = np.column_stack([starts.goal, starts.bar, *lights])
        if heading is not None and np.ptp(heading, axis=0).any():
            alike = alike[:0]
        if not len(alike):
            return 0, alike
        alike = alike[(aims[alike] == aims[alike[0]]).all(1)]
        leader = int(alike[starts.push_time[alike].argmax()])
        return leader, alike[(alike != leader) & (alike >= self.record)]

    def _follow(self, rows: np.ndarray, leader: int) -> None:
        """Copy the state of one simulation to others."""
        self.bodies.follow(rows, leader)
        theirs = self.opponent.states if self.opponent else ()
        for state in (self.goal, self.command, *self.memory.values(), *theirs):
            state[rows] = state[leader]
        self.sent[:, rows] = self.sent[:, [leader]]

    def _control_step(
        self, running: np.ndarray, k: int, heading: np.ndarray | None, seen: Outcome
    ) -> None:
        kept, film = running[running < self.record], seen.trajectory
        if len(kept):
            film.qpos[kept, k], film.qvel[kept, k] = self.bodies.qpos[kept], self.bodies.qvel[kept]
            film.phase[kept, k] = self.reference.phase({n: m[kept] for n, m in self.memory.items()})
        command, torque = self._physics_step(running, k, heading, seen.travel[running, 0])
        if len(kept):
            film.torque[kept, k] = torque[: len(kept)]
            if self.reference.command == "pose":
                film.target[kept, k] = command[: len(kept)]
        for taken in range(1, self.finest):
            self.bodies.step(running[self.starts.refine[running] > taken])

    def _physics_step(
        self, running: np.ndarray, k: int, heading: np.ndarray | None, way: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the command and the torque that acts, [running, J] each.

        way: [running] m forward so far.
        """
        state, starts = self.bodies.state(running, k, self.goal[running]), self.starts
        if k % self.reference.every == 0:
            self.command[running] = self._act(running, state, heading)
        command = self.command[running]
        first = self.starts.goal[running]
        self.goal[running] = self.task.next_goal(self.goal[running], first, way)
        self.sent[k % len(self.sent), running] = self.drive.torque(
            command, state, starts.stiffness[running], starts.damping[running]
        )
        # During the initial delay the first torque acts, as if the body had been held with it.
        arrived = np.maximum(k - starts.delay[running], 0) % len(self.sent)
        torque = self.sent[arrived, running]
        self.bodies.applied[running[:, None], self.creature.joints.dof_adr] = torque
        self._oppose(running, k)
        self.bodies.step(running)
        self.bodies.last_force[running] = self.bodies.constraint[running]
        return command, torque

    def _oppose(self, running: np.ndarray, k: int) -> None:
        """Apply the opponent's torques, if there is one."""
        if self.opponent is None:
            return
        bodies = self.bodies
        state = bodies.qpos[running], bodies.geom_xpos[running], bodies.geom_xmat[running]
        torque = self.opponent.torque(running, k, *state)
        bodies.applied[running[:, None], self.opponent.dofs] = torque

    def _act(self, running: np.ndarray, state: State, heading: np.ndarray | None) -> np.ndarray:
        """Return the command [running, J] and advance the reference controller's memory."""
        senses = sense(self.creature, state, self.reference.reads)
        if heading is not None:
            # With a commanded heading there is no line to return to.
            senses["heading"] = wrapped(senses["heading"] - heading)
            senses["aside"] = np.zeros_like(senses["aside"])
        before = {name: values[running] for name, values in self.memory.items()}
        command, after = self.reference.act(before, senses)
        for name, values in after.items():
            self.memory[name][running] = values
        return command
