"""Small bodies among bodies that grow, simulated by a smaller program.

A step takes as long as the room of its program, whatever the size of the body in it.
"""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp

from mjxgait.config.schema import Config
from mjxgait.simulation.evaluator import LocalEvaluator
from mjxgait.simulation.rollout import Simulator
from mjxgait.tasks.starts import Starts
from mjxgait.types import RequestedTrials


@dataclasses.dataclass(frozen=True, eq=False)
class SmallBodies:
    """Simulator with less room, and a function that says whether a genome's body fits in it."""

    simulator: Simulator
    fits: Callable[[object], jax.Array]

    def evaluate(
        self, genomes: object, trials: Starts, settings: Config, requested: RequestedTrials
    ) -> RequestedTrials:
        """Run the requested trials of the small bodies; return what remains, with the results."""
        fits = jax.vmap(jax.vmap(self.fits))(genomes)[..., None]
        wanted = jnp.asarray(requested.wanted)
        own = with_joints(trials, len(self.simulator.creature.joints.names))
        of_small = RequestedTrials(wanted & fits, requested.known)
        known = LocalEvaluator(self.simulator).evaluate(genomes, own, settings, of_small)
        return RequestedTrials(wanted & ~fits, known)


def with_joints(starts: Starts, joints: int) -> Starts:
    """Return starts [B, R] of a free body with only its first joints."""
    return dataclasses.replace(
        starts,
        qpos=starts.qpos[..., : 7 + joints],
        qvel=starts.qvel[..., : 6 + joints],
        push=starts.push[..., : 6 + joints],
        stiffness=starts.stiffness[..., :joints],
        damping=starts.damping[..., :joints],
    )
