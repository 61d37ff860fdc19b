"""Simulator specification of bodies that grow from genomes (Sims)."""

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.config.schema import Config
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.controller import OPPONENT, Brains, capacity_of
from mjxgait.controllers.sims_brain.genotype import Capacity, Graph
from mjxgait.controllers.sims_brain.growth import grown
from mjxgait.controllers.sims_brain.operators import Genotype
from mjxgait.controllers.sims_brain.opponent import acting, arena_of
from mjxgait.controllers.sims_brain.phenotype import anatomy, body_of
from mjxgait.controllers.sims_brain.reference_body import (
    CONTACT_TIME_CONSTANT,
    DRAG,
    FRICTION,
    GRAVITY,
)
from mjxgait.creature import Creature
from mjxgait.kinds import in_water, skills_of
from mjxgait.physics.batched_trees.arena import ArenaPlant
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.physics.batched_trees.tree import Medium, Surroundings
from mjxgait.plugins import make_controller, make_task
from mjxgait.plugins.registry import what_ends
from mjxgait.simulation.rollout import Simulator
from mjxgait.simulation.small import SmallBodies
from mjxgait.tasks.starts import Starts
from mjxgait.training.simulator import BodyParams, Growth, assembled

LANES = 64
"""Simulations of modular bodies per device."""


@dataclasses.dataclass(frozen=True)
class GraphGrowth(Growth[TreePlant, Genotype]):
    """Modular bodies from graphs."""

    capacity: Capacity

    def body(self, plant: TreePlant, genome: Genotype, start: Starts) -> Starts:
        """Parts without a hinge are not bent; on land bodies rest on the ground."""
        tree = plant.prepared(body_of(genome.graph, self.capacity).tree)
        bent = start.qpos[7:] * tree.moves[1:]
        qpos = jnp.concatenate([start.qpos[:7], bent])
        medium: Medium | None = start.ground
        rested = plant.rested(tree, qpos)
        qpos = rested if medium is None else jnp.where(medium.wet > 0, qpos, rested)
        return dataclasses.replace(start, qpos=qpos, parameters=tree)


@dataclasses.dataclass(frozen=True)
class ArenaGrowth(Growth[ArenaPlant, Genotype]):
    """Modular bodies from graphs, each with its opponent."""

    controller: Brains

    def body(self, plant: ArenaPlant, genome: Genotype, start: Starts) -> Starts:
        """Return the start with the body, its opponent and the cube."""
        tree, qpos, arena = arena_of(plant.one, self.controller, genome, start.qpos)
        return dataclasses.replace(start, qpos=qpos, parameters=tree, ground=arena)


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

    @functools.cached_property
    def small(self) -> SmallBodies | None:
        """See `SimulatorSpec`."""
        settings: Any = self.config.controller
        if not 0 < settings.small < settings.links:
            return None
        parts = min(settings.parts, settings.small)
        less = dataclasses.replace(settings, parts=parts, links=settings.small)
        config = dataclasses.replace(self.config, controller=less)
        return SmallBodies(self._with_room(config), functools.partial(_fits, settings))

    def embodied(self, starts: Starts) -> Starts:
        """See `SimulatorSpec`."""
        return starts

    def simulator(self, numbers: BodyParams | None = None) -> Simulator:
        """See `SimulatorSpec`."""
        return self._with_room(self.config)

    def _with_room(self, config: Config) -> Simulator:
        """Return the simulator of bodies for which a config has room."""
        step = float(self.creature.model.opt.timestep)
        settings: Any = config.controller
        capacity = capacity_of(settings)
        body = anatomy(capacity.links)
        ends = what_ends(self.creature, config.rollout)
        controller = make_controller(body, step, config)
        task = make_task(body, step, ends, config)
        media = {in_water(task) for task in skills_of(config.use.task) or (config.use.task,)}
        around = Surroundings(
            step=step,
            friction=FRICTION,
            contact=CONTACT_TIME_CONSTANT * step,
            floor=False in media,
            gravity=GRAVITY if False in media else 0.0,
            drag=DRAG if True in media else 0.0,
            lit="light" in task.adds,
            collide=settings.collide,
            touch=settings.touch,
        )
        plant, growth = TreePlant(around), GraphGrowth(capacity)
        given = (controller, task, config.rollout, LANES)
        if OPPONENT not in task.adds:
            return assembled(body, step, plant, *given, growth)
        assert isinstance(controller, Brains)
        arena = ArenaPlant(plant, acting(controller, body), controller.every)
        return assembled(body, step, arena, *given, ArenaGrowth(controller))


def _fits(settings: BrainConfig, genome: Genotype) -> jax.Array:
    """Return whether [] a body, and its opponent's, have few enough links for a smaller program."""

    def fits(graph: Graph) -> jax.Array:
        return jnp.max(grown(graph, capacity_of(settings)).last) < settings.small

    theirs = genome.opponent
    return fits(genome.graph) if theirs is None else fits(genome.graph) & fits(theirs.graph)
