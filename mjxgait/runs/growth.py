"""The body that a genome has, where bodies evolve."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.control.bodied import Bodied
from mjxgait.creature import Creature
from mjxgait.creature.proportions import Proportions, check_sizes, proportions
from mjxgait.settings.config import Config
from mjxgait.tasks.trials import Starts
from mjxgait.types import Plant


@dataclasses.dataclass(frozen=True, eq=False)
class Growth:
    """From sizes to the numbers that the plant reads, and to a start that stands as high."""

    proportions: Proportions

    def body(self, plant: Plant, genome: Bodied, start: Starts) -> Starts:
        """The start [] with the genome's own body."""
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


def growth_of(creature: Creature, config: Config) -> Growth | None:
    """None where the body stays as it is.

    Raises:
      UserError: the smallest or the largest body cannot be had.
    """
    most = config.evolution.body
    if most == 1.0:
        return None
    check_sizes(creature, most)
    return Growth(proportions(creature))
