"""A functional environment in JAX: pure `reset` and `step` in the physics of evolution.

The state follows brax and MuJoCo Playground. Nothing is jitted here: the caller jits what contains
the steps. The functions are for one episode; `jax.vmap` makes its episodes the lanes of the
physics, which is what these are fast at.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, Self

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap

from mjxgait.controllers.spd import Drive, Rules, per_lane
from mjxgait.environments.problem import NO_OVERLAP, Problem, Progress, Verdict
from mjxgait.physics import make_plant
from mjxgait.physics.lane_major.lanes import separate_kernels
from mjxgait.plugins.registry import what_ends
from mjxgait.simulation.episode import Late, arriving, first_body, pushed
from mjxgait.tasks.starts import Starts
from mjxgait.types import BodyState, ModelPlant, Sensed, pytree


@pytree
class Data:
    """What an environment keeps of an episode from one step to the next.

    step_data: the plant's, of the same moment as `sensed`. rules: the drive's. push: [nv] added to
    the velocity at step push_step []. late: None where torques are never delayed.
    """

    body: BodyState
    sensed: Sensed
    step_data: Any
    rules: Rules
    push: jax.Array
    push_step: jax.Array
    progress: Progress
    late: Late | None = None


@pytree
class State:
    """State of an episode.

    obs: [O]. reward: [] of the latest step. done: [] 1 once the episode has ended, else 0. metrics:
    [] each; `fitness` of the episode so far, its terms and outcomes. info: `reason` [] of the end
    (`tasks.falls.Reason`, 0 for none), `time_out` [] 1 if time was up; other entries are kept.
    """

    data: Data
    obs: jax.Array
    reward: jax.Array
    done: jax.Array
    metrics: dict[str, jax.Array]
    info: dict[str, Any]

    def replace(self, **changes: Any) -> Self:
        """Return the state with other fields."""
        return dataclasses.replace(self, **changes)


@dataclasses.dataclass(frozen=True, eq=False)
class Environment:
    """Environment of one creature and one task; see `mjxgait.environment`."""

    problem: Problem
    plant: ModelPlant

    @property
    def dt(self) -> float:
        """Time in s from one action to the next."""
        return self.problem.step

    @property
    def horizon(self) -> int:
        """Steps T of a full episode."""
        return self.problem.horizon

    @property
    def action_size(self) -> int:
        """Numbers of an action: the actuated joints J."""
        return len(self.problem.creature.joints.names)

    @property
    def observation_size(self) -> int:
        """Numbers O of an observation."""
        return len(self.entries)

    @property
    def entries(self) -> tuple[str, ...]:
        """Name of each entry of an observation."""
        return self.problem.entries

    def targets(self, action: jax.Array) -> jax.Array:
        """Return the target joint angles [J] in rad of an action [J] in -1 to 1."""
        return self.problem.targets(action)

    def action(self, targets: jax.Array) -> jax.Array:
        """Return the action [J] of target joint angles [J] in rad."""
        return self.problem.action(targets)

    def reset(self, key: jax.Array) -> State:
        """Return the state at the start of an episode, drawn with a key []."""
        return self.begin(self.problem.trial(key))

    def begin(self, trial: Starts) -> State:
        """Return the state at the start of a given trial []."""
        return _first(*on_lanes(self._begun, self.plant.lane_axis)(self._numbered(trial)))

    def step(self, state: State, action: jax.Array) -> State:
        """Return the state one control step later, under an action [J] in -1 to 1.

        An episode that has ended stays as it is, with reward 0, though its body moves on.
        """
        stepped = on_lanes(self._stepped, self.plant.lane_axis)
        return _next(state, *stepped(state.data, jnp.asarray(action, jnp.float32)))

    def reset_lanes(self, keys: jax.Array) -> State:
        """Return the states at the start of episodes, with keys [B] and B at `plant.lane_axis`.

        This and `step_lanes` compute what `jax.vmap` of `reset` and `step` does, faster: nothing is
        moved to and fro between steps, and on a CPU a step is one kernel.
        """
        return self.begin_lanes(jax.vmap(self.problem.trial)(keys))

    def begin_lanes(self, trials: Starts) -> State:
        """Return the states at the start of given trials [B], with B at `plant.lane_axis`."""
        numbered = jax.vmap(self._numbered, out_axes=self.plant.lane_axis)(trials)
        return _first(*self._begun(numbered))

    def step_lanes(self, states: State, actions: jax.Array) -> State:
        """Return the states one control step later; B is at `plant.lane_axis` of every leaf."""
        return _next(states, *self._stepped(states.data, jnp.asarray(actions, jnp.float32)))

    @property
    def _drive(self) -> Drive:
        return Drive(self.problem.creature, self.problem.step, "pose")

    def _numbered(self, trial: Starts) -> Starts:
        """Return the trial with the body parameters that follow from its mass scales."""
        if trial.mass_scale is None:
            return trial
        heavier = self.plant.with_mass_scale(self.plant.parameters, trial.mass_scale)
        return dataclasses.replace(trial, parameters=heavier)

    def _begun(self, trial: Starts) -> tuple[Data, Verdict]:
        """Begin the episodes of all lanes."""
        problem, lanes = self.problem, self._per_lane
        body = lanes(pushed)(first_body(trial), trial.push, trial.push_step == 0)
        sensed, step_data = self.plant.forward(body)
        progress = lanes(problem.begin)(trial, sensed)
        late = None
        if trial.delay is not None:
            sent = jnp.zeros((problem.config.rollout.latency, self.action_size))
            late = lanes(lambda delay: Late(delay, sent))(trial.delay)
        rules = lanes(lambda k, d: self._drive.rules(problem.settings.drive, k, d))(
            trial.stiffness, trial.damping
        )
        data = Data(body, sensed, step_data, rules, trial.push, trial.push_step, progress, late)
        return data, lanes(problem.verdict)(progress, progress, sensed)

    def _stepped(self, data: Data, action: jax.Array) -> tuple[Data, Verdict]:
        """Advance the episodes of all lanes by one control step."""
        problem, plant, lanes, before = self.problem, self.plant, self._per_lane, data.progress
        target = lanes(problem.targets)(action)
        torque = self._drive.torque(
            plant, data.rules, data.body, data.sensed, data.step_data, target
        )
        late = data.late
        if late is not None:
            torque, late = lanes(arriving)(late, before.stats.steps, torque)
        body = plant.advance(data.body, data.step_data, lanes(self._drive.lift)(torque))
        body = lanes(pushed)(body, data.push, before.stats.steps + 1 == data.push_step)
        sensed, step_data = plant.forward(body)
        overlap = self._overlap(body, lanes(problem.looks)(before))
        progress = lanes(problem.after)(before, data.sensed, torque, sensed, overlap)
        verdict = lanes(problem.verdict)(before, progress, sensed)
        after = dataclasses.replace(
            data, body=body, sensed=sensed, step_data=step_data, progress=progress, late=late
        )
        return after, verdict

    def _overlap(self, body: BodyState, due: jax.Array) -> jax.Array:
        """Return the overlap of parts in m in the lanes that are looked at.

        Nothing is computed while none is, as in most steps of lanes that began together.
        """
        none = jnp.full_like(body.friction, NO_OVERLAP)
        found = jax.lax.cond(jnp.any(due), self.plant.overlap, lambda _: none, body)
        return jnp.where(due, found, NO_OVERLAP)

    def _per_lane(self, function: Callable[..., Any]) -> Callable[..., Any]:
        return per_lane(self.plant, function)


def _first(data: Data, verdict: Verdict) -> State:
    info = {"reason": verdict.reason, "time_out": verdict.time_out}
    return State(data, verdict.obs, verdict.reward, verdict.done, verdict.metrics, info)


def _next(before: State, data: Data, verdict: Verdict) -> State:
    info = {**before.info, "reason": verdict.reason, "time_out": verdict.time_out}
    metrics = {**before.metrics, **verdict.metrics}
    return State(data, verdict.obs, verdict.reward, verdict.done, metrics, info)


def on_lanes(function: Callable[..., Any], axis: int) -> Callable[..., Any]:
    """Return the function of one episode for a function of lanes.

    `jax.vmap` of it adds lanes, where it would otherwise put an axis around them. function: from
    pytrees to pytrees with the lanes at `axis` of every leaf.
    """

    def whole(*given: Any) -> Any:
        inwards = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, axis), given)
        return jax.tree.map(lambda leaf: jnp.moveaxis(leaf, axis, 0), function(*inwards))

    @custom_vmap
    def of_one(*given: Any) -> Any:
        lanes = jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], given)
        with separate_kernels():
            return jax.tree.map(lambda leaf: leaf[0], whole(*lanes))

    @of_one.def_vmap
    def of_many(size: int, batched: Any, *given: Any) -> Any:
        def broadcast(leaf: jax.Array, has: bool) -> jax.Array:
            return leaf if has else jnp.broadcast_to(leaf, (size, *jnp.shape(leaf)))

        found = whole(*jax.tree.map(broadcast, given, tuple(batched)))
        return found, jax.tree.map(lambda _: True, found)

    return of_one


def make_environment(problem: Problem) -> Environment:
    """Return the functional environment of a problem.

    Raises:
      UserError: the physics does not support the creature's model.
    """
    rollout = problem.config.rollout
    touch = what_ends(problem.creature, rollout).touch
    plant, _ = make_plant(problem.creature, rollout.physics, touch)
    return Environment(problem, plant)
