"""Extension of any controller's genome by the sizes of the body's parts."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.base import Command, Controller, Senses
from mjxgait.evolution.variation import (
    Box,
    Variation,
    creation,
    in_ranges,
    jittered,
    narrowed,
)
from mjxgait.types import pytree


@pytree
class Bodied:
    """Genome with sizes.

    plan: the controller's genome. sizes: [..., Z] logarithms of factors (`Proportions`).
    """

    plan: Any
    sizes: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class BodiedController:
    """See `Controller`. sizes: Z. most: largest factor by which a part may grow or shrink."""

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

    def variation(self, settings: Any, evolution: EvolutionConfig) -> Variation:
        """See `Controller`: sizes cross gene by gene and mutate like tuning genes."""
        own, box = self.controller.variation(settings, evolution), self.box
        draw = creation(narrowed(box, evolution.initial_spread), evolution)

        def create(key: jax.Array, count: int) -> Bodied:
            key_plan, key_sizes = jax.random.split(key)
            return Bodied(own.create(key_plan, count), draw(key_sizes, count))

        def cross(key: jax.Array, mother: Bodied, father: Bodied) -> Bodied:
            key_plan, key_sizes = jax.random.split(key)
            from_mother = jax.random.bernoulli(key_sizes, 0.5, mother.sizes.shape)
            sizes = jnp.where(from_mother, mother.sizes, father.sizes)
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
        return Variation(create, cross, mutate, long=own.long, first=first)

    def genes(self, genomes: Bodied, settings: Any) -> np.ndarray:
        """See `Controller`."""
        plan = self.controller.genes(genomes.plan, settings)
        return np.concatenate([plan, in_ranges(genomes.sizes, self.box)], axis=1)

    def numbers(self, genomes: Bodied) -> Mapping[str, np.ndarray]:
        """See `Controller`."""
        return self.controller.numbers(genomes.plan)

    def prepare(self, genome: Bodied, settings: Any) -> Any:
        """See `Controller`."""
        return self.controller.prepare(genome.plan, settings)

    def load(self, plan: Any) -> jax.Array | None:
        """See `Controller`."""
        return self.controller.load(plan)

    def init(self) -> Any:
        """See `Controller`."""
        return self.controller.init()

    def act(self, plan: Any, memory: Any, senses: Senses) -> tuple[jax.Array, Any]:
        """See `Controller`."""
        return self.controller.act(plan, memory, senses)
