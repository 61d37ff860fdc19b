"""Bodies computed from genomes, if bodies evolve."""

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
    """Computation of the simulated body from a genome."""

    def body(self, plant: Any, genome: Any, start: Starts) -> Starts:
        """Return the start [] with the genome's own body."""
        ...


@dataclasses.dataclass(frozen=True)
class GraphGrowth:
    """Modular bodies from graphs."""

    capacity: Capacity

    def body(self, plant: TreePlant, genome: Genotype, start: Starts) -> Starts:
        """See `Growth`. Parts without a hinge are not bent; on land bodies rest on the ground."""
        tree = body_of(genome.graph, self.capacity).tree
        bent = start.qpos[7:] * tree.moves[1:]
        qpos = plant.rested(tree, jnp.concatenate([start.qpos[:7], bent]))
        return dataclasses.replace(start, qpos=qpos, numbers=tree)


@dataclasses.dataclass(frozen=True, eq=False)
class SizeGrowth:
    """Body parameters from evolved sizes, and a start with its height above ground kept."""

    proportions: Proportions

    def body(self, plant: ModelPlant, genome: Bodied, start: Starts) -> Starts:
        """See `Growth`."""
        known = self.proportions
        # The trunk has index -1, where the factor is 1.
        factors = jnp.exp(jnp.append(genome.sizes, 0.0))[known.size_of]
        one = plant.parameters
        if start.heaviness is not None:
            one = plant.heavier(one, start.heaviness)
        rises = known.upwards.astype(np.float32)
        qpos = start.qpos + self._lift(factors) * rises
        return dataclasses.replace(start, qpos=qpos, numbers=plant.resized(one, factors))

    def _lift(self, factors: jax.Array) -> jax.Array:
        """Return the rise [] of the trunk in m with these factors [B]."""
        reach, fixed = (
            x.astype(np.float32) for x in (self.proportions.reach, self.proportions.fixed)
        )
        return jnp.min(fixed + reach.sum(1)) - jnp.min(fixed + jnp.sum(reach * factors, axis=1))


def growth_of(creature: Creature, config: Config) -> SizeGrowth | None:
    """Return the growth of a creature whose sizes evolve; None if they do not.

    Raises:
      UserError: the smallest or the largest body is impossible.
    """
    if not extreme_bodies(creature, config.evolution.body):
        return None
    return SizeGrowth(proportions(creature))
