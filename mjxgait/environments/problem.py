"""The problem that an environment poses: trials, observations, actions, reward, end of an episode.

Pure functions in JAX for one creature, whatever simulates it: `functional.py` in the physics of
evolution, `gym.py` in C MuJoCo. The episode is that of `simulation.episode`, so the return of an
episode is the task's fitness.
"""

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.schema import Config
from mjxgait.config.traced import traced
from mjxgait.controllers.observations import check_observations, sense
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.plugins.fit import check_fit
from mjxgait.plugins.registry import task_of
from mjxgait.simulation.episode import deepened, is_going, reason_of
from mjxgait.simulation.rollout import CHECK_EVERY
from mjxgait.tasks.base import EpisodeStats, Task, in_order
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.starts import Starts
from mjxgait.types import Sensed, choose, pytree

OBSERVED = (
    "joint_pos",
    "joint_vel",
    "trunk_height",
    "pitch",
    "roll",
    "pitch_rate",
    "roll_rate",
    "nose_vel",
    "up_vel",
    "heading",
    "aside",
    "contact",
)
"""Default observations, before those that the task adds; docs/reference/controller.md has units."""
AXES: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "nose_vel": (("ahead", "left"),),
    "foot_place": ((), ("ahead", "left")),
    "trunk_rot": (("x", "y", "z"), ("0", "1", "2")),
} | dict.fromkeys(("trunk_pos", "trunk_vel", "trunk_angvel"), (("x", "y", "z"),))
"""Names along the axes of observations that are no numbers; an empty tuple counts the feet."""
Array = TypeVar("Array", jax.Array, np.ndarray)
NO_OVERLAP = -np.inf
"""Overlap of parts in m at a step that does not look for any."""


@pytree
class Progress:
    """State of an episode besides the body.

    stats, goal: the task's. fitness: [] of the episode if it ended now; 0 before the first step.
    """

    stats: EpisodeStats
    goal: Any
    fitness: jax.Array


@pytree
class Verdict:
    """What an agent gets after a step.

    obs: [O]. reward: []. reason: [] why the episode ended, a `tasks.falls.Reason`. done: [] 1 after
    its end. time_out: [] 1 if it ended because its time was up. metrics: [] each, by name.
    """

    obs: jax.Array
    reward: jax.Array
    reason: jax.Array
    done: jax.Array
    time_out: jax.Array
    metrics: dict[str, jax.Array]


@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """One creature and one task.

    creature: with the pose ranges and on the ground of the settings. observe: names of the
    observations. perturbed: whether trials are disturbed (`[rollout]`) or nominal.
    """

    creature: Creature
    config: Config
    task: Task
    observe: tuple[str, ...]
    perturbed: bool

    @property
    def step(self) -> float:
        """Time in s from one action to the next: a control step."""
        return float(self.creature.model.opt.timestep)

    @property
    def horizon(self) -> int:
        """Control steps T of a full episode."""
        return max(round(self.config.rollout.seconds / self.step), 1)

    @cached_property
    def settings(self) -> Config:
        """The settings as the program of a run reads them."""
        with jax.ensure_compile_time_eval():  # the first use may be inside a traced function
            return traced(self.config)

    @cached_property
    def ranges(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest target [J] in rad: the joint's range, or its pose range if endless."""
        joints = self.creature.joints
        low = np.where(np.isfinite(joints.low), joints.low, joints.pose_low)
        high = np.where(np.isfinite(joints.high), joints.high, joints.pose_high)
        return low.astype(np.float32), high.astype(np.float32)

    def targets(self, action: Array) -> Array:
        """Return the target joint angles [J] in rad of an action [J]; beyond -1 and 1 it is cut.

        In JAX or NumPy, as the action is.
        """
        low, high = self.ranges
        return low + 0.5 * (action.clip(-1.0, 1.0) + 1.0) * (high - low)

    def action(self, targets: jax.Array) -> jax.Array:
        """Return the action [J] of target joint angles [J] in rad."""
        low, high = self.ranges
        return 2.0 * (targets - low) / (high - low) - 1.0

    def trial(self, key: jax.Array) -> Starts:
        """Draw the start and the disturbances of one episode, as hard as trials become."""
        rollout = dataclasses.replace(self.config.rollout, starts=2)
        fitness = self.settings.fitness
        trials = self.task.trials(key, self.creature, rollout)
        if self.task.has_curriculum:
            level = jnp.asarray(self.task.levels(fitness))
            trials = self.task.at_level(trials, fitness, level)
        return jax.tree.map(lambda leaf: leaf[int(self.perturbed)], trials)

    def begin(self, trial: Starts, sensed: Sensed) -> Progress:
        """Return the progress before the first step; a fallen start has ended already."""
        stats, goal = self.task.init(), self.task.goal(trial)
        reason = reason_of(self.task, sensed, goal)
        return Progress(dataclasses.replace(stats, reason=reason), goal, jnp.zeros(()))

    def after(
        self, before: Progress, sensed: Sensed, torque: jax.Array, then: Sensed, overlap: jax.Array
    ) -> Progress:
        """Return the progress after a step; that of an ended episode stays.

        sensed, then: before and after the step. torque: [J] N·m. overlap: [] m after the step;
        `NO_OVERLAP` unless `looks`.
        """
        given = (before.stats, sensed, torque, self.task.params(self.settings.fitness))
        updated = self.task.update(*given, before.goal)
        stats = choose(is_going(before.stats, self.horizon), updated, before.stats)
        stats = deepened(stats, overlap, self.horizon)
        goal = self.task.next_goal(before.goal, sensed)
        now = reason_of(self.task, then, goal)
        reason = jnp.where(is_going(stats, self.horizon), now, stats.reason)
        stats = dataclasses.replace(stats, reason=reason)
        return Progress(stats, goal, self._fitness(self._terms(stats)))

    def looks(self, before: Progress) -> jax.Array:
        """Return whether [] parts are looked at for overlap after the next step."""
        return (before.stats.steps + 1) % CHECK_EVERY == 0

    def verdict(self, before: Progress, after: Progress, sensed: Sensed) -> Verdict:
        """Return what the agent gets after a step that led to this progress and this state.

        The reward is the change of the fitness, so rewards add up to the fitness of the episode.
        """
        stats, terms = after.stats, self._terms(after.stats)
        fell = stats.reason != Reason.FINISHED
        late = ~fell & (stats.steps >= self.horizon)
        named = {f"term_{name}": jnp.float32(value) for name, value in terms.items()}
        named |= {
            f"outcome_{name}": jnp.float32(value)
            for name, value in self.task.outcome(stats).items()
        }
        return Verdict(
            obs=self.observation(after, sensed),
            reward=after.fitness - before.fitness,
            reason=stats.reason,
            done=jnp.float32(fell | late),
            time_out=jnp.float32(late),
            metrics={"fitness": after.fitness} | named,
        )

    def observation(self, now: Progress, sensed: Sensed) -> jax.Array:
        """Return the observation [O]; zeros in place of numbers that are not finite."""
        seen = self._seen(now, sensed)
        flat = jnp.concatenate([jnp.float32(seen[name]).reshape(-1) for name in self.observe])
        return jnp.where(jnp.isfinite(flat), flat, 0.0)

    @cached_property
    def entries(self) -> tuple[str, ...]:
        """Name of each entry of an observation, O of them."""
        shapes = jax.eval_shape(self._seen, *self._blank())
        return tuple(
            label for name in self.observe for label in self._labels(name, shapes[name].shape)
        )

    def _seen(self, now: Progress, sensed: Sensed) -> dict[str, jax.Array]:
        seen = sense(self.creature, sensed, now.stats.steps * self.step, self.observe)
        return seen | dict(self.task.observations(now.goal, sensed))

    def _labels(self, name: str, shape: tuple[int, ...]) -> list[str]:
        """Return the name of each number of an observation."""
        feet, joints = self.creature.feet.names, self.creature.joints.names
        usual = (joints,) if name.startswith("joint_") else (feet,)
        axes = [one or feet for one in AXES.get(name, usual)]
        if tuple(map(len, axes)) != shape:
            axes = [tuple(map(str, range(size))) for size in shape]
        places = np.ndindex(shape)
        return [" ".join([name, *(a[i] for a, i in zip(axes, at, strict=True))]) for at in places]

    def _blank(self) -> tuple[Progress, Sensed]:
        """Return a progress and a state of the right shapes."""
        creature = self.creature
        joints, three = jnp.zeros(len(creature.joints.names)), jnp.zeros(3)
        geoms = len(creature.feet.watched)
        sensed = Sensed(
            joint_pos=joints,
            joint_vel=joints,
            bias=jnp.zeros(creature.nv),
            trunk_pos=three,
            trunk_rot=jnp.zeros((3, 3)),
            trunk_vel=three,
            trunk_angvel=three,
            geom_pos=jnp.zeros((geoms, 3)),
            geom_low=jnp.zeros(geoms),
            floor=None if creature.terrain.flat else jnp.zeros(()),
        )
        trial = jax.eval_shape(lambda: self.trial(jax.random.key(0)))
        return jax.eval_shape(self.begin, trial, sensed), sensed

    def _terms(self, stats: EpisodeStats) -> Mapping[str, jax.Array]:
        terms = self.task.evaluate(stats, self.settings.fitness)
        return {name: terms[name] for name in self.task.terms}

    def _fitness(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """Return the fitness [] of one trial, by the weights of the last generation of a run."""
        last = jnp.int32(self.config.evolution.generations)
        weights = self.task.weights(self.settings.fitness, last)
        names = self.task.terms
        return jnp.sum(in_order(terms, names) * in_order(weights, names))


def make_problem(
    creature: Creature, config: Config, observe: tuple[str, ...] = (), perturbed: bool = True
) -> Problem:
    """Return the problem of a creature under settings.

    observe: names of observations; none stands for `OBSERVED` and those that the task adds.

    Raises:
      UserError: the body grows with each genome, the task does not fit it, or an observation is
        unknown.
    """
    if creature.settings.creature.grows:
        raise UserError(
            f"{creature.name}: its body grows from each genome, and an environment has one body; "
            "take a creature that has one, such as tall_quadruped"
        )
    check_fit(creature, config)
    body = creature.spanned(config.evolution.pose_span).on(config.rollout.ground)
    task = task_of(body, config)
    names = observe or (*OBSERVED, *task.adds)
    check_observations(names, task.adds)
    return Problem(body, config, task, names, perturbed)
