"""Controller protocol, a base class for genomes of bounded reals, and genomes with body sizes."""

import abc
import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Protocol, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.tables import NoSettings
from mjxgait.creature.body import Body
from mjxgait.evolution.variation import (
    Box,
    Variation,
    creation,
    in_ranges,
    jittered,
    narrowed,
    real_variation,
    uniform_crossover,
)
from mjxgait.types import pytree

Senses = Mapping[str, jax.Array]
"""Observations of one control step, by name (`observations.py`, and those that a task adds)."""

Command = Literal["pose", "torque"]
"""Type of command: target joint angles [J] in rad for the drive, or torques [J] in N·m."""


Settings_contra = TypeVar("Settings_contra", contravariant=True)
Genome = TypeVar("Genome")
Plan = TypeVar("Plan")
Memory = TypeVar("Memory")


class Controller(Protocol[Settings_contra, Genome, Plan, Memory]):
    """Controller of one creature: from a genome and observations to a command per control step.

    Every method is for one creature; the rollout maps it over its lanes. `prepare` and `init`
    return pytrees that the controller defines.
    """

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the observations that `act` reads."""
        ...

    @property
    def command(self) -> Command:
        """Type of command that `act` returns."""
        ...

    @property
    def every(self) -> int:
        """Control steps per command, one of `controllers.config.HOLDS`; in between it is held."""
        ...

    def variation(self, settings: Settings_contra, evolution: EvolutionConfig) -> Variation[Genome]:
        """Return the genetic operators of its genomes, under settings plain or traced."""
        ...

    def genes(self, genomes: Genome, settings: Settings_contra) -> np.ndarray:
        """Return genomes [N, ...] as rows [N, genes], in gene ranges, to measure diversity."""
        ...

    def genome_statistics(self, genomes: Genome) -> Mapping[str, np.ndarray]:
        """Return statistics [N] of genomes [N, ...] by name, to follow over the generations."""
        ...

    def prepare(self, genome: Genome, settings: Settings_contra) -> Plan:
        """Return the plan: an episode's data from genome and settings, plain or traced."""
        ...

    def load(self, plan: Plan) -> jax.Array | None:
        """Return the relative cost [] of a command under a plan; None if all cost the same.

        Lanes wait for the slowest one, so plans of similar cost are simulated side by side.
        """
        ...

    def init(self) -> Memory:
        """Return the memory at the start of an episode."""
        ...

    def act(self, plan: Plan, memory: Memory, senses: Senses) -> tuple[jax.Array, Memory]:
        """Return the command [J] of this control step, and the memory for the next."""
        ...


Bounds = Mapping[str, tuple[ArrayLike, ArrayLike]]
"""Lowest and highest value of each gene, by the name of the array that holds it."""
Genes = Mapping[str, jax.Array]
"""Genome of bounded reals: its arrays by name."""


class RealController(abc.ABC):
    """Controller to inherit from (docs/guide/your-own-task.md).

    A subclass defines `bounds` and `act`. `reads`: names of the observations passed to `act`.
    `command`: the type of command. `Settings`: a frozen dataclass of numbers that become keys of
    `[controller]`. creature: the body it moves. step: s between two control steps.
    """

    Settings: ClassVar[type] = NoSettings
    reads: ClassVar[tuple[str, ...]] = ()
    command: ClassVar[Command] = "pose"
    every: ClassVar[int] = 1

    def __init__(self, creature: Body, step: float) -> None:
        self.creature, self.step = creature, step

    @abc.abstractmethod
    def bounds(self, settings: Any) -> Bounds:
        """Return the lowest and highest genome: arrays of any shape, by name."""

    @abc.abstractmethod
    def act(self, plan: Any, memory: Any, senses: Senses) -> tuple[jax.Array, Any]:
        """Return the command [J] of this control step and the next memory; see `Controller`.

        plan: the genome's arrays, unless `prepare` is overridden.
        """

    def prepare(self, genome: Genes, settings: Any) -> Any:
        """See `Controller`."""
        return genome

    def load(self, plan: Any) -> jax.Array | None:
        """Equal for all individuals."""
        return None

    def init(self) -> Any:
        """See `Controller`."""
        return ()

    def variation(self, settings: Any, evolution: EvolutionConfig) -> Variation[Genes]:
        """See `Controller`."""
        return real_variation(self._box(settings), evolution)

    def genes(self, genomes: Genes, settings: Any) -> np.ndarray:
        """See `Controller`."""
        return in_ranges(genomes, self._box(settings))

    def genome_statistics(self, genomes: Genes) -> Mapping[str, np.ndarray]:
        """Report no quantities."""
        return {}

    def _box(self, settings: object) -> Box:
        def edge(end: int) -> dict[str, jax.Array]:
            bounds = self.bounds(settings).items()
            return {name: jnp.asarray(pair[end], jnp.float32) for name, pair in bounds}

        return Box(edge(0), edge(1))


@pytree
class Bodied:
    """Genome with sizes.

    plan: the controller's genome. sizes: [..., Z] logarithms of factors (`Proportions`).
    """

    plan: Any
    sizes: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class BodiedController:
    """Implementation of `Controller`.

    sizes: Z. most: largest factor by which a part may grow or shrink.
    """

    controller: Controller
    sizes: int
    most: float

    @property
    def reads(self) -> tuple[str, ...]:
        """See `Controller`."""
        return self.controller.reads

    @property
    def command(self) -> Command:
        """See `Controller`."""
        return self.controller.command

    @property
    def every(self) -> int:
        """See `Controller`."""
        return self.controller.every

    @property
    def box(self) -> Box:
        """Box of the sizes [Z]."""
        end = jnp.full(self.sizes, np.log(self.most), jnp.float32)
        return Box(-end, end)

    def variation(self, settings: object, evolution: EvolutionConfig) -> Variation[Bodied]:
        """Sizes cross gene by gene and mutate like tuning genes."""
        own, box = self.controller.variation(settings, evolution), self.box
        draw = creation(narrowed(box, evolution.initial_spread), evolution)

        def create(key: jax.Array, count: int) -> Bodied:
            key_plan, key_sizes = jax.random.split(key)
            return Bodied(own.create(key_plan, count), draw(key_sizes, count))

        def cross(key: jax.Array, mother: Bodied, father: Bodied) -> Bodied:
            key_plan, key_sizes = jax.random.split(key)
            sizes = uniform_crossover(key_sizes, mother.sizes, father.sizes)
            return Bodied(own.cross(key_plan, mother.plan, father.plan), sizes)

        def mutate(key: jax.Array, genome: Bodied) -> Bodied:
            key_plan, key_sizes = jax.random.split(key)
            rate, sigma = evolution.tuning_rate, evolution.tuning_sigma
            sizes = jittered(key_sizes, genome.sizes, box.low, box.high, rate, sigma)
            return Bodied(own.mutate(key_plan, genome.plan), sizes)

        first = own.first
        if first is not None:  # sizes 0: the creature's own body
            count = jax.tree.leaves(first)[0].shape[0]
            first = Bodied(first, jnp.zeros((count, self.sizes)))
        whole = None
        if own.box is not None:
            whole = Box(Bodied(own.box.low, box.low), Bodied(own.box.high, box.high))

        def project(genomes: Bodied) -> Bodied:
            return dataclasses.replace(genomes, plan=own.project(genomes.plan))

        return Variation(
            create, cross, mutate, long=own.long, first=first, box=whole, project=project
        )

    def genes(self, genomes: Bodied, settings: object) -> np.ndarray:
        """See `Controller`."""
        plan = self.controller.genes(genomes.plan, settings)
        return np.concatenate([plan, in_ranges(genomes.sizes, self.box)], axis=1)

    def genome_statistics(self, genomes: Bodied) -> Mapping[str, np.ndarray]:
        """See `Controller`."""
        return self.controller.genome_statistics(genomes.plan)

    def prepare(self, genome: Bodied, settings: object) -> object:
        """See `Controller`."""
        return self.controller.prepare(genome.plan, settings)

    def load(self, plan: object) -> jax.Array | None:
        """See `Controller`."""
        return self.controller.load(plan)

    def init(self) -> object:
        """See `Controller`."""
        return self.controller.init()

    def act(self, plan: object, memory: object, senses: Senses) -> tuple[jax.Array, object]:
        """See `Controller`."""
        return self.controller.act(plan, memory, senses)
