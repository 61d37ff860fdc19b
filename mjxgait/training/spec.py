"""Simulator specification of a run, and the body parameters that are inputs of the program."""

import dataclasses
import functools
from functools import partial
from typing import Any, Protocol, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh
from typing_extensions import override

from mjxgait.config.schema import Config, RolloutConfig
from mjxgait.controllers.base import Bodied, BodiedController, Controller
from mjxgait.controllers.observations import check_observations
from mjxgait.controllers.sims_brain.controller import capacity_of
from mjxgait.controllers.sims_brain.genotype import Capacity
from mjxgait.controllers.sims_brain.operators import Genotype
from mjxgait.controllers.sims_brain.phenotype import anatomy, body_of
from mjxgait.controllers.sims_brain.reference_body import DRAG, FRICTION, GRAVITY, HARDEST
from mjxgait.controllers.spd import Drive
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends, GivenBody, given_body, given_ends
from mjxgait.creature.proportions import Proportions, extreme_bodies, proportions
from mjxgait.creature.settings import Termination
from mjxgait.errors import UserError
from mjxgait.kinds import in_water
from mjxgait.physics import make_plant
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.physics.batched_trees.tree import Surroundings
from mjxgait.plugins import make_controller, make_task
from mjxgait.plugins.fit import check_fit
from mjxgait.plugins.registry import what_ends
from mjxgait.simulation.rollout import AXIS, Simulator
from mjxgait.tasks.base import Task
from mjxgait.tasks.starts import Starts
from mjxgait.types import ModelPlant, Plant, pytree

PlantOf_contra = TypeVar("PlantOf_contra", contravariant=True)
Genome_contra = TypeVar("Genome_contra", contravariant=True)


class Growth(Protocol[PlantOf_contra, Genome_contra]):
    """Computation of the simulated body from a genome."""

    def body(self, plant: PlantOf_contra, genome: Genome_contra, start: Starts) -> Starts:
        """Return the start [] with the genome's own body."""
        ...


@dataclasses.dataclass(frozen=True)
class GraphGrowth(Growth[TreePlant, Genotype]):
    """Modular bodies from graphs."""

    capacity: Capacity

    def body(self, plant: TreePlant, genome: Genotype, start: Starts) -> Starts:
        """Parts without a hinge are not bent; on land bodies rest on the ground."""
        tree = body_of(genome.graph, self.capacity).tree
        bent = start.qpos[7:] * tree.moves[1:]
        qpos = plant.rested(tree, jnp.concatenate([start.qpos[:7], bent]))
        return dataclasses.replace(start, qpos=qpos, numbers=tree)


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
        return dataclasses.replace(start, qpos=qpos, numbers=plant.with_length_scale(one, factors))

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


LANES = 64
"""Simulations of modular bodies per device."""


@pytree
class BodyParams:
    """All body parameters that the program reads. plant: see `Plant.parameters`."""

    body: GivenBody
    ends: Ends
    plant: object


class SimulatorSpec(Protocol):
    """Specification of a simulator on the host, before its program is traced."""

    @property
    def creature(self) -> Creature:
        """The creature with the settings that shape its program."""
        ...

    @property
    def numbers(self) -> BodyParams | None:
        """Body parameters to pass to the program; None if the body is constant in it or grows."""
        ...

    @property
    def own(self) -> Simulator:
        """The simulator with constant body parameters, for the host's own queries."""
        ...

    def embodied(self, starts: Starts) -> Starts:
        """Return the starts with the body parameters that follow from them."""
        ...

    def simulator(self, numbers: BodyParams | None = None) -> Simulator:
        """Return the simulator of the creature, or of the body with these parameters."""
        ...


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
        return dataclasses.replace(starts, numbers=every(starts.mass_scale))

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
        return _assembled(body, step, plant, controller, task, rollout, self.lanes, growth)


@dataclasses.dataclass(frozen=True, eq=False)
class GrownSpec:
    """Implementation of `SimulatorSpec`.

    Every genome grows its own body. creature: gives settings and time step only.
    """

    creature: Creature
    config: Config

    @property
    def numbers(self) -> None:
        """See `SimulatorSpec`."""
        return None

    @functools.cached_property
    def own(self) -> Simulator:
        """See `SimulatorSpec`."""
        return self.simulator()

    def embodied(self, starts: Starts) -> Starts:
        """See `SimulatorSpec`."""
        return starts

    def simulator(self, numbers: BodyParams | None = None) -> Simulator:
        """See `SimulatorSpec`."""
        config, step = self.config, float(self.creature.model.opt.timestep)
        settings: Any = config.controller
        capacity = capacity_of(settings)
        body = anatomy(capacity.links)
        ends = what_ends(self.creature, config.rollout)
        controller = make_controller(body, step, config)
        task = make_task(body, step, ends, config)
        wet = in_water(config.use.task)
        around = Surroundings(
            step=step,
            friction=FRICTION,
            contact=HARDEST * step,
            floor=not wet,
            gravity=0.0 if wet else GRAVITY,
            drag=DRAG if wet else 0.0,
            lit="light" in task.adds,
        )
        plant, growth = TreePlant(around), GraphGrowth(capacity)
        return _assembled(body, step, plant, controller, task, config.rollout, LANES, growth)


def _assembled(
    body: Body,
    step: float,
    plant: Plant,
    controller: Controller,
    task: Task,
    rollout: RolloutConfig,
    lanes: int,
    growth: Growth | None,
) -> Simulator:
    """Assemble a simulator. lanes: used if the settings do not say.

    Raises:
      UserError: the controller reads an observation that the body does not have.
    """
    check_observations(controller.reads, task.adds)
    return Simulator(
        creature=body,
        plant=plant,
        controller=controller,
        drive=Drive(body, step, controller.command),
        task=task,
        steps=max(round(rollout.seconds / step), 1),
        lanes=rollout.lanes or lanes,
        mesh=Mesh(np.array(jax.devices()), (AXIS,)),
        bodies=None if growth is None else partial(growth.body, plant),
    )


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
      UserError: see `make_spec`; or the controller reads an observation that the body does not have.
    """
    make_spec(creature, config).simulator()


def _of_model(creature: Creature, config: Config) -> ModelSpec:
    creature = creature.spanned(config.evolution.pose_span)
    touch = what_ends(creature, config.rollout).touch
    inputs = config.rollout.body == "inputs"
    plant, lanes = make_plant(creature, config.rollout.physics, touch, padded=inputs)
    return ModelSpec(creature, config, plant, lanes, growth_of(creature, config))
