"""Simulator specification of a run, chosen by its creature; that of a model, and evolved sizes."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
from typing_extensions import override

from mjxgait.config.schema import Config
from mjxgait.controllers.base import Bodied, BodiedController, Controller
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends, given_body, given_ends
from mjxgait.creature.proportions import Proportions, extreme_bodies, proportions
from mjxgait.creature.settings import Termination
from mjxgait.errors import UserError
from mjxgait.physics import make_plant
from mjxgait.plugins import make_controller, make_task
from mjxgait.plugins.fit import check_fit
from mjxgait.plugins.registry import what_ends
from mjxgait.simulation.rollout import Simulator
from mjxgait.tasks.starts import Starts
from mjxgait.training.grown_spec import GrownSpec
from mjxgait.training.simulator import BodyParams, Growth, SimulatorSpec, assembled
from mjxgait.types import ModelPlant


@dataclasses.dataclass(frozen=True, eq=False)
class SizeGrowth(Growth[ModelPlant, Bodied]):
    """Body parameters from evolved sizes, and a start with its height above ground kept."""

    proportions: Proportions

    @override
    def body(self, plant: ModelPlant, genome: Bodied, start: Starts) -> Starts:
        known = self.proportions
        # The trunk has index -1, where the factor is 1.
        factors = jnp.exp(jnp.append(genome.sizes, 0.0))[known.size_of]
        one = plant.parameters
        if start.mass_scale is not None:
            one = plant.with_mass_scale(one, start.mass_scale)
        rises = known.upwards.astype(np.float32)
        qpos = start.qpos + self._lift(factors) * rises
        return dataclasses.replace(
            start, qpos=qpos, parameters=plant.with_length_scale(one, factors)
        )

    def _lift(self, factors: jax.Array) -> jax.Array:
        """Return the rise [] of the trunk in m with these factors [B]."""
        reach, fixed = (
            x.astype(np.float32) for x in (self.proportions.reach, self.proportions.fixed)
        )
        return jnp.min(fixed + reach.sum(1)) - jnp.min(fixed + jnp.sum(reach * factors, axis=1))


def growth_of(creature: Creature, config: Config) -> SizeGrowth | None:
    """Return the growth of a creature whose sizes evolve; None if they do not.

    Raises:
      UserError: the smallest or the largest body is impossible.
    """
    if not extreme_bodies(creature, config.evolution.body):
        return None
    return SizeGrowth(proportions(creature))


@dataclasses.dataclass(frozen=True, eq=False)
class ModelSpec:
    """Specification from a creature and settings. plant, lanes: see `make_plant`.

    growth: computes an individual's body if bodies evolve.
    """

    creature: Creature
    config: Config
    plant: ModelPlant
    lanes: int
    growth: SizeGrowth | None = None

    @property
    def numbers(self) -> BodyParams | None:
        """Body parameters to pass to the program; None if the body is constant in it."""
        if self.config.rollout.body == "constants":
            return None
        ends = what_ends(self.creature, self.config.rollout)
        single = jax.tree.map(lambda x: np.asarray(x, np.float32), self.plant.parameters)
        return BodyParams(given_body(self.creature), given_ends(ends), single)

    @property
    def small(self) -> None:
        """See `SimulatorSpec`."""
        return None

    @functools.cached_property
    def own(self) -> Simulator:
        """The simulator with constant body parameters, for the host's own queries."""
        return self.simulator()

    def embodied(self, starts: Starts) -> Starts:
        """Return the starts with the body parameters that their mass scales give."""
        if starts.mass_scale is None:
            return starts
        one, with_mass_scale = self.plant.parameters, self.plant.with_mass_scale
        every = jax.vmap(lambda factors: with_mass_scale(one, factors))
        return dataclasses.replace(starts, parameters=every(starts.mass_scale))

    def simulator(self, numbers: BodyParams | None = None) -> Simulator:
        """Return the simulator of the creature, or of the body with these parameters."""
        if numbers is None:
            ends = what_ends(self.creature, self.config.rollout)
            return self._simulator(self.creature, ends, self.plant)
        return self._simulator(
            numbers.body, numbers.ends, self.plant.with_parameters(numbers.plant)
        )

    def _simulator(self, body: Body, ends: Termination | Ends, plant: ModelPlant) -> Simulator:
        step = float(self.creature.model.opt.timestep)
        controller = make_controller(body, step, self.config)
        if self.growth is not None:
            sizes = len(self.growth.proportions.names)
            controller = BodiedController(controller, sizes, self.config.evolution.body)
        task = make_task(body, step, ends, self.config)
        growth, rollout = self.growth, self.config.rollout
        return assembled(body, step, plant, controller, task, rollout, self.lanes, growth)


def make_spec(creature: Creature, config: Config) -> SimulatorSpec:
    """Return the simulator specification of a run.

    Raises:
      UserError: the physics does not support the creature's model, or the controller or task does
        not fit.
    """
    check_fit(creature, config)
    grows = creature.settings.creature.grows
    spec = GrownSpec(creature, config) if grows else _of_model(creature, config)
    if config.evolution.search == "es":
        _check_strategy(spec, config)
    return spec


def _check_strategy(spec: SimulatorSpec, config: Config) -> None:
    """Refuse an evolution strategy for genomes that are no bounded reals.

    Raises:
      UserError: names the controller.
    """
    controller: Controller = spec.own.controller
    if controller.variation(config.controller, config.evolution).box is None:
        raise UserError(
            'evolution.search = "es" is for genomes of bounded reals, and those of the controller '
            f"{config.use.controller} are of another kind; take --search ga"
        )


def check_spec(creature: Creature, config: Config) -> None:
    """Refuse settings that give no program. Compiles and writes nothing.

    Raises:
      UserError: see `make_spec`; or the controller reads an observation that the body does not
        have.
    """
    make_spec(creature, config).simulator()


def _of_model(creature: Creature, config: Config) -> ModelSpec:
    creature = creature.spanned(config.evolution.pose_span)
    touch = what_ends(creature, config.rollout).touch
    inputs = config.rollout.body == "inputs"
    plant, lanes = make_plant(creature, config.rollout.physics, touch, padded=inputs)
    return ModelSpec(creature, config, plant, lanes, growth_of(creature, config))
