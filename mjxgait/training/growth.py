"""The body that a genome has, where bodies evolve."""

import dataclasses
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.schema import Config
from mjxgait.controllers.sims_brain.genotype import Capacity
from mjxgait.controllers.sims_brain.operators import Genotype
from mjxgait.controllers.sims_brain.phenotype import body_of
from mjxgait.controllers.sized_body import Bodied
from mjxgait.creature import Creature
from mjxgait.creature.proportions import Proportions, extreme_bodies, proportions
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.tasks.starts import Starts
from mjxgait.types import ModelPlant


class Growth(Protocol):
    """From a genome to the body that is simulated."""

    def body(self, plant: Any, genome: Any, start: Starts) -> Starts:
        """The start [] with the genome's own body."""
        ...


@dataclasses.dataclass(frozen=True)
class GraphGrowth:
    """Bodies of blocks, from graphs."""

    capacity: Capacity

    def body(self, plant: TreePlant, genome: Genotype, start: Starts) -> Starts:
        """See `Growth`. What has no hinge is not bent, and on land all rest on the ground."""
        tree = body_of(genome.graph, self.capacity).tree
        bent = start.qpos[7:] * tree.moves[1:]
        qpos = plant.rested(tree, jnp.concatenate([start.qpos[:7], bent]))
        return dataclasses.replace(start, qpos=qpos, numbers=tree)


@dataclasses.dataclass(frozen=True, eq=False)
class SizeGrowth:
    """From sizes to the numbers that the plant reads, and to a start that stands as high."""

    proportions: Proportions

    def body(self, plant: ModelPlant, genome: Bodied, start: Starts) -> Starts:
        """See `Growth`."""
        known = self.proportions
        # The trunk's place is -1, where the factor is 1.
        factors = jnp.exp(jnp.append(genome.sizes, 0.0))[known.size_of]
        one = plant.parameters
        if start.heaviness is not None:
            one = plant.heavier(one, start.heaviness)
        rises = known.upwards.astype(np.float32)
        qpos = start.qpos + self._lift(factors) * rises
        return dataclasses.replace(start, qpos=qpos, numbers=plant.resized(one, factors))

    def _lift(self, factors: jax.Array) -> jax.Array:
        """[] m, by which the trunk is higher with these factors [B]."""
        reach, fixed = (
            x.astype(np.float32) for x in (self.proportions.reach, self.proportions.fixed)
        )
        return jnp.min(fixed + reach.sum(1)) - jnp.min(fixed + jnp.sum(reach * factors, axis=1))


def growth_of(creature: Creature, config: Config) -> SizeGrowth | None:
    """None where the body stays as it is.

    Raises:
      UserError: the smallest or the largest body cannot be had.
    """
    if not extreme_bodies(creature, config.evolution.body):
        return None
    return SizeGrowth(proportions(creature))
