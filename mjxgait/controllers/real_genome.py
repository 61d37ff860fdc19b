"""What controllers share whose genomes are real numbers within bounds: only `act` is left to write."""

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
    """A controller to inherit from (docs/extending.md).

    It needs `bounds` and `act`; `reads` names the senses that `act` is given, `command` says what
    it sends, `Settings` is a frozen dataclass of numbers that become keys of `[controller]`.
    creature: whom it moves. step: s between two control steps.
    """

    Settings: ClassVar[type] = NoSettings
    reads: ClassVar[tuple[str, ...]] = ()
    command: ClassVar[Command] = "pose"
    every: ClassVar[int] = 1

    def __init__(self, creature: Body, step: float) -> None:
        self.creature, self.step = creature, step

    @abc.abstractmethod
    def bounds(self, settings: Any) -> Bounds:
        """The genome: arrays of any shape, by name."""

    @abc.abstractmethod
    def act(self, plan: Any, memory: Any, senses: Senses) -> tuple[jax.Array, Any]:
        """The command [J] of this moment, and the memory of the next; see `Controller`.

        plan: the genome's arrays, if `prepare` makes nothing else of them.
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
