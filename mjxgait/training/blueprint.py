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
from mjxgait.controllers.observations import check_senses
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
        """See `Growth`. Parts without a hinge are not bent; on land bodies rest on the ground."""
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
        if start.heaviness is not None:
            one = plant.heavier(one, start.heaviness)
        rises = known.upwards.astype(np.float32)
        qpos = start.qpos + self._lift(factors) * rises
        return dataclasses.replace(start, qpos=qpos, numbers=plant.resized(one, factors))

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
class Numbers:
    """All body parameters that the program reads. plant: see `Plant.parameters`."""

    body: GivenBody
    ends: Ends
    plant: object


class Plan(Protocol):
    """Specification of a simulator on the host, before its program is traced."""

    @property
    def creature(self) -> Creature:
        """The creature with the settings that shape its program."""
        ...

    @property
    def numbers(self) -> Numbers | None:
        """Body parameters to pass to the program; None if the body is constant in it or grows."""
        ...

    @property
    def own(self) -> Simulator:
        """The simulator with constant body parameters, for the host's own queries."""
        ...

    def embodied(self, starts: Starts) -> Starts:
        """Return the starts with the body parameters that follow from them."""
        ...

    def simulator(self, numbers: Numbers | None = None) -> Simulator:
        """Return the simulator of the creature, or of the body with these parameters."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class Blueprint:
    """Specification from a creature and settings. plant, lanes: see `make_plant`.

    growth: computes an individual's body if bodies evolve.
    """

    creature: Creature
    config: Config
    plant: ModelPlant
    lanes: int
    growth: SizeGrowth | None = None

    @property
    def numbers(self) -> Numbers | None:
        """Body parameters to pass to the program; None if the body is constant in it."""
        if self.config.rollout.body == "constants":
            return None
        ends = what_ends(self.creature, self.config.rollout)
        single = jax.tree.map(lambda x: np.asarray(x, np.float32), self.plant.parameters)
        return Numbers(given_body(self.creature), given_ends(ends), single)

    @functools.cached_property
    def own(self) -> Simulator:
        """The simulator with constant body parameters, for the host's own queries."""
        return self.simulator()

    def embodied(self, starts: Starts) -> Starts:
        """Return the starts with the body parameters that their mass scales give."""
        if starts.heaviness is None:
            return starts
        one, heavier = self.plant.parameters, self.plant.heavier
        every = jax.vmap(lambda factors: heavier(one, factors))
        return dataclasses.replace(starts, numbers=every(starts.heaviness))

    def simulator(self, numbers: Numbers | None = None) -> Simulator:
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
class GrownBlueprint:
    """See `Plan`; every genome grows its own body. creature: gives settings and time step only."""

    creature: Creature
    config: Config

    @property
    def numbers(self) -> None:
        """See `Plan`."""
        return None

    @functools.cached_property
    def own(self) -> Simulator:
        """See `Plan`."""
        return self.simulator()

    def embodied(self, starts: Starts) -> Starts:
        """See `Plan`."""
        return starts

    def simulator(self, numbers: Numbers | None = None) -> Simulator:
        """See `Plan`."""
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
    check_senses(controller.reads, task.adds)
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


def draw_up(creature: Creature, config: Config) -> Plan:
    """Return the simulator specification of a run.

    Raises:
      UserError: the physics does not support the creature's model, or the controller or task does
        not fit.
    """
    check_fit(creature, config)
    if creature.settings.creature.grows:
        return GrownBlueprint(creature, config)
    return _of_model(creature, config)


def check_plan(creature: Creature, config: Config) -> None:
    """Refuse settings that give no program. Compiles and writes nothing.

    Raises:
      UserError: see `draw_up`; or the controller reads an observation that the body does not have.
    """
    draw_up(creature, config).simulator()


def _of_model(creature: Creature, config: Config) -> Blueprint:
    creature = creature.spanned(config.evolution.pose_span)
    touch = what_ends(creature, config.rollout).touch
    inputs = config.rollout.body == "inputs"
    plant, lanes = make_plant(creature, config.rollout.physics, touch, roomy=inputs)
    return Blueprint(creature, config, plant, lanes, growth_of(creature, config))
