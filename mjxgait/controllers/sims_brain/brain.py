"""Brain of a grown body: its neurons, its wiring, and one control step.

A neuron has one number of memory. Inputs are clipped to ±`INPUT_LIMIT`, values to ±`VALUE_LIMIT`,
so that nothing overflows.

Letters: `P` parts, `n` links, `K` neurons, `S` skills, `Q` and `M` as in `genotype`; `V` values:
nothing (0), the constant 1, the angles, contacts and light of all links, and all neurons, part by
part, the central ones last. A part's contact and light are those of the link that carries its
block.
"""

from collections.abc import Iterator, Mapping
from itertools import islice

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.sims_brain.genotype import Centre, NerveRoom, Nerves
from mjxgait.controllers.sims_brain.phenotype import GrownBody
from mjxgait.controllers.sims_brain.reference_body import INPUTS, NEURONS, SENSORS
from mjxgait.physics.lane_major.lanes import sin_cos
from mjxgait.types import pytree

VALUE_LIMIT, INPUT_LIMIT = 10.0, 100.0
SMALL = 1e-3
"""Smallest absolute divisor."""
SMOOTHING = 5.0
"""1/s; rate at which a smoothing neuron follows its input."""


def neuron_step(
    kind: jax.Array, inputs: jax.Array, memory: jax.Array, step: float
) -> tuple[jax.Array, jax.Array]:
    """Return outputs and memories [M] of neurons. inputs: [M, 3], weighted. step: s."""
    a, b, c = (jnp.clip(inputs[:, i], -INPUT_LIMIT, INPUT_LIMIT) for i in range(3))
    kept = _memories(a, b, memory, step)
    outputs = _outputs(a, b, c, memory, kept, step)
    output, after = outputs[NEURONS[0]], memory
    for number, name in enumerate(NEURONS[1:], start=1):
        output = jnp.where(kind == number, outputs[name], output)
    for name, value in kept.items():
        after = jnp.where(kind == NEURONS.index(name), value, after)
    return jnp.clip(output, -VALUE_LIMIT, VALUE_LIMIT), jnp.clip(after, -VALUE_LIMIT, VALUE_LIMIT)


def _memories(a: jax.Array, b: jax.Array, memory: jax.Array, step: float) -> dict[str, jax.Array]:
    """Return the next memory [M] of each function that has one."""
    integral, phase = memory + step * a, memory + step * b
    phase = phase - jnp.floor(phase)
    return {
        "integrate": integral,
        "differentiate": a,
        "smooth": memory + (a - memory) * (1 - np.exp(-SMOOTHING * step)),
        "memory": jnp.where(b > 0, a, memory),
        "oscillate-wave": phase,
        "oscillate-saw": phase,
    }


def _outputs(
    a: jax.Array,
    b: jax.Array,
    c: jax.Array,
    memory: jax.Array,
    kept: Mapping[str, jax.Array],
    step: float,
) -> dict[str, jax.Array]:
    """Return the output [M] of each function. kept: see `_memories`."""
    turned = kept["oscillate-wave"] + a
    wave = sin_cos(2 * np.pi * (turned - jnp.floor(turned)))[0]
    saw = 2 * (turned - jnp.floor(turned)) - 1
    sine, cosine = sin_cos(a)
    safe = jnp.where(jnp.abs(b) < SMALL, 1.0, b)
    logarithm = jnp.log(jnp.maximum(jnp.abs(a), SMALL))
    return {
        "sum": a + b + c,
        "product": a * b * c,
        "divide": jnp.where(jnp.abs(b) < SMALL, 0.0, a / safe),
        "sum-threshold": jnp.where(a + b > c, 1.0, 0.0),
        "greater-than": jnp.where(a > b, 1.0, 0.0),
        "sign-of": jnp.sign(a),
        "min": jnp.minimum(a, b),
        "max": jnp.maximum(a, b),
        "abs": jnp.abs(a),
        "if": jnp.where(a > 0, b, c),
        "interpolate": a + (b - a) * jnp.clip(c, 0.0, 1.0),
        "sin": sine,
        "cos": cosine,
        "atan": jnp.arctan(a),
        "log": logarithm,
        "expt": jnp.exp(jnp.clip(b * logarithm, -VALUE_LIMIT, np.log(VALUE_LIMIT))),
        "sigmoid": jax.nn.sigmoid(a),
        "integrate": kept["integrate"],
        "differentiate": (a - memory) / step,
        "smooth": kept["smooth"],
        "memory": kept["memory"],
        "oscillate-wave": wave,
        "oscillate-saw": saw,
    }


NOTHING, ONE = 0, 1


@pytree
class Brain:
    """Brain of a body. kind: [P Q + M]. source: [P Q + M, 3] indices of values; weight: likewise.

    drive: [S, n] index of the value that drives a link's hinge, by skill. gain: [S, n] its factor.
    pull: [n] N·m, largest torque (signed). sign: [n] factor from angles to those of the genes.
    image: [n], -1 in a mirror image. lit: [n] index of the link that observes the light for a
    hinge. steer: [n, 2, 3] as in `Nerves`; None without.
    """

    kind: jax.Array
    source: jax.Array
    weight: jax.Array
    drive: jax.Array
    gain: jax.Array
    pull: jax.Array
    sign: jax.Array
    image: jax.Array
    lit: jax.Array | None = None
    steer: jax.Array | None = None


def first_neuron(links: int) -> int:
    """Return the index of the first neuron among the values."""
    return 2 + links + links + 3 * links


def wired(nerves: Nerves, centre: Centre, body: GrownBody, room: NerveRoom) -> Brain:
    """Return the wiring of a body. Wires from missing parts carry nothing."""
    parts, exists = body.parts, body.parts.exists
    count, node = len(exists), parts.node
    places = _places(body, room)

    def found(codes: jax.Array, part: jax.Array) -> jax.Array:
        return places[part.reshape(-1, *[1] * (codes.ndim - 1)), codes]

    every = jnp.arange(count)
    source = found(nerves.source[node], every).reshape(-1, INPUTS)
    central = found(centre.source, jnp.zeros(room.central, int))
    alive = jnp.repeat(exists, room.local)
    weight = nerves.weight[node].reshape(-1, INPUTS) * alive[:, None]
    part, hinge = body.part, body.hinge
    code, gain = (each[node[part], hinge] for each in nerves.effectors)
    return Brain(
        kind=jnp.concatenate([nerves.kind[node].reshape(-1), centre.kind]),
        source=jnp.concatenate([source, central]),
        weight=jnp.concatenate([weight, centre.weight]),
        drive=places[part[:, None], code].T,
        gain=gain.T,
        pull=body.strength * body.sign,
        sign=body.sign,
        image=1.0 - 2.0 * parts.copies[part],
        lit=None if nerves.steer is None else parts.last[part],
        steer=None if nerves.steer is None else nerves.steer[node[part], hinge],
    )


def _places(body: GrownBody, room: NerveRoom) -> jax.Array:
    """Return the index [P, codes] among the values of each part's sources."""
    parts, links = body.parts, len(body.part)
    count, local = len(parts.exists), room.local
    every = jnp.arange(count)[:, None]
    moves = body.tree.moves > 0
    own = (body.part[None, :, None] == every[:, :, None]) & moves[None, :, None]
    own = own & (body.hinge[None, :, None] == jnp.arange(3))
    angles = jnp.where(own.any(1), 2 + own.argmax(1), NOTHING)
    contact = 2 + links + parts.last[:, None]
    light = 2 + 2 * links + 3 * parts.last[:, None] + jnp.arange(3)
    first = first_neuron(links)

    def neurons(part: jax.Array, there: jax.Array) -> jax.Array:
        return jnp.where(there[:, None], first + part[:, None] * local + jnp.arange(local), NOTHING)

    is_child = parts.exists & (jnp.arange(count) > 0)
    heard = islice(_in_order(is_child & (parts.parent == every)), room.children)
    central = (
        first + count * local + jnp.broadcast_to(jnp.arange(room.central), (count, room.central))
    )
    columns = [
        jnp.full((count, 1), ONE),
        angles,
        contact,
        light,
        neurons(jnp.arange(count), parts.exists),
        neurons(parts.parent, is_child),
        *(neurons(child, there) for child, there in heard),
        central,
    ]
    found = jnp.concatenate(columns, axis=1)
    known = 1 + SENSORS + (2 + room.children) * local + room.central
    assert found.shape[1] == room.codes == known
    return found


def _in_order(children: jax.Array) -> Iterator[tuple[jax.Array, jax.Array]]:
    """Yield each part's first child [P], then its second, and so on, and whether [P] it has one.

    children: [P, P], whether the second part is a child of the first.
    """
    while True:
        first = children.argmax(1)
        yield first, children.any(1)
        children = children & (jnp.arange(len(children)) != first[:, None])


TICKS = 2
"""Brain steps per command (Sims 1994, section 3.2)."""


@pytree
class BrainMemory:
    """Memory of a brain: the neurons' values and memories, [K] each."""

    values: jax.Array
    memory: jax.Array


@pytree
class Perceived:
    """Observations. angles: [n] rad. contact: [n] 0 or 1. light: [n, 3] direction in block axes."""

    angles: jax.Array
    contact: jax.Array
    light: jax.Array


def blank(neurons: int) -> BrainMemory:
    """Return the memory before the first step."""
    none = jnp.zeros(neurons)
    return BrainMemory(none, none)


def brain_step(
    brain: Brain, memory: BrainMemory, perceived: Perceived, step: float, skill: jax.Array | int = 0
) -> tuple[jax.Array, BrainMemory]:
    """Return the torques [n] in N·m of the hinges, and the next memory. step: s per command.

    All neurons fire at once, on the values of the previous tick. skill: [] number of the effectors.
    """
    mirrored = jnp.stack([jnp.ones_like(brain.image), brain.image], axis=1)[:, jnp.array([0, 1, 0])]
    ends, angles = jnp.array([0.0, 1.0]), perceived.angles * brain.sign
    light = perceived.light * mirrored
    known = jnp.concatenate([ends, angles, perceived.contact, light.reshape(-1)])
    values, inner = memory.values, memory.memory
    for _ in range(TICKS):
        inputs = jnp.concatenate([known, values])[brain.source] * brain.weight
        values, inner = neuron_step(brain.kind, inputs, inner, step / TICKS)
    wanted = brain.gain[skill] * jnp.concatenate([known, values])[brain.drive[skill]]
    if brain.steer is not None:
        added, factor = jnp.sum(brain.steer * light[brain.lit][:, None], axis=2).T
        wanted = wanted * (1 + factor) + added
    return brain.pull * jnp.clip(wanted, -1.0, 1.0), BrainMemory(values, inner)
