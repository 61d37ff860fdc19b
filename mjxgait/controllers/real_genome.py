"""Base class for controllers with genomes of bounded real numbers."""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.tables import NoSettings
from mjxgait.controllers.base import Command, Senses
from mjxgait.creature.body import Body
from mjxgait.evolution.variation import (
    Box,
    Variation,
    in_ranges,
    real_variation,
)

Bounds = Mapping[str, tuple[Any, Any]]
"""Lowest and highest value of each gene, by the name of the array that holds it."""


class RealController(abc.ABC):
    """Controller to inherit from (docs/extending.md).

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

    def prepare(self, genome: Any, settings: Any) -> Any:
        """See `Controller`."""
        return genome

    def load(self, plan: Any) -> jax.Array | None:
        """See `Controller`: the same for all."""
        return None

    def init(self) -> Any:
        """See `Controller`."""
        return ()

    def variation(self, settings: Any, evolution: EvolutionConfig) -> Variation:
        """See `Controller`."""
        return real_variation(self._box(settings), evolution)

    def genes(self, genomes: Any, settings: Any) -> np.ndarray:
        """See `Controller`."""
        return in_ranges(genomes, self._box(settings))

    def numbers(self, genomes: Any) -> Mapping[str, np.ndarray]:
        """See `Controller`: none."""
        return {}

    def _box(self, settings: Any) -> Box:
        def edge(end: int) -> dict[str, jax.Array]:
            bounds = self.bounds(settings).items()
            return {name: jnp.asarray(pair[end], jnp.float32) for name, pair in bounds}

        return Box(edge(0), edge(1))
