"""Controller protocol of the rollout, shared by key poses, programs and brains."""

from collections.abc import Mapping
from typing import Any, Literal, Protocol

import jax
import numpy as np

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.evolution.variation import Variation

Senses = Mapping[str, jax.Array]
"""Observations of one control step, by name (`observations.py`, and those that a task adds)."""

Command = Literal["pose", "torque"]
"""Type of command: target joint angles [J] in rad for the drive, or torques [J] in N·m."""


class Controller(Protocol):
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
        """Control steps per command, one of `key_poses.config.HOLDS`; in between it is held."""
        ...

    def variation(self, settings: Any, evolution: EvolutionConfig) -> Variation:
        """Return the genetic operators of its genomes, under settings plain or traced."""
        ...

    def genes(self, genomes: Any, settings: Any) -> np.ndarray:
        """Return genomes [N, ...] as rows [N, genes], in gene ranges, to measure diversity."""
        ...

    def numbers(self, genomes: Any) -> Mapping[str, np.ndarray]:
        """Return statistics [N] of genomes [N, ...] by name, to follow over the generations."""
        ...

    def prepare(self, genome: Any, settings: Any) -> Any:
        """Return the plan: an episode's data from genome and settings, plain or traced."""
        ...

    def load(self, plan: Any) -> jax.Array | None:
        """Return the relative cost [] of a command under a plan; None if all cost the same.

        Lanes wait for the slowest one, so plans of similar cost are simulated side by side.
        """
        ...

    def init(self) -> Any:
        """Return the memory at the start of an episode."""
        ...

    def act(self, plan: Any, memory: Any, senses: Senses) -> tuple[jax.Array, Any]:
        """Return the command [J] of this control step, and the memory for the next."""
        ...
