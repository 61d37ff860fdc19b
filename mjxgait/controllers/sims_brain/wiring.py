"""Wiring of one grown body from the genotype of its nerves.

Letters: `P` parts, `n` links, `Q` and `M` neurons as in `nerves`; `V` values: nothing (0), the
constant 1, the angles, contacts and light of all links, and all neurons, part by part, the central
ones last. A part's contact and light are those of the link that carries its block.
"""

import jax
import jax.numpy as jnp

from mjxgait.controllers.sims_brain.nerves import Centre, NerveRoom, Nerves
from mjxgait.controllers.sims_brain.phenotype import Body
from mjxgait.controllers.sims_brain.reference_body.material import INPUTS, SENSORS
from mjxgait.types import pytree

NOTHING, ONE = 0, 1


@pytree
class Brain:
    """Brain of a body. kind: [P Q + M]. source: [P Q + M, 3] indices of values; weight: likewise.

    drive: [n] index of the value that drives a link's hinge. gain: [n] its factor. pull: [n] N·m,
    largest torque (signed). sign: [n] factor from angles to those of the genes. image: [n], -1 in a
    mirror image.
    """

    kind: jax.Array
    source: jax.Array
    weight: jax.Array
    drive: jax.Array
    gain: jax.Array
    pull: jax.Array
    sign: jax.Array
    image: jax.Array


def first_neuron(links: int) -> int:
    """Return the index of the first neuron among the values."""
    return 2 + links + links + 3 * links


def value_count(parts: int, links: int, room: NerveRoom) -> int:
    """Return V."""
    return first_neuron(links) + parts * room.local + room.central


def wired(nerves: Nerves, centre: Centre, body: Body, room: NerveRoom) -> Brain:
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
    code = nerves.effect_source[node[part], hinge]
    return Brain(
        kind=jnp.concatenate([nerves.kind[node].reshape(-1), centre.kind]),
        source=jnp.concatenate([source, central]),
        weight=jnp.concatenate([weight, centre.weight]),
        drive=places[part, code],
        gain=nerves.effect_weight[node[part], hinge],
        pull=body.strength * body.sign,
        sign=body.sign,
        image=1.0 - 2.0 * parts.copies[part],
    )


def _places(body: Body, room: NerveRoom) -> jax.Array:
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
    children = is_child & (parts.parent == every)
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
        neurons(children.argmax(1), children.any(1)),
        central,
    ]
    found = jnp.concatenate(columns, axis=1)
    assert found.shape[1] == room.codes == 1 + SENSORS + 3 * local + room.central
    return found
