"""Reference controller of a user-defined controller: its own code.

Body, drive and criteria are still implemented twice; the controller is not.
"""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.champion import Champion
from mjxgait.config.tables import build
from mjxgait.creature import Creature
from mjxgait.plugins.registry import find
from mjxgait.reference.controllers import Command, Memory


class SameCode:
    """See `Twin`. The memory's arrays are numbered."""

    def __init__(self, creature: Creature, champion: Champion, step: float) -> None:
        part: Any = find("controller", champion.controller)
        controller = part(creature, step)
        settings = champion.settings
        if isinstance(settings, Mapping):
            settings = build(part.Settings, settings, "champion.json: settings")
        genome = {name: jnp.asarray(a, jnp.float32) for name, a in champion.genome.items()}
        plan = controller.prepare(genome, settings)
        # Always read the time: its length is the number of individuals.
        self.reads: tuple[str, ...] = (*controller.reads, "time")
        self.command: Command = controller.command
        self.every: int = controller.every
        self.first, self.tree = jax.tree.flatten(jax.device_get(controller.init()))

        def act(memory: Any, senses: Any) -> tuple[jax.Array, Any]:
            return controller.act(plan, memory, senses)

        self.program = jax.jit(jax.vmap(act))

    def init(self, count: int) -> Memory:
        """See `Twin`."""
        leaves = (np.asarray(leaf) for leaf in self.first)
        return {str(i): np.repeat(leaf[None], count, axis=0) for i, leaf in enumerate(leaves)}

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `Twin`. Padded to a power of two, so that few programs are compiled."""
        count = len(senses["time"])
        padding = (1 << (count - 1).bit_length()) - count

        def padded(array: np.ndarray) -> np.ndarray:
            wide = array.astype(np.float32) if array.dtype == np.float64 else array
            return np.concatenate([wide, np.repeat(wide[:1], padding, axis=0)])

        leaves = [padded(memory[str(i)]) for i in range(len(self.first))]
        inputs = {name: padded(values) for name, values in senses.items()}
        command, after = self.program(jax.tree.unflatten(self.tree, leaves), inputs)
        kept = (np.asarray(leaf)[:count] for leaf in jax.tree.leaves(after))
        return np.asarray(command, float)[:count], {str(i): leaf for i, leaf in enumerate(kept)}

    def phase(self, memory: Memory) -> np.ndarray:
        """See `Twin`: NaN, because the controller may have no cycle."""
        count = len(next(iter(memory.values()))) if memory else 1
        return np.full(count, np.nan)
