"""Skills on command: one body and one brain that swim, walk, jump and follow a light.

Each trial commands one skill, and is in its medium. The task of that skill scores it, in units of
what its certificate requires.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from typing_extensions import override

from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends
from mjxgait.creature.settings import Termination
from mjxgait.kinds import in_water
from mjxgait.physics.batched_trees.tree import Medium
from mjxgait.tasks.base import EpisodeStats
from mjxgait.tasks.modular.base import ModularTask
from mjxgait.tasks.modular.config import SkillsConfig
from mjxgait.tasks.modular.follow import Following, FollowInWater, Light
from mjxgait.tasks.modular.jump import Jump
from mjxgait.tasks.modular.roam import Roam
from mjxgait.tasks.modular.swim import Swim
from mjxgait.tasks.starts import NEVER, Starts
from mjxgait.types import Sensed, pytree

LATE = 1_000_000
"""A generation in which every weight counts in full."""


@pytree
class Commanded:
    """Goal of a trial. skill: [] number of the commanded one. light: None if none follows one."""

    skill: jax.Array
    light: Light | None


@pytree
class SkillsStats(EpisodeStats):
    """Extension of `EpisodeStats`.

    skill: [] number of the commanded one. since: [] steps that do not count. each: statistics by
    the task of each skill; only those of the commanded one mean anything.
    """

    skill: jax.Array
    since: jax.Array
    each: tuple[Any, ...]


class Skills(ModularTask):
    """Implementation of `Task`. tasks: of the skills, by name, in the order of the effectors."""

    Settings: ClassVar[type] = SkillsConfig
    tasks: ClassVar[Mapping[str, type[ModularTask]]]
    outcomes: ClassVar[tuple[str, ...]] = ("way", "height", "seconds", "since")

    def __init__(self, creature: Body, step: float, horizon: int, ends: Termination | Ends) -> None:
        super().__init__(creature, step, horizon, ends)
        self.each = tuple(task(creature, step, horizon, ends) for task in self.tasks.values())

    @property
    @override
    def terms(self) -> tuple[str, ...]:
        return tuple(self.tasks)

    @override
    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """The skills take turns; the first trial of each is undisturbed, in every round."""
        rounds, count = settings.variety, len(self.each)
        others = (settings.starts - 1) // rounds
        own = (1 + others) // count
        drawn = dataclasses.replace(settings, starts=1 + (own - 1) * rounds)
        each = [
            task.trials(jax.random.fold_in(key, 10 + skill), creature, drawn)
            for skill, task in enumerate(self.each)
        ]
        each = [_lit(own) for own in each] if self._follower else each
        turn = np.arange(settings.starts - 1)
        trial, number = np.append(0, 1 + turn % others), np.append(0, turn // others)
        skill, again = trial % count, trial // count
        place = np.where(again == 0, 0, number * (own - 1) + again)
        chosen: Starts = jax.tree.map(lambda *leaves: jnp.stack(leaves)[skill, place], *each)
        wet = np.array([in_water(name) for name in self.tasks])
        mixed = wet.any() and not wet.all()
        ground = Medium(jnp.asarray(np.float32(wet[skill]))) if mixed else None
        goal = Commanded(jnp.asarray(skill, jnp.int32), chosen.goal)
        return dataclasses.replace(chosen, goal=goal, ground=ground)

    def goal(self, trial: Starts) -> Commanded:
        """The skill, and the light at its places in the world."""
        commanded: Commanded = trial.goal
        task, light = self._follower, commanded.light
        if task is not None:
            light = task.goal(dataclasses.replace(trial, goal=light))
        return Commanded(jnp.asarray(commanded.skill), light)

    @override
    def next_goal(self, goal: Commanded, sensed: Sensed) -> Commanded:
        task = self._follower
        if task is None or goal.light is None:
            return goal
        return dataclasses.replace(goal, light=task.next_goal(goal.light, sensed))

    @override
    def params(self, settings: SkillsConfig) -> Any:
        """Of the tasks, by skill."""
        each = zip(self.tasks, self.each, strict=True)
        return tuple(task.params(getattr(settings, name)) for name, task in each)

    @override
    def observations(self, goal: Commanded, sensed: Sensed) -> Mapping[str, jax.Array]:
        """The skill, and the light's direction if the skill follows it."""
        seen = {"skill": goal.skill}
        if (task := self._follower) is not None and goal.light is not None:
            light = task.observations(goal.light, sensed)["light"]
            seen["light"] = jnp.where(goal.skill == self.each.index(task), light, 0.0)
        return seen

    @override
    def init(self) -> SkillsStats:
        none = jnp.zeros((), jnp.int32)
        each = tuple(task.init() for task in self.each)
        return SkillsStats(none, none, jnp.zeros(()), skill=none, since=none, each=each)

    @override
    def update(
        self, stats: SkillsStats, sensed: Sensed, torque: jax.Array, params: Any, goal: Commanded
    ) -> SkillsStats:
        """Update the statistics of all tasks; the commanded one may end the episode."""
        each = tuple(
            task.update(one, sensed, torque, own, goal.light if task is self._follower else ())
            for task, one, own in zip(self.each, stats.each, params, strict=True)
        )
        return dataclasses.replace(
            stats,
            steps=stats.steps + 1,
            reason=_of(goal.skill, [one.reason for one in each]),
            skill=goal.skill,
            since=_of(goal.skill, params),
            each=each,
        )

    def evaluate(self, stats: SkillsStats, settings: SkillsConfig) -> Mapping[str, jax.Array]:
        """Score of the commanded skill; 0 for the others.

        By the logarithm the mean ranks as the geometric mean of the performances: doubling the
        worst skill counts as much as doubling the best, within `least` and `most`.
        """
        found = {}
        for skill, (name, one) in enumerate(zip(self.tasks, self._ended(stats), strict=True)):
            task, own = self.each[skill], getattr(settings, name)
            terms, weights = task.evaluate(one, own), task.weights(own, jnp.int32(LATE))
            earned = jnp.sum(jnp.stack([weights[term] * terms[term] for term in task.terms]))
            share = earned / getattr(settings.required, name)
            share = jnp.clip(share, settings.least, settings.most)
            score = 1 - jnp.log(share) / jnp.log(settings.least)
            found[name] = jnp.where(stats.skill == skill, score, 0.0)
        return found

    @override
    def outcome(self, stats: SkillsStats) -> Mapping[str, jax.Array]:
        """Distance and height in m, duration and uncounted time in s."""
        ways, heights = [], []
        for task, one in zip(self.each, self._ended(stats), strict=True):
            known = task.outcome(one)
            ways.append(known.get("way", jnp.zeros(())))
            heights.append(known.get("height", jnp.zeros(())))
        return {
            "way": _of(stats.skill, ways),
            "height": _of(stats.skill, heights),
            "seconds": stats.steps * self.step,
            "since": stats.since * self.step,
        }

    @override
    def weights(self, settings: SkillsConfig, generation: jax.Array) -> Mapping[str, jax.Array]:
        """Equal for all skills."""
        return {name: jnp.ones(()) for name in self.tasks}

    @property
    def _follower(self) -> Following | None:
        return next((task for task in self.each if isinstance(task, Following)), None)

    def _ended(self, stats: SkillsStats) -> list[EpisodeStats]:
        """Return the statistics of the tasks at the end of the episode, which all share."""
        return [
            dataclasses.replace(
                one,
                steps=stats.steps,
                reason=stats.reason,
                overlap=jnp.maximum(one.overlap, stats.overlap),
            )
            for one in stats.each
        ]


class Amphibian(Skills):
    """Implementation of `Task`: swim and walk."""

    tasks: ClassVar[Mapping[str, type[ModularTask]]] = {"swim": Swim, "roam": Roam}
    adds: ClassVar[tuple[str, ...]] = ("skill",)


class AllTrades(Skills):
    """Implementation of `Task`: swim, walk, jump, and follow a light in water."""

    tasks: ClassVar[Mapping[str, type[ModularTask]]] = {
        "swim": Swim,
        "roam": Roam,
        "jump": Jump,
        "follow": FollowInWater,
    }
    adds: ClassVar[tuple[str, ...]] = ("skill", "light")


def _of(skill: jax.Array, values: Any) -> jax.Array:
    """Return the value [] of a skill [], of one for each."""
    found: jax.Array = values[0]
    for number, value in enumerate(values[1:], start=1):
        found = jnp.where(skill == number, value, found)
    return found


def _lit(starts: Starts) -> Starts:
    """Return trials with lights: dark ones where the task has none."""
    if starts.goal is not None:
        return starts
    count = len(starts.friction)
    nowhere = jnp.asarray(np.zeros((count, 3), np.float32))
    return dataclasses.replace(
        starts, goal=Light(nowhere, nowhere, jnp.asarray(np.full(count, NEVER, np.int32)))
    )
