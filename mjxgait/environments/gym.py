"""A Gymnasium environment over C MuJoCo, the reference simulator.

It compiles no physics, steps one body fast, and is the simulator that certificates come from: what
was learned in JAX can be tried here in another one. Only the task's sums and the observation are
JAX, one small compiled function per problem.
"""

import dataclasses
import functools
from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium import spaces

from mjxgait.creature import Creature
from mjxgait.environments.problem import NO_OVERLAP, Problem, Progress
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.reference.bodies import VELOCITY_STAGE, Bodies
from mjxgait.reference.overlap import PartOverlap
from mjxgait.reference.starts import Starts as ReferenceStarts
from mjxgait.reference.starts import nominal_starts
from mjxgait.reference.state import Drive
from mjxgait.reference.stepping import examined_model
from mjxgait.simulation.rollout import CHECK_EVERY
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.starts import Starts
from mjxgait.types import Sensed

ONE = np.zeros(1, dtype=int)
"""Row of the only simulation."""


@dataclasses.dataclass(frozen=True, eq=False)
class Compiled:
    """Functions of a problem, compiled once for all its environments."""

    problem: Problem
    part_overlap: PartOverlap

    @functools.cached_property
    def trial(self) -> Any:
        """See `Problem.trial`."""
        return jax.jit(self.problem.trial)

    @functools.cached_property
    def begin(self) -> Any:
        """From trial and state to the progress and the observation."""

        def begun(trial: Starts, sensed: Sensed) -> tuple[Progress, jax.Array]:
            progress = self.problem.begin(trial, sensed)
            return progress, self.problem.observation(progress, sensed)

        return jax.jit(begun)

    @functools.cached_property
    def after(self) -> Any:
        """See `Problem.after`, with the verdict."""

        def stepped(before: Progress, *given: Any) -> Any:
            progress = self.problem.after(before, *given)
            return progress, self.problem.verdict(before, progress, given[2])

        return jax.jit(stepped)


def compiled(problem: Problem) -> Compiled:
    """Return the functions of a problem; they are compiled at their first call."""
    return Compiled(problem, PartOverlap(problem.creature))


class Simulation:
    """One episode in C MuJoCo: its body, its drive and its push."""

    def __init__(self, problem: Problem, trial: Starts) -> None:
        creature = self.creature = problem.creature
        self.starts, self.step_count = reference_starts(creature, trial), 0
        self.push_step = int(trial.push_step)
        self.bodies = Bodies(creature, examined_model(creature), self.starts, (), 0.0)
        # The examiner raises bodies out of the floor at their start; evolution does not.
        self.bodies.qpos[0], self.bodies.qvel[0] = trial.qpos, trial.qvel
        self.bodies.batch.forward(stage=VELOCITY_STAGE)
        self.drive = Drive(creature, problem.config.drive, "pose", problem.step)
        self.sent = np.zeros((int(self.starts.delay[0]) + 1, len(creature.joints.names)))
        self._push()

    @property
    def sensed(self) -> Sensed:
        """The present state, as the compiled functions read it."""
        bodies, creature = self.bodies, self.creature
        state = bodies.state(ONE, self.step_count, np.zeros(1))
        places, turns = bodies.geom_xpos[ONE], bodies.geom_xmat[ONE]
        low = [feet.heights(places, turns)[0] for feet in (bodies.feet, bodies.forbidden)]
        lowest: Any = np.concatenate(low)
        seen = Sensed(
            joint_pos=state.joint_pos[0],
            joint_vel=state.velocity[0, creature.joints.dof_adr],
            bias=state.bias[0],
            trunk_pos=state.trunk_pos[0],
            trunk_rot=state.trunk_rot[0],
            trunk_vel=state.trunk_vel[0],
            trunk_angvel=state.trunk_angvel[0],
            geom_pos=places[0, creature.feet.watched],
            geom_low=lowest,
        )
        sane = bool(bodies.sane(ONE)[0])
        single: Sensed = jax.tree.map(lambda x: np.float32(x if sane else np.nan * x), seen)
        return single

    def step(self, target: np.ndarray) -> np.ndarray:
        """Advance by one control step towards a target [J] in rad; return the torque [J] in N·m."""
        starts, bodies, k = self.starts, self.bodies, self.step_count
        state = bodies.state(ONE, k, np.zeros(1))
        given = (target[None], state, starts.stiffness, starts.damping)
        self.sent[k % len(self.sent)] = self.drive.torque(*given)[0]
        torque = self.sent[max(k - int(starts.delay[0]), 0) % len(self.sent)]
        bodies.applied[0, self.creature.joints.dof_adr] = torque
        bodies.step(ONE)
        bodies.last_force[ONE] = bodies.constraint[ONE]
        self.step_count += 1
        self._push()
        return torque.copy()

    def _push(self) -> None:
        if self.step_count == self.push_step:
            self.bodies.push(ONE)


def reference_starts(creature: Creature, trial: Starts) -> ReferenceStarts:
    """Return a trial's disturbances as the reference simulator takes them, a single row."""
    root = creature.root_dof
    mass = np.ones(creature.model.nbody)
    if trial.mass_scale is not None:
        mass[1:] = trial.mass_scale
    delay = 0 if trial.delay is None else int(trial.delay)
    return dataclasses.replace(
        nominal_starts(creature, 1),
        friction=np.asarray(trial.friction)[None],
        mass=mass[None],
        stiffness=np.asarray(trial.stiffness)[None],
        damping=np.asarray(trial.damping)[None],
        delay=np.array([delay]),
        push=np.asarray(trial.push)[None, root : root + 2],
    )


class CreatureEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """One creature and one task; see docs/guide/research-tools.md.

    Observations, actions, reward and end are those of `mjxgait.environment`.
    """

    def __init__(self, functions: Compiled) -> None:
        problem = functions.problem
        if problem.config.rollout.uneven or not problem.creature.terrain.flat:
            raise UserError(
                f"{problem.creature.name}: its Gymnasium environment has a flat floor; take "
                "mjxgait.environment for other ground"
            )
        self.problem, self._functions = problem, functions
        self.metadata = {"render_modes": [], "render_fps": round(1 / problem.step)}
        joints = len(problem.creature.joints.names)
        self.action_space = spaces.Box(-1.0, 1.0, (joints,), np.float32)
        self.observation_space = spaces.Box(-np.inf, np.inf, (len(problem.entries),), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; see `gymnasium.Env`."""
        super().reset(seed=seed)
        key = key_of(int(self.np_random.integers(2**31)))
        return self.begin(jax.device_get(self._functions.trial(key))), {}

    def begin(self, trial: Starts) -> np.ndarray:
        """Begin the episode of a given trial [], in NumPy; return the observation."""
        self._simulation = Simulation(self.problem, trial)
        self._sensed = self._simulation.sensed
        self._progress, obs = self._functions.begin(trial, self._sensed)
        return np.asarray(obs)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Advance by one control step; see `gymnasium.Env`.

        The last info of an episode has its metrics, and `reason`, a `tasks.falls.Reason`.
        """
        target = self.problem.targets(np.asarray(action))
        simulation, before = self._simulation, self._sensed
        torque = np.float32(simulation.step(np.asarray(target, np.float64)))
        overlap = NO_OVERLAP
        if simulation.step_count % CHECK_EVERY == 0:
            overlap = self._functions.part_overlap.deepest(simulation.bodies.qpos[0])
        self._sensed = simulation.sensed
        given = (self._progress, before, torque, self._sensed, np.float32(overlap))
        self._progress, verdict = self._functions.after(*given)
        reason = int(verdict.reason)
        info: dict[str, Any] = {}
        if verdict.done:
            info = {name: float(value) for name, value in verdict.metrics.items()}
            info["reason"] = reason
        over = reason != Reason.FINISHED, bool(verdict.time_out)
        return np.asarray(verdict.obs), float(verdict.reward), *over, info
