"""What the simulator of a run is made of, and the body's numbers where they are inputs of the program."""

import dataclasses
import functools
from functools import partial
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh

from mjxgait.body import Body, Ends, GivenBody, given_body, given_ends
from mjxgait.control.bodied import BodiedController
from mjxgait.control.drive import Drive
from mjxgait.creature import Creature
from mjxgait.creature.settings import Termination
from mjxgait.parts import make_controller, make_task
from mjxgait.parts.registry import what_ends
from mjxgait.physics import make_plant
from mjxgait.runs.growth import Growth, growth_of
from mjxgait.senses import check_senses
from mjxgait.settings.config import Config
from mjxgait.simulation.rollout import AXIS, Simulator
from mjxgait.tasks.trials import Starts
from mjxgait.types import Plant, pytree


@pytree
class Numbers:
    """All of a body that the program reads. plant: as `Plant.parameters` has them."""

    body: GivenBody
    ends: Ends
    plant: Any


@dataclasses.dataclass(frozen=True, eq=False)
class Blueprint:
    """A creature under the settings that shape its program. plant, lanes: see `make_plant`.

    growth: of the body, where it evolves.
    """

    creature: Creature
    config: Config
    plant: Plant
    lanes: int
    growth: Growth | None = None

    @property
    def numbers(self) -> Numbers | None:
        """What to hand to the program; None where the body is a constant of it."""
        if self.config.rollout.body == "constants":
            return None
        ends = what_ends(self.creature, self.config.rollout)
        single = jax.tree.map(lambda x: np.asarray(x, np.float32), self.plant.parameters)
        return Numbers(given_body(self.creature), given_ends(ends), single)

    @functools.cached_property
    def own(self) -> Simulator:
        """With the creature's numbers as constants: what the host asks about the program."""
        return self.simulator()

    def embodied(self, starts: Starts) -> Starts:
        """The starts with the bodies that their heaviness makes."""
        if starts.heaviness is None:
            return starts
        one, heavier = self.plant.parameters, self.plant.heavier
        numbers = jax.vmap(lambda factors: heavier(one, factors))(starts.heaviness)
        return dataclasses.replace(starts, numbers=numbers)

    def simulator(self, numbers: Numbers | None = None) -> Simulator:
        """Of the creature itself, or of whatever body has these numbers."""
        if numbers is None:
            ends = what_ends(self.creature, self.config.rollout)
            return self._simulator(self.creature, ends, self.plant)
        return self._simulator(
            numbers.body, numbers.ends, self.plant.with_parameters(numbers.plant)
        )

    def _simulator(self, body: Body, ends: Termination | Ends, plant: Plant) -> Simulator:
        step = float(self.creature.model.opt.timestep)
        controller = make_controller(body, step, self.config)
        if self.growth is not None:
            sizes = len(self.growth.proportions.names)
            controller = BodiedController(controller, sizes, self.config.evolution.body)
        task = make_task(body, step, ends, self.config)
        check_senses(controller.reads, task.adds)
        return Simulator(
            creature=body,
            plant=plant,
            controller=controller,
            drive=Drive(body, step, controller.command),
            task=task,
            steps=max(round(self.config.rollout.seconds / step), 1),
            lanes=self.config.rollout.lanes or self.lanes,
            mesh=Mesh(np.array(jax.devices()), (AXIS,)),
            bodies=None if self.growth is None else partial(self.growth.body, plant),
        )


def draw_up(creature: Creature, config: Config) -> Blueprint:
    """The blueprint of a run.

    Raises:
      UserError: the physics does not support the creature's model.
    """
    creature = creature.spanned(config.evolution.pose_span)
    touch = what_ends(creature, config.rollout).touch
    inputs = config.rollout.body == "inputs"
    plant, lanes = make_plant(creature, config.rollout.physics, touch, roomy=inputs)
    return Blueprint(creature, config, plant, lanes, growth_of(creature, config))
