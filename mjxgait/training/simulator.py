"""What specifies the simulator of a run, and its assembly from the parts."""

from functools import partial
from typing import Protocol, TypeVar

import jax
import numpy as np
from jax.sharding import Mesh

from mjxgait.config.schema import RolloutConfig
from mjxgait.controllers.base import Controller
from mjxgait.controllers.observations import check_observations
from mjxgait.controllers.spd import Drive
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends, GivenBody
from mjxgait.simulation.rollout import AXIS, Simulator
from mjxgait.simulation.small import SmallBodies
from mjxgait.tasks.base import Task
from mjxgait.tasks.starts import Starts
from mjxgait.types import Plant, pytree

PlantOf_contra = TypeVar("PlantOf_contra", contravariant=True)
Genome_contra = TypeVar("Genome_contra", contravariant=True)


class Growth(Protocol[PlantOf_contra, Genome_contra]):
    """Computation of the simulated body from a genome."""

    def body(self, plant: PlantOf_contra, genome: Genome_contra, start: Starts) -> Starts:
        """Return the start [] with the genome's own body."""
        ...


@pytree
class BodyParams:
    """All body parameters that the program reads. plant: see `ModelPlant.parameters`."""

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

    @property
    def small(self) -> SmallBodies | None:
        """What simulates small bodies; None if one program simulates all."""
        ...

    def embodied(self, starts: Starts) -> Starts:
        """Return the starts with the body parameters that follow from them."""
        ...

    def simulator(self, numbers: BodyParams | None = None) -> Simulator:
        """Return the simulator of the creature, or of the body with these parameters."""
        ...


def assembled(
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
        grow=None if growth is None else partial(growth.body, plant),
    )
