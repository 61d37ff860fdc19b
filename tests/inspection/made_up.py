"""A made-up evolution state with known values."""

import jax.numpy as jnp
import numpy as np
from helpers import weight_vector

from mjxgait.controllers.key_poses.controller import TUNING, Genome
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import EvolutionState, Origin
from mjxgait.tasks.terms import score
from mjxgait.tasks.walk.fitness import terms_under
from mjxgait.tasks.walk.task import Walk

POPULATION = 6
LAST = 3
FORCED = 2
"""The generation in a forced phase."""


def make_state(creature, config, generation):
    """State of a generation.

    All poses of an individual are the standing pose plus rank and generation in degrees.
    """
    ranks = np.arange(POPULATION)
    poses = (
        np.broadcast_to(creature.joints.stand, (POPULATION, 2, len(creature.joints.names)))
        + np.radians(ranks + generation)[:, None, None]
    )
    names = terms_under(config.fitness.weights)
    terms = np.zeros((POPULATION, config.rollout.starts, len(names)), np.float32)
    terms[..., names.index("distance")] = (
        5.0 + generation - ranks[:, None] + 0.1 * np.arange(config.rollout.starts)
    )
    terms[..., names.index("drift")] = 0.5
    integer = jnp.int32(0)
    return EvolutionState(
        genomes=Genome(
            jnp.asarray(poses, jnp.float32), jnp.ones((POPULATION, len(TUNING)), jnp.float32)
        ),
        terms=jnp.asarray(terms),
        outcome=jnp.zeros((*terms.shape[:2], len(Walk.outcomes))),
        fitness=score(
            terms, weight_vector(config.fitness, jnp.int32(generation)), config.rollout.worst
        ),
        born=jnp.full(POPULATION, max(generation - 1, 0), jnp.int32),
        origin=jnp.asarray(
            [
                Origin.CROSSOVER,
                Origin.MUTATION,
                Origin.NEWCOMER,
                Origin.INITIAL,
                Origin.MUTATION,
                Origin.MUTATION,
            ],
            jnp.int32,
        ),
        key=key_of(7),
        generation=jnp.int32(generation),
        seeded=jnp.int32(POPULATION),
        best_history=jnp.zeros(9),
        mean_history=jnp.zeros(9),
        quiet=integer,
        forced=jnp.zeros((), bool),
        spell_age=integer,
        refreshed=integer,
        spell_best=jnp.float32(-jnp.inf),
        barren=integer,
    )
