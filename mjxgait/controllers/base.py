"""What the rollout asks of a controller: the one contract that key poses, programs and brains share."""

from collections.abc import Mapping
from typing import Any, Literal, Protocol

import jax
import numpy as np

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.evolution.variation import Variation

Senses = Mapping[str, jax.Array]
"""What a controller perceives of one moment, by name (`senses.py`, and what a task adds)."""

Command = Literal["pose", "torque"]
"""What a controller sends: joint angles [J] in rad that the drive pulls to, or torques [J] in N·m."""


class Controller(Protocol):
    """Moves one creature: from a genome, and what is sensed, to a command per control step.

    Every method is for one creature; the rollout maps them over its lanes. What `prepare` and
    `init` give back are pytrees of the controller's own.
    """

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the senses that `act` reads."""
        ...

    @property
    def command(self) -> Command:
        """What `act` sends."""
        ...

    @property
    def every(self) -> int:
        """Control steps from one command to the next; in between the last one holds.

        One of `settings.control.HOLDS`.
        """
        ...

    def variation(self, settings: Any, evolution: EvolutionConfig) -> Variation:
        """The operators of its kind of genome, under settings plain or traced."""
        ...

    def genes(self, genomes: Any, settings: Any) -> np.ndarray:
        """Genomes [N, ...] as rows [N, genes], in units of each gene's range, to tell how alike they are."""
        ...

    def numbers(self, genomes: Any) -> Mapping[str, np.ndarray]:
        """Numbers [N] of genomes [N, ...] by name, worth following over the generations."""
        ...

    def prepare(self, genome: Any, settings: Any) -> Any:
        """The plan: what an episode keeps of a genome under the settings, plain or traced."""
        ...

    def load(self, plan: Any) -> jax.Array | None:
        """How much [] a command takes under a plan, against others; None where all take the same.

        Lanes wait for the slowest of them, so those that take as much are simulated side by side.
        """
        ...

    def init(self) -> Any:
        """The memory at the start of an episode."""
        ...

    def act(self, plan: Any, memory: Any, senses: Senses) -> tuple[jax.Array, Any]:
        """The command [J] of this moment, and the memory of the next."""
        ...
