"""Outputs of Sims' neurons from three inputs each, all neurons at once.

A neuron has one number of memory. Inputs are clipped to ±`LOUDEST`, values to ±`MOST`, so that
nothing overflows.
"""

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.physics.lane_major.lanes import sin_cos

MOST, LOUDEST = 10.0, 100.0
SMALL = 1e-3
"""Smallest absolute divisor."""
SMOOTHING = 5.0
"""1/s; rate at which a smoothing neuron follows its input."""


def fired(
    kind: jax.Array, inputs: jax.Array, memory: jax.Array, step: float
) -> tuple[jax.Array, jax.Array]:
    """Return outputs and memories [M] of neurons. inputs: [M, 3], weighted. step: s."""
    a, b, c = (jnp.clip(inputs[:, i], -LOUDEST, LOUDEST) for i in range(3))
    integral, phase = memory + step * a, memory + step * b
    phase = phase - jnp.floor(phase)
    followed = memory + (a - memory) * (1 - np.exp(-SMOOTHING * step))
    kept = jnp.where(b > 0, a, memory)
    turned = phase + a
    wave = sin_cos(2 * np.pi * (turned - jnp.floor(turned)))[0]
    saw = 2 * (turned - jnp.floor(turned)) - 1
    sine, cosine = sin_cos(a)
    safe = jnp.where(jnp.abs(b) < SMALL, 1.0, b)
    logarithm = jnp.log(jnp.maximum(jnp.abs(a), SMALL))
    outputs = [
        a + b + c,
        a * b * c,
        jnp.where(jnp.abs(b) < SMALL, 0.0, a / safe),
        jnp.where(a + b > c, 1.0, 0.0),
        jnp.where(a > b, 1.0, 0.0),
        jnp.sign(a),
        jnp.minimum(a, b),
        jnp.maximum(a, b),
        jnp.abs(a),
        jnp.where(a > 0, b, c),
        a + (b - a) * jnp.clip(c, 0.0, 1.0),
        sine,
        cosine,
        jnp.arctan(a),
        logarithm,
        jnp.exp(jnp.clip(b * logarithm, -MOST, np.log(MOST))),
        jax.nn.sigmoid(a),
        integral,
        (a - memory) / step,
        followed,
        kept,
        wave,
        saw,
    ]
    memories = {17: integral, 18: a, 19: followed, 20: kept, 21: phase, 22: phase}
    output, after = outputs[0], memory
    for number, value in enumerate(outputs[1:], start=1):
        output = jnp.where(kind == number, value, output)
    for number, value in memories.items():
        after = jnp.where(kind == number, value, after)
    return jnp.clip(output, -MOST, MOST), jnp.clip(after, -MOST, MOST)
