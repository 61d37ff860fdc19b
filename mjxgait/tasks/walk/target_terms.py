"""Fitness terms of a walk with targets: speed, gait, turn and posture.

The distance earns at most `WORTH`, and all penalties together cost less than was earned. So
standing still and falling at once earn nothing, and any walk earns more than nothing. Of two walks
that earn the same, the one with the smaller sum of penalties is better, whatever the weights.
"""

from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.creature.body import Body
from mjxgait.tasks.walk.config import LIKENESS, WalkConfig, WishConfig
from mjxgait.tasks.walk.fitness import (
    REWARDS,
    STYLE,
    TERMS,
    plain_terms,
)
from mjxgait.tasks.walk.footfalls import gait_missed
from mjxgait.tasks.walk.gaits import (
    animal_duty,
    animal_stride,
    most_strides,
    stride_limit,
)
from mjxgait.tasks.walk.target_stats import WishTally

SLOW = 0.01
"""Lowest speed in m/s at which a walk is compared with an animal's."""
WORTH = 7.2
"""Value of the whole wanted distance: as many body lengths as without targets.

The weights of the penalties then mean the same.
"""
AT_MOST = 0.99
"""Limit of all penalties together, as a share of what was earned; the rest is beyond rounding."""
STARTING = 0.9
"""Share of the distance at the wanted speed that earns everything: a walk begins with standing."""
NEAR = 0.25
"""Relative error at which a penalty is half of its largest value."""
ROUGH = {"height": 0.05, "bounce": 0.02, "sway": 2.0}
"""Errors of half the largest penalty, in standing heights, hip heights and deg."""
UNLIKE = {"stride": 0.15, "duty_factor": 0.15, "reach": 0.1, "pitch": 5.0}
"""Likewise for the animal measures: relative, relative, hip heights, deg."""


def wished_terms(
    creature: Body, config: WalkConfig, step: float, horizon: int, tally: WishTally
) -> dict[str, jax.Array]:
    """Return the terms [] of one episode; the module docstring describes their weighted sum."""
    wish, seconds = config.wish, horizon * step
    length = creature.frame.body_length
    wanted = wanted_speed(creature, config) * seconds / length
    values, _ = plain_terms(creature, config, step, horizon, tally)
    values |= missed(creature, wish, step, horizon, tally)
    values["frequency"] = hasty(creature, config, step, tally)
    # Errors count per distance, not per episode: a slow walk covers less.
    longer = WORTH / wanted
    aside = jnp.abs(tally.left) / length
    values["drift"] = values["drift"] - aside + longer * aside
    values["fade"] = longer * values["fade"]
    share = jnp.minimum(tally.forward / length / (STARTING * wanted), 1.0)
    walked = jnp.maximum(share, 0.0) * values["alive"]
    values["distance"] = WORTH * jnp.where(share > 0, walked, share)
    values["alive"] = walked
    styled = {
        name: value * (walked if name in STYLE or name not in TERMS else 1.0)
        for name, value in values.items()
    }
    return _shared(styled, config)


def wanted_speed(creature: Body, config: WalkConfig) -> jax.Array | float:
    """Target speed [] in m/s, or the speed up to which faster is better."""
    if config.wish.speed is not None:
        return config.wish.speed
    usual = WalkConfig().speed
    lengths = jnp.asarray(config.speed)
    return jnp.where(lengths > 0, lengths, usual) * creature.frame.body_length


def hasty(creature: Body, config: WalkConfig, step: float, tally: WishTally) -> jax.Array:
    """Relative excess [] of the stride frequency over its limit.

    The limit is that of a walk without targets. A target speed also sets one: the frequency at half
    of an animal's stride length.
    """
    rate = jnp.mean(tally.swings) / jnp.maximum(tally.steps, 1) / step
    most = jnp.asarray(stride_limit(creature.frame.mass))
    if config.wish.speed is not None:
        most = jnp.minimum(most, most_strides(config.wish.speed, creature.frame.hip_height))
    return jnp.maximum(rate / most - config.frequency, 0.0)


def missed(
    creature: Body, wish: WishConfig, step: float, horizon: int, tally: WishTally
) -> dict[str, jax.Array]:
    """Error [] of each target that is set, from 0 to 1; turns already count in the distance."""
    lived, frame = jnp.maximum(tally.steps, 1), creature.frame
    found: dict[str, jax.Array] = {}
    if wish.speed is not None:
        found["speed"] = _half_at(NEAR, steady_speed(step, horizon, tally) / wish.speed - 1.0)
    if "gait" in wish.asked:
        stations = creature.feet.stations
        found["gait"] = gait_missed(wish.gait, stations, tally.falls, tally.contact / lived)
    height = tally.height / lived
    if wish.height is not None:
        off = height / frame.stand_height - wish.height
        found["height"] = _half_at(ROUGH["height"], off)
    if wish.bounce is not None:
        variance = jnp.maximum(tally.height_squared / lived - height**2, 1e-12)
        off = jnp.sqrt(variance) / frame.hip_height - wish.bounce
        found["bounce"] = _half_at(ROUGH["bounce"], off)
    if wish.sway is not None:
        rolls = jnp.degrees(jnp.sqrt(tally.roll_squared / lived + 1e-12))
        found["sway"] = _half_at(ROUGH["sway"], rolls - wish.sway)
    if set(LIKENESS) & set(wish.asked):
        own = likeness(creature, step, horizon, tally)
        likes = [name for name in LIKENESS if name in wish.asked]
        off = {name: (own[name] - getattr(wish, name)) / UNLIKE[name] for name in likes}
        # Animals differ too, so a small error costs next to nothing.
        found |= {name: _half_at(1.0, away**2) for name, away in off.items()}
    return found


def likeness(creature: Body, step: float, horizon: int, tally: WishTally) -> dict[str, jax.Array]:
    """Compare a walk with an animal's: each measure [] in the unit of its target.

    Certification measures the same (`certification.likeness`).
    """
    lived, hip = jnp.maximum(tally.steps, 1), creature.frame.hip_height
    speed = jnp.maximum(steady_speed(step, horizon, tally), SLOW)
    swings = jnp.sort(tally.swings)[tally.swings.shape[0] // 2]
    stride = speed * lived * step / jnp.maximum(swings, 1.0)
    stood = tally.reach / jnp.maximum(tally.contact, 1.0)
    return {
        "stride": stride / animal_stride(speed, hip),
        "duty_factor": jnp.mean(tally.contact) / lived / animal_duty(speed, hip),
        "reach": jnp.mean(jnp.abs(stood)) / hip,
        "pitch": -jnp.degrees(tally.pitch / lived),
    }


def steady_speed(step: float, horizon: int, tally: Any) -> jax.Array:
    """Speed [] in m/s over the second half of the episode, or over all of a shorter one."""
    half = horizon // 2
    late = tally.steps > half
    way = jnp.where(late, tally.forward - tally.forward_half, tally.forward)
    return way / (jnp.maximum(jnp.where(late, tally.steps - half, tally.steps), 1) * step)


def wish_weights(wish: WishConfig) -> dict[str, Any]:
    """Weights of the targets that are set and have a term of their own."""
    return {n: getattr(wish.weights, n) for n in wish.asked if hasattr(wish.weights, n)}


def _half_at(near: float, off: jax.Array) -> jax.Array:
    away = jnp.abs(off)
    return away / (away + near)


def _shared(values: dict[str, jax.Array], config: WalkConfig) -> dict[str, jax.Array]:
    """Scale the penalties down so that they cost no more than was earned."""
    weights = {name: getattr(config.weights, name) for name in TERMS} | wish_weights(config.wish)
    costs = [weights[name] * value for name, value in values.items() if name not in REWARDS]
    cost = jnp.maximum(sum(costs, start=jnp.zeros(())), 0.0)
    earned = sum(weights[name] * jnp.maximum(values[name], 0.0) for name in REWARDS)
    most = AT_MOST * earned
    less = most / jnp.maximum(most + cost, 1e-9)
    return {n: value * (1.0 if n in REWARDS else less) for n, value in values.items()}
