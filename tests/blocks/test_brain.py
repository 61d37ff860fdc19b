"""Brains: the arrays think what a plain network thinks, whatever the genes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from blocks.made_up import one
from blocks.plain_brain import PlainBrain, fire

from mjxgait.blocks.genotype import Capacity, Ranges, random_graph
from mjxgait.blocks.nerves import NerveRoom, random_centre, random_nerves
from mjxgait.blocks.phenotype import body_of
from mjxgait.blocks.wiring import wired
from mjxgait.champion.blocks.material import NEURONS
from mjxgait.control.brains.neurons import fired
from mjxgait.control.brains.thought import Perceived, blank, thought

CAPACITY, ROOM, COUNT, STEP = Capacity(), NerveRoom(), 200, 0.01


@pytest.mark.parametrize("name", NEURONS)
def test_a_neuron_is_the_function_of_its_name(name: str):
    rng = np.random.default_rng(0)
    inputs, memory = rng.normal(0, 3, (300, 3)).astype(np.float32), rng.uniform(0, 1, 300)
    inputs[:20, 1] = 0.0
    kinds = jnp.full(300, NEURONS.index(name))
    output, kept = fired(kinds, jnp.asarray(inputs), jnp.float32(memory), 0.005)
    plain = [
        fire(name, *map(float, row), float(m), 0.005)
        for row, m in zip(inputs, np.float32(memory), strict=True)
    ]
    np.testing.assert_allclose(output, [p[0] for p in plain], atol=2e-4)
    np.testing.assert_allclose(kept, [p[1] for p in plain], atol=2e-4)


def test_nothing_that_comes_in_makes_a_value_that_is_not_finite():
    values = np.array([0.0, 1e-30, -1e-4, 3.0, -10.0, 1e8, -1e30], np.float32)
    inputs = np.stack(np.meshgrid(values, values, values), -1).reshape(-1, 3)
    for kind in range(len(NEURONS)):
        output, kept = fired(
            jnp.full(len(inputs), kind), jnp.asarray(inputs), jnp.ones(len(inputs)), 0.005
        )
        assert np.isfinite(output).all(), NEURONS[kind]
        assert np.isfinite(kept).all(), NEURONS[kind]


def test_a_brain_thinks_as_a_plain_network_does():
    """Where a threshold is met within rounding, two networks may part: not more than a few do."""

    def make(key: jax.Array):
        first, second, third = jax.random.split(key, 3)
        graph = random_graph(first, CAPACITY, Ranges())
        body, nerves = body_of(graph, CAPACITY), random_nerves(second, CAPACITY.nodes, ROOM)
        centre = random_centre(third, ROOM)
        return body, nerves, centre, wired(nerves, centre, body, ROOM)

    bodies, nerves, centres, brains = jax.jit(jax.vmap(make))(
        jax.random.split(jax.random.key(3), COUNT)
    )
    think = jax.jit(jax.vmap(lambda b, m, p: thought(b, m, p, STEP)))
    neurons = CAPACITY.parts * ROOM.local + ROOM.central
    minds = jax.vmap(lambda _: blank(neurons))(jnp.arange(COUNT))
    plain = [
        PlainBrain(one(nerves, i), one(centres, i), one(bodies, i), ROOM) for i in range(COUNT)
    ]
    rng, wrong, driven = np.random.default_rng(4), np.zeros(COUNT), 0
    for _ in range(4):
        angles = np.float32(rng.uniform(-1, 1, (COUNT, CAPACITY.links)))
        contact = np.float32(rng.integers(0, 2, (COUNT, CAPACITY.links)))
        light = np.float32(rng.normal(size=(COUNT, CAPACITY.links, 3)))
        torque, minds = think(brains, minds, Perceived(angles, contact, light))
        for i in range(COUNT):
            body = one(bodies, i)
            for (part, hinge), value in (
                plain[i].step(angles[i], contact[i], light[i], STEP).items()
            ):
                link = np.flatnonzero((body.part == part) & (body.hinge == hinge))[0]
                most = max(float(body.strength[link]), 1e-9)
                wrong[i] = max(wrong[i], abs(float(torque[i, link]) - value) / most)
                driven += abs(value) > 0
    assert driven > COUNT
    assert np.median(wrong) < 1e-5
    assert np.mean(wrong > 1e-2) < 0.03


def test_a_mirror_image_pulls_the_other_way():
    """The two of a pair sense and do the same, seen in a mirror: their torques mirror each other."""
    from blocks.test_growth import moving, star

    body = body_of(star(mirror=2, joint="universal"), CAPACITY)
    nerves = random_nerves(jax.random.key(5), CAPACITY.nodes, ROOM)
    brain = wired(nerves, random_centre(jax.random.key(6), ROOM), body, ROOM)
    sign, copies = np.asarray(body.sign), np.asarray(body.parts.copies)[np.asarray(body.part)]
    bent = np.where(moving(body), 0.3 + 0.1 * np.asarray(body.hinge), 0.0) * sign
    ahead = np.where(copies[:, None] > 0, [0.2, -0.4, 0.1], [0.2, 0.4, 0.1])
    perceived = Perceived(jnp.float32(bent), jnp.zeros(CAPACITY.links), jnp.float32(ahead))
    mind = blank(CAPACITY.parts * ROOM.local + ROOM.central)
    for _ in range(3):
        torque, mind = thought(brain, mind, perceived, STEP)
    left, right = (np.flatnonzero(moving(body) & (copies == image)) for image in (0, 1))
    np.testing.assert_allclose(
        np.asarray(torque)[left] * sign[left], np.asarray(torque)[right] * sign[right], rtol=1e-5
    )
