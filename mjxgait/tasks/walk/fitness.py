"""From the tally of a walk to named fitness terms, and what each of them counts."""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.creature.body import Body
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.overlap import crossed
from mjxgait.tasks.score import ramped
from mjxgait.tasks.walk.config import WalkConfig, Weights
from mjxgait.tasks.walk.gaits import GRAVITY, stride_limit
from mjxgait.tasks.walk.stats import Tally
from mjxgait.tasks.work import cost_of_transport

TERMS = tuple(field.name for field in dataclasses.fields(Weights))
REWARDS = ("distance", "alive")
OPTIONAL = "foot_speed"
"""A term only where it has a weight."""
STYLE = tuple(name for name in TERMS if name not in (*REWARDS, "foot_height", "fall"))
"""What makes a gait good to look at: counted in proportion to the walk that there is, and may ramp in over generations."""

PATTER = 4.0
"""Touchdowns too many in each stride at which a foot counts as pattering half as much as it can."""
STANDING = 0.25
"""What it counts to stay up for who goes nowhere, as a share of what it counts for who walks all of the
way: it teaches balance, and must not be the best there is."""
WHIPPING = 2.25
"""√(g·h) that a foot may reach in its swing. The certificate allows any body 3, and asks for room to
spare; the fastest is a foot nearly always."""
BEYOND = 0.02
"""What a body length counts that goes beyond the wanted speed."""


def fitness_terms(
    creature: Body, config: WalkConfig, step: float, horizon: int, tally: Tally
) -> dict[str, jax.Array]:
    """The terms [] of one episode, each without unit and before its weight. The config may be traced.

    Every penalty is at least zero and every sum ended with the creature's life, so an individual that has died gains nothing more.

    Args:
      step: s. horizon: T, steps of a full episode.
    """
    values, enough = plain_terms(creature, config, step, horizon, tally)
    length = creature.frame.body_length
    # Style counts as far as there is a walk: a creature that has yet to learn walking must not be punished for trying.
    walked = jnp.where(
        jnp.isfinite(enough), jnp.clip(tally.forward / length / enough, 0.0, 1.0), 1.0
    )
    values["alive"] *= STANDING + (1 - STANDING) * walked
    return {name: values[name] * (walked if name in STYLE else 1.0) for name in TERMS}


def terms_under(weights: Weights) -> tuple[str, ...]:
    """Names of the terms that there are under these weights."""
    return tuple(name for name in TERMS if name != OPTIONAL or getattr(weights, name))


def plain_terms(
    creature: Body, config: WalkConfig, step: float, horizon: int, tally: Tally
) -> tuple[dict[str, jax.Array], jax.Array]:
    """The same, style counted in full however little was walked; and the body lengths [] up to
    which more is better.
    """
    lived = jnp.maximum(tally.steps, 1)
    length = creature.frame.body_length
    moved = jnp.maximum(tally.forward, 0.25 * length)
    rate = jnp.mean(tally.swings) / lived / step
    # As often as the foot in the middle; one that swings less often has not left the floor.
    strides = jnp.sort(tally.swings)[tally.swings.shape[0] // 2]
    dragged = tally.shortfall + jnp.maximum(strides - tally.swings, 0.0)
    low_feet = jnp.mean(dragged / jnp.maximum(jnp.maximum(tally.swings, strides), 1.0))
    duty = tally.contact / lived
    second_half = tally.forward - tally.forward_half
    enough = _enough(config.speed, horizon * step)
    values = {
        "distance": _counted(tally.forward / length, enough),
        "alive": tally.steps / horizon,
        "drift": jnp.abs(tally.left) / length + jnp.abs(jnp.sin(0.5 * tally.heading)),
        "fade": jnp.maximum(tally.forward_half - second_half, 0.0) / length,
        "slip": jnp.max(tally.slip) / moved,
        "clearance": jnp.where(strides > 0, low_feet, 1.0),
        "frequency": jnp.maximum(rate / stride_limit(creature.frame.mass) - config.frequency, 0.0),
        "duty": jnp.max(jnp.maximum(duty - 0.8, 0.0) + jnp.maximum(0.25 - duty, 0.0)) / 0.2,
        "airborne": tally.airborne / lived,
        "patter": jnp.mean(_patter(tally)),
        "foot_height": jnp.maximum(
            tally.foot_height / lived / creature.frame.hip_height - 0.25, 0.0
        ),
        "tilt": tally.tilt / lived,
        "wobble": jnp.sqrt(tally.wobble / lived + 1e-12),
        "touch": tally.touch / lived,
        "energy": cost_of_transport(creature, tally.work, moved),
        "saturation": tally.saturation / lived,
        "limits": tally.limits / lived,
        "overlap": crossed(creature, tally.overlap),
        "fall": jnp.where(tally.reason == Reason.FINISHED, 0.0, 1.0),
        "foot_speed": jnp.maximum(_in_hip_speeds(creature, tally.foot_speed) - WHIPPING, 0.0),
    }
    return values, enough


def _in_hip_speeds(creature: Body, speed: jax.Array) -> jax.Array:
    """A speed [] m/s in √(g·h) of this body's hip height."""
    return speed / (GRAVITY * creature.frame.hip_height) ** 0.5


def _patter(tally: Tally) -> jax.Array:
    """How much [F] each foot patters, 0 to 1: of its touchdowns neither the first nor those that end
    a swing are due.
    """
    strides = jnp.maximum(tally.swings, 1.0)
    repeats = jnp.maximum(tally.touchdowns - 1.0 - tally.swings, 0.0) / strides
    return repeats / (repeats + PATTER)


def _enough(speed: jax.Array | float, seconds: float) -> jax.Array:
    """Body lengths up to which more is better; infinite where no speed is wanted."""
    return jnp.where(jnp.asarray(speed) > 0, speed * seconds, jnp.inf)


def _counted(distance: jax.Array, enough: jax.Array) -> jax.Array:
    """Distance in body lengths, of which what lies beyond `enough` counts little."""
    return jnp.minimum(distance, enough) + BEYOND * jnp.maximum(distance - enough, 0.0)


def signed_weights(config: WalkConfig, generation: jax.Array) -> dict[str, jax.Array]:
    """Signed weight [] of each term at a generation []: penalties negative, style terms ramped in."""
    ramp = ramped(config.style_ramp, generation)

    def weight(name: str) -> jax.Array:
        signed = jnp.float32(getattr(config.weights, name) * (1 if name in REWARDS else -1))
        return signed * ramp if name in STYLE else signed

    return {name: weight(name) for name in TERMS}
