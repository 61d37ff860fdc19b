"""Fitness terms of a walk and of its targets, from its episode statistics.

The distance earns at most `WORTH`, and all penalties together cost less than was earned. So
standing still and falling at once earn nothing, and any walk earns more than nothing. Of two walks
that earn the same, the one with the smaller sum of penalties is better, whatever the weights.
"""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.creature.body import Body
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.terms import cost_of_transport, overlap_cost, ramped
from mjxgait.tasks.walk.config import LIKENESS, TargetConfig, WalkConfig, Weights
from mjxgait.tasks.walk.gaits import GRAVITY, animal_duty, animal_stride, most_strides, stride_limit
from mjxgait.tasks.walk.stats import WalkStats
from mjxgait.tasks.walk.target_stats import TargetStats, gait_missed

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
    creature: Body, config: WalkConfig, step: float, horizon: int, stats: WalkStats
) -> dict[str, jax.Array]:
    """Return the terms [] of one episode, each without unit and before its weight.

    Every penalty is at least zero, and every sum stops when the episode ends, so nothing is gained
    after a fall. The config may be traced.

    Args:
      step: s. horizon: T, steps of a full episode.
    """
    values, enough = plain_terms(creature, config, step, horizon, stats)
    length = creature.frame.body_length
    # Style counts only as far as there is a walk: attempts to learn walking must not be punished.
    walked = jnp.where(
        jnp.isfinite(enough), jnp.clip(stats.forward / length / enough, 0.0, 1.0), 1.0
    )
    values["alive"] *= STANDING + (1 - STANDING) * walked
    style = walked * (1.0 - config.leniency + config.leniency * walked)
    return {name: values[name] * (style if name in STYLE else 1.0) for name in TERMS}


def terms_under(weights: Weights) -> tuple[str, ...]:
    """Names of the terms that these weights enable."""
    return tuple(name for name in TERMS if name != OPTIONAL or getattr(weights, name))


def plain_terms(
    creature: Body, config: WalkConfig, step: float, horizon: int, stats: WalkStats
) -> tuple[dict[str, jax.Array], jax.Array]:
    """Return the terms with style in full, and the body lengths [] up to which farther is better.

    Style is not scaled here, however short the walk.
    """
    lived = jnp.maximum(stats.steps, 1)
    length = creature.frame.body_length
    moved = jnp.maximum(stats.forward, 0.25 * length)
    rate = jnp.mean(stats.swings) / lived / step
    # Strides of the median foot; a foot with fewer swings did not leave the floor.
    strides = jnp.sort(stats.swings)[stats.swings.shape[0] // 2]
    dragged = stats.shortfall + jnp.maximum(strides - stats.swings, 0.0)
    low_feet = jnp.mean(dragged / jnp.maximum(jnp.maximum(stats.swings, strides), 1.0))
    duty = stats.contact / lived
    second_half = stats.forward - stats.forward_half
    enough = _enough(config.speed, horizon * step)
    values = {
        "distance": _counted(stats.forward / length, enough),
        "alive": stats.steps / horizon,
        "drift": jnp.abs(stats.left) / length + jnp.abs(jnp.sin(0.5 * stats.heading)),
        "fade": jnp.maximum(stats.forward_half - second_half, 0.0) / length,
        "slip": jnp.max(stats.slip) / moved,
        "clearance": jnp.where(strides > 0, low_feet, 1.0),
        "frequency": jnp.maximum(rate / stride_limit(creature.frame.mass) - config.frequency, 0.0),
        "duty": jnp.max(jnp.maximum(duty - 0.8, 0.0) + jnp.maximum(0.25 - duty, 0.0)) / 0.2,
        "airborne": stats.airborne / lived,
        "patter": jnp.mean(_patter(stats)),
        "foot_height": jnp.maximum(
            stats.foot_height / lived / creature.frame.hip_height - 0.25, 0.0
        ),
        "tilt": stats.tilt / lived,
        "wobble": jnp.sqrt(stats.wobble / lived + 1e-12),
        "touch": stats.touch / lived,
        "energy": cost_of_transport(creature, stats.work, moved),
        "saturation": stats.saturation / lived,
        "limits": stats.limits / lived,
        "overlap": overlap_cost(creature, stats.overlap),
        "fall": jnp.where(stats.reason == Reason.FINISHED, 0.0, 1.0),
        "foot_speed": jnp.maximum(_in_hip_speeds(creature, stats.foot_speed) - WHIPPING, 0.0),
    }
    return values, enough


def _in_hip_speeds(creature: Body, speed: jax.Array) -> jax.Array:
    """Speed [] m/s in units of √(g·h), with this body's hip height h."""
    return speed / (GRAVITY * creature.frame.hip_height) ** 0.5


def _patter(stats: WalkStats) -> jax.Array:
    """Contact flicker [F] of each foot, 0 to 1.

    The first touchdown and those that end a swing do not count.
    """
    strides = jnp.maximum(stats.swings, 1.0)
    repeats = jnp.maximum(stats.touchdowns - 1.0 - stats.swings, 0.0) / strides
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


def target_terms(
    creature: Body, config: WalkConfig, step: float, horizon: int, stats: TargetStats
) -> dict[str, jax.Array]:
    """Return the terms [] of one episode; the module docstring describes their weighted sum."""
    wish, seconds = config.wish, horizon * step
    length = creature.frame.body_length
    wanted = wanted_speed(creature, config) * seconds / length
    values, _ = plain_terms(creature, config, step, horizon, stats)
    values |= target_errors(creature, wish, step, horizon, stats)
    values["frequency"] = frequency_excess(creature, config, step, stats)
    # Errors count per distance, not per episode: a slow walk covers less.
    longer = WORTH / wanted
    aside = jnp.abs(stats.left) / length
    values["drift"] = values["drift"] - aside + longer * aside
    values["fade"] = longer * values["fade"]
    share = jnp.minimum(stats.forward / length / (STARTING * wanted), 1.0)
    walked = jnp.maximum(share, 0.0) * values["alive"]
    values["distance"] = WORTH * jnp.where(share > 0, walked, share)
    values["alive"] = walked
    styled = {
        name: value * (walked if name in STYLE or name not in TERMS else 1.0)
        for name, value in values.items()
    }
    return _bounded_penalties(styled, config)


def wanted_speed(creature: Body, config: WalkConfig) -> jax.Array | float:
    """Target speed [] in m/s, or the speed up to which faster is better."""
    if config.wish.speed is not None:
        return config.wish.speed
    usual = WalkConfig().speed
    lengths = jnp.asarray(config.speed)
    return jnp.where(lengths > 0, lengths, usual) * creature.frame.body_length


def frequency_excess(
    creature: Body, config: WalkConfig, step: float, stats: TargetStats
) -> jax.Array:
    """Relative excess [] of the stride frequency over its limit.

    The limit is that of a walk without targets. A target speed also sets one: the frequency at half
    of an animal's stride length.
    """
    rate = jnp.mean(stats.swings) / jnp.maximum(stats.steps, 1) / step
    most = jnp.asarray(stride_limit(creature.frame.mass))
    if config.wish.speed is not None:
        most = jnp.minimum(most, most_strides(config.wish.speed, creature.frame.hip_height))
    return jnp.maximum(rate / most - config.frequency, 0.0)


def target_errors(
    creature: Body, wish: TargetConfig, step: float, horizon: int, stats: TargetStats
) -> dict[str, jax.Array]:
    """Error [] of each target that is set; turns already count in the distance.

    That of the height is 0.5 at `ROUGH` and grows on; all others stay below 1.
    """
    lived, frame = jnp.maximum(stats.steps, 1), creature.frame
    found: dict[str, jax.Array] = {}
    if wish.speed is not None:
        found["speed"] = _half_at(NEAR, steady_speed(step, horizon, stats) / wish.speed - 1.0)
    if "gait" in wish.requested:
        stations = creature.feet.stations
        found["gait"] = gait_missed(wish.gait, stations, stats.falls, stats.contact / lived)
    height = stats.height / lived
    if wish.height is not None:
        off = height / frame.stand_height - wish.height
        # Not flat far from the target, else a trunk that is much too high would never crouch.
        found["height"] = jnp.abs(off) / (2 * ROUGH["height"])
    if wish.bounce is not None:
        variance = jnp.maximum(stats.height_squared / lived - height**2, 1e-12)
        off = jnp.sqrt(variance) / frame.hip_height - wish.bounce
        found["bounce"] = _half_at(ROUGH["bounce"], off)
    if wish.sway is not None:
        rolls = jnp.degrees(jnp.sqrt(stats.roll_squared / lived + 1e-12))
        found["sway"] = _half_at(ROUGH["sway"], rolls - wish.sway)
    if set(LIKENESS) & set(wish.requested):
        own = likeness(creature, step, horizon, stats)
        likes = [name for name in LIKENESS if name in wish.requested]
        off = {name: (own[name] - getattr(wish, name)) / UNLIKE[name] for name in likes}
        # Animals differ too, so a small error costs next to nothing.
        found |= {name: _half_at(1.0, away**2) for name, away in off.items()}
    return found


def likeness(creature: Body, step: float, horizon: int, stats: TargetStats) -> dict[str, jax.Array]:
    """Compare a walk with an animal's: each measure [] in the unit of its target.

    Certification measures the same (`describe.likeness`).
    """
    lived, hip = jnp.maximum(stats.steps, 1), creature.frame.hip_height
    speed = jnp.maximum(steady_speed(step, horizon, stats), SLOW)
    swings = jnp.sort(stats.swings)[stats.swings.shape[0] // 2]
    stride = speed * lived * step / jnp.maximum(swings, 1.0)
    stood = stats.reach / jnp.maximum(stats.contact, 1.0)
    return {
        "stride": stride / animal_stride(speed, hip),
        "duty_factor": jnp.mean(stats.contact) / lived / animal_duty(speed, hip),
        "reach": jnp.mean(jnp.abs(stood)) / hip,
        "pitch": -jnp.degrees(stats.pitch / lived),
    }


def steady_speed(step: float, horizon: int, stats: WalkStats) -> jax.Array:
    """Speed [] in m/s over the second half of the episode, or over all of a shorter one."""
    half = horizon // 2
    late = stats.steps > half
    way = jnp.where(late, stats.forward - stats.forward_half, stats.forward)
    return way / (jnp.maximum(jnp.where(late, stats.steps - half, stats.steps), 1) * step)


def target_weights(wish: TargetConfig) -> dict[str, float]:
    """Weights of the targets that are set and have a term of their own."""
    return {n: getattr(wish.weights, n) for n in wish.requested if hasattr(wish.weights, n)}


def _half_at(near: float, off: jax.Array) -> jax.Array:
    away = jnp.abs(off)
    return away / (away + near)


def _bounded_penalties(values: dict[str, jax.Array], config: WalkConfig) -> dict[str, jax.Array]:
    """Scale the penalties down so that they cost no more than was earned."""
    weights = {name: getattr(config.weights, name) for name in TERMS} | target_weights(config.wish)
    costs = [weights[name] * value for name, value in values.items() if name not in REWARDS]
    cost = jnp.maximum(sum(costs, start=jnp.zeros(())), 0.0)
    earned = sum(weights[name] * jnp.maximum(values[name], 0.0) for name in REWARDS)
    most = AT_MOST * earned
    less = most / jnp.maximum(most + cost, 1e-9)
    return {n: value * (1.0 if n in REWARDS else less) for n, value in values.items()}
