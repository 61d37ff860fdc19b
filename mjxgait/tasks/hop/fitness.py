"""Fitness terms of the tasks with a goal, from their episode statistics."""

import dataclasses
from collections.abc import Mapping

import jax
import jax.numpy as jnp

from mjxgait.creature.body import Body
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.hop.config import NEAR, HopConfig, HopWeights, TravelConfig, TravelWeights
from mjxgait.tasks.hop.stats import HopStats, away
from mjxgait.tasks.terms import cost_of_transport, overlap_cost, ramped

TERMS = tuple(field.name for field in dataclasses.fields(HopWeights))
GOAL = "distance"
MISSED = "missed"
AIM = (GOAL, MISSED)
"""Terms that count from the first generation on."""
STYLE = tuple(name for name in TERMS if name not in AIM)
"""Style terms, ramped in over the generations."""
OPTIONAL = ("energy", "sub_goals")
"""Terms that exist only with a weight."""

FARTHEST = 2.0
"""Cap on the distance that is left, in goal distances."""
SHORTEST = 0.25
"""Smallest distance by which work is divided, in body lengths."""
FASTEST, FAST = 20.0, 0.7
"""Joint speed in rad/s that no machine reaches, and the share of it that is free."""


def terms_under(weights: HopWeights | TravelWeights) -> tuple[str, ...]:
    """Names of the terms that these weights enable."""
    names = tuple(field.name for field in dataclasses.fields(weights))
    return tuple(n for n in names if n not in OPTIONAL or getattr(weights, n))


def fitness_terms(
    creature: Body, horizon: int, stats: HopStats, more: Mapping[str, jax.Array] | None = None
) -> dict[str, jax.Array]:
    """Return the terms [] of one episode, each without unit and before its weight; all are >= 0.

    Style counts in proportion to how near the episode got: attempts to learn hopping must not be
    punished. Sub-goals count in full, because standing still passes none.

    Args:
      horizon: T, steps of a full episode. more: style that another task adds.
    """
    left = away(stats) / stats.goal
    near = jnp.clip(1.0 - left, 0.0, 1.0)
    style = style_terms(creature, horizon, stats) | dict(more or {})
    terms = {GOAL: jnp.minimum(left, FARTHEST), MISSED: jnp.minimum(left / NEAR, 1.0)}
    terms |= {name: near * value for name, value in style.items()}
    if stats.closest is not None:
        terms["sub_goals"] = jnp.mean(jnp.minimum(stats.closest / stats.goal, 1.0))
    return terms


def style_terms(creature: Body, horizon: int, stats: HopStats) -> dict[str, jax.Array]:
    """Style terms [] of one episode, not scaled by how near it got."""
    lived = jnp.maximum(stats.steps, 1)
    half_range = 0.5 * (creature.joints.pose_high - creature.joints.pose_low).astype(jnp.float32)
    terms = {
        "time": stats.arrived / horizon,
        "restless": jnp.minimum(stats.after / stats.goal, 1.0),
        "ground": stats.ground / lived,
        "fall": jnp.where(stats.reason == Reason.FINISHED, 0.0, 1.0),
        "fast": jnp.clip(stats.fastest / FASTEST - FAST, 0.0, 1.0 - FAST) / (1.0 - FAST),
        "neutral": jnp.minimum(jnp.mean(stats.bent / jnp.maximum(half_range, 1e-6)), 1.0),
        "overlap": overlap_cost(creature, stats.overlap),
    }
    if stats.work is not None:
        way = jnp.maximum(stats.goal - stats.left, SHORTEST * creature.frame.body_length)
        terms["energy"] = cost_of_transport(creature, stats.work, way)
    return terms


def signed_weights(config: HopConfig | TravelConfig, generation: jax.Array) -> dict[str, jax.Array]:
    """Signed weight [] of each term at a generation []: all negative, style terms ramped in."""
    ramp = ramped(config.style_ramp, generation)

    def weight(name: str) -> jax.Array:
        signed = -jnp.float32(getattr(config.weights, name))
        return signed if name in AIM else signed * ramp

    return {name: weight(name) for name in terms_under(config.weights)}
