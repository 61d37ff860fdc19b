"""Episodes whose lanes refill with different bodies, against episodes with one body."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config
from many_bodies import SLIM, stacked

from mjxgait.config.traced import traced
from mjxgait.controllers.key_poses.controller import Genome
from mjxgait.creature import Creature
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.variation import Box, uniform
from mjxgait.simulation.episode import Lane
from mjxgait.simulation.rollout import Simulator
from mjxgait.tasks.walk.stats import WalkStats
from mjxgait.training.experiment import build_experiment

BODIES = (1.0, 0.6, 1.7)
"""Factors on the masses."""


@dataclasses.dataclass(frozen=True, eq=False)
class BodyPerStart(Simulator):
    """A simulator with one body per start. numbers: body parameters, leaves [R, ...]."""

    numbers: Any = None

    def _fresh_lane(
        self, plans: Any, starts: Any, settings: Any, own: Any, place: jax.Array, episode: jax.Array
    ) -> Lane:
        lane = super()._fresh_lane(plans, starts, settings, own, place, episode)
        own = jax.tree.map(lambda leaf: leaf[episode % len(BODIES)], self.numbers)
        return dataclasses.replace(lane, body=dataclasses.replace(lane.body, parameters=own))


pytestmark = pytest.mark.thorough(
    "tests/training/test_evolve_body.py and tests/tasks/modular/test_swimming.py compare episodes of "
    "bodies that differ with C MuJoCo, and test_bodies.py compares their steps"
)


@pytest.fixture(scope="module", params=["auto", "mjx"])
def statistics(
    request: pytest.FixtureRequest, stool: Creature
) -> tuple[WalkStats, list[WalkStats]]:
    """Statistics of three starts with three bodies together, and of all starts with each body."""
    settings = {"physics": request.param, "lanes": 2, "starts": len(BODIES), "terminate": False}
    experiment = build_experiment(stool, small_config(rollout=settings))
    simulator, plant = experiment.simulator, experiment.simulator.plant
    with_mass_scale = jax.jit(plant.with_mass_scale)
    numbers = jax.device_get([with_mass_scale(plant.parameters, factor) for factor in BODIES])
    box = Box(*simulator.controller.bounds(experiment.config.controller))
    arguments = jax.tree.map(
        lambda leaf: leaf[None],
        (
            uniform(key_of(0), box, 3),
            experiment.row.starts,
            traced(experiment.config),
        ),
    )

    def mixed(numbers: Any, genomes: Genome, *rest: Any) -> WalkStats:
        fields = {f.name: getattr(simulator, f.name) for f in dataclasses.fields(Simulator)}
        return BodyPerStart(**fields, numbers=numbers).simulate(genomes, *rest).stats

    def one(numbers: Any, genomes: Genome, *rest: Any) -> WalkStats:
        own = dataclasses.replace(simulator, plant=plant.with_parameters(numbers))
        return own.simulate(genomes, *rest).stats

    def run(function: Any, *numbers: Any) -> list[WalkStats]:
        numbers = jax.tree.map(jnp.float32, numbers)
        lowered = jax.jit(function).lower(numbers[0], *arguments)
        program = lowered.compile(compiler_options=SLIM)
        return [jax.device_get(program(each, *arguments)) for each in numbers]

    same = [stacked([each] * len(BODIES)) for each in numbers]
    together, *alone = run(mixed, stacked(numbers), *same)
    # Another program of lane-major physics would take long to compile.
    return together, run(one, *numbers) if request.param == "mjx" else alone


def test_every_episode_keeps_its_own_body(statistics: tuple[WalkStats, list[WalkStats]]):
    together, alone = statistics
    for start, theirs in enumerate(alone):
        ours = together.forward[0, :, start]
        np.testing.assert_allclose(ours, theirs.forward[0, :, start], atol=1e-4)


def test_different_bodies_walk_differently(statistics: tuple[WalkStats, list[WalkStats]]):
    _, (own, light, heavy) = statistics
    for other in (light, heavy):
        assert np.abs(own.forward - other.forward).max() > 1e-3
