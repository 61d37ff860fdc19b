"""Fitness terms of a walk, from its episode statistics, and their weights."""

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
"""Term that exists only with a weight."""
STYLE = tuple(name for name in TERMS if name not in (*REWARDS, "foot_height", "fall"))
"""Terms for how a gait looks, scaled by the share of the walk that was achieved.

They may ramp in over generations.
"""

PATTER = 4.0
"""Excess touchdowns per stride at which contact flicker has half of its largest value."""
STANDING = 0.25
"""Share of the `alive` reward of an individual that stands still; a full walk earns all of it.

The share teaches balance, and must not make standing the best choice.
"""
WHIPPING = 2.25
"""Speed of a foot, in √(g·h), that is free.

The certificate allows any body 3 and needs a margin; the fastest body is nearly always a foot.
"""
BEYOND = 0.02
"""Value of a body length beyond the distance at the wanted speed."""


def fitness_terms(
    creature: Body, config: WalkConfig, step: float, horizon: int, tally: Tally
) -> dict[str, jax.Array]:
    """Return the terms [] of one episode, each without unit and before its weight.

    Every penalty is at least zero, and every sum stops when the episode ends, so nothing is gained
    after a fall. The config may be traced.

    Args:
      step: s. horizon: T, steps of a full episode.
    """
    values, enough = plain_terms(creature, config, step, horizon, tally)
    length = creature.frame.body_length
    # Style counts only as far as there is a walk: attempts to learn walking must not be punished.
    walked = jnp.where(
        jnp.isfinite(enough), jnp.clip(tally.forward / length / enough, 0.0, 1.0), 1.0
    )
    values["alive"] *= STANDING + (1 - STANDING) * walked
    return {name: values[name] * (walked if name in STYLE else 1.0) for name in TERMS}


def terms_under(weights: Weights) -> tuple[str, ...]:
    """Names of the terms that these weights enable."""
    return tuple(name for name in TERMS if name != OPTIONAL or getattr(weights, name))


def plain_terms(
    creature: Body, config: WalkConfig, step: float, horizon: int, tally: Tally
) -> tuple[dict[str, jax.Array], jax.Array]:
    """Return the terms with style in full, and the body lengths [] up to which farther is better.

    Style is not scaled here, however short the walk.
    """
    lived = jnp.maximum(tally.steps, 1)
    length = creature.frame.body_length
    moved = jnp.maximum(tally.forward, 0.25 * length)
    rate = jnp.mean(tally.swings) / lived / step
    # Strides of the median foot; a foot with fewer swings did not leave the floor.
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
    """Speed [] m/s in units of √(g·h), with this body's hip height h."""
    return speed / (GRAVITY * creature.frame.hip_height) ** 0.5


def _patter(tally: Tally) -> jax.Array:
    """Contact flicker [F] of each foot, 0 to 1.

    The first touchdown and those that end a swing do not count.
    """
    strides = jnp.maximum(tally.swings, 1.0)
    repeats = jnp.maximum(tally.touchdowns - 1.0 - tally.swings, 0.0) / strides
    return repeats / (repeats + PATTER)


def _enough(speed: jax.Array | float, seconds: float) -> jax.Array:
    """Body lengths up to which farther is better; infinite without a wanted speed."""
    return jnp.where(jnp.asarray(speed) > 0, speed * seconds, jnp.inf)


def _counted(distance: jax.Array, enough: jax.Array) -> jax.Array:
    """Distance in body lengths, with the part beyond `enough` scaled by `BEYOND`."""
    return jnp.minimum(distance, enough) + BEYOND * jnp.maximum(distance - enough, 0.0)


def signed_weights(config: WalkConfig, generation: jax.Array) -> dict[str, jax.Array]:
    """Signed weight [] of each term at a generation []: penalties negative, style ramped in."""
    ramp = ramped(config.style_ramp, generation)

    def weight(name: str) -> jax.Array:
        signed = jnp.float32(getattr(config.weights, name) * (1 if name in REWARDS else -1))
        return signed * ramp if name in STYLE else signed

    return {name: weight(name) for name in TERMS}
