"""Controller with one expression per joint as genome (Gritz & Hahn 1995, 1997)."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.base import Command, Senses
from mjxgait.controllers.expressions.config import ProgramConfig
from mjxgait.controllers.expressions.evaluate import Listing, evaluator, listed
from mjxgait.controllers.expressions.grow import Words
from mjxgait.controllers.expressions.operators import program_variation
from mjxgait.controllers.expressions.serialize import programs_to_begin_with
from mjxgait.controllers.expressions.text import (
    EMPTY,
    FUNCTION_CODES,
    Terminal,
    chosen_terminals,
    terminals,
)
from mjxgait.controllers.expressions.trees import Trees
from mjxgait.creature.body import Body
from mjxgait.evolution.variation import Variation


class Programs:
    """See `Controller`: an expression's value is its joint's target angle in rad.

    settings: those that shape the program. added: names of the observations that the task adds.
    """

    Settings: ClassVar[type] = ProgramConfig
    command: ClassVar[Command] = "pose"

    @classmethod
    def told(
        cls, creature: Body, step: float, settings: ProgramConfig, added: Sequence[str]
    ) -> "Programs":
        """Return the controller of a body. added: names of the observations that the task adds."""
        return cls(creature, step, settings, added)

    def __init__(
        self, creature: Body, step: float, settings: ProgramConfig, added: Sequence[str] = ()
    ) -> None:
        self.creature, self.step, self.every = creature, step, settings.every
        self.added = tuple(added)
        self.known: tuple[Terminal, ...] = chosen_terminals(
            terminals(creature, added), settings.senses
        )
        self.words = Words(
            tuple(FUNCTION_CODES[name] for name in settings.functions),
            tuple(terminal.code for terminal in self.known),
            settings.nodes,
        )
        self.reads = tuple(dict.fromkeys(terminal.sense for terminal in self.known))

    def variation(self, settings: ProgramConfig, evolution: EvolutionConfig) -> Variation:
        """See `Controller`; the first generation begins with the programs of the settings."""
        given = programs_to_begin_with(self.creature, settings, self.added)
        first = None if given is None else Trees(*map(jnp.asarray, given))
        return program_variation(self.words, len(self.creature.joints.names), settings, first)

    def genes(self, genomes: Trees, settings: ProgramConfig) -> np.ndarray:
        """See `Controller`: nodes either match or differ."""
        code, value = (np.asarray(leaf) for leaf in (genomes.code, genomes.value))
        return np.concatenate([leaf.reshape(len(leaf), -1) for leaf in (code, value)], axis=1)

    def numbers(self, genomes: Trees) -> Mapping[str, np.ndarray]:
        """See `Controller`: the nodes of all expressions."""
        return {"nodes": (np.asarray(genomes.code) != EMPTY).sum(axis=(1, 2))}

    def prepare(self, genome: Trees, settings: ProgramConfig) -> Listing:
        """See `Controller`."""
        return listed(genome, self.words)

    def load(self, plan: Listing) -> jax.Array:
        """See `Controller`: the number of functions in the longest expression."""
        return jnp.max(plan.count)

    def init(self) -> Any:
        """See `Controller`: a program has no memory."""
        return ()

    def act(self, plan: Listing, memory: Any, senses: Senses) -> tuple[jax.Array, Any]:
        """See `Controller`: clipped to each joint's pose range."""
        seen = [
            senses[t.sense] if t.index is None else senses[t.sense][t.index] for t in self.known
        ]
        angle = evaluator(self.words.functions)(plan, jnp.stack(seen))
        low, high = self.creature.joints.pose_low, self.creature.joints.pose_high
        return jnp.clip(angle, low.astype(np.float32), high.astype(np.float32)), memory
