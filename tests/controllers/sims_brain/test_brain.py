"""Brains as arrays give the same outputs as a plain network, for any genes."""

import dataclasses
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from controllers.sims_brain.made_up import one

from mjxgait.controllers.sims_brain.brain import (
    NOTHING,
    Brain,
    Perceived,
    blank,
    brain_step,
    first_neuron,
    neuron_step,
    wired,
)
from mjxgait.controllers.sims_brain.genotype import (
    Capacity,
    NerveRoom,
    Ranges,
)
from mjxgait.controllers.sims_brain.operators import Genotype, GraphOperators
from mjxgait.controllers.sims_brain.phenotype import GrownBody, body_of
from mjxgait.controllers.sims_brain.reference import BrainReference, fire
from mjxgait.controllers.sims_brain.reference_body import NEURONS, SENSORS, grow
from mjxgait.evolution.chance import key_of
from mjxgait.rendering.brain import READS, draw_brain, kind_of, network_of, shape
from mjxgait.rendering.curves import figure
from mjxgait.training.experiment import arrays_of

CAPACITY, ROOM, COUNT, STEP = Capacity(), NerveRoom(steer=True, skills=3), 200, 0.01
NEURON_STEP = jax.jit(neuron_step, static_argnums=3)
HEARING = dataclasses.replace(ROOM, children=3)
"""The same room, in which a part hears three children."""
BRAIN_STEP = jax.jit(
    jax.vmap(lambda brain, mind, seen, skill: brain_step(brain, mind, seen, STEP, skill))
)
NEURONS_IN_ALL = CAPACITY.parts * ROOM.local + ROOM.central


@jax.jit
def grown(genotypes: Genotype) -> GrownBody:
    """Bodies of genotypes [COUNT]; all tests share this program."""
    return jax.vmap(lambda genotype: body_of(genotype.graph, CAPACITY))(genotypes)


@partial(jax.jit, static_argnums=2)
def _wired(genotypes: Genotype, bodies: GrownBody, room: NerveRoom) -> Brain:
    return jax.vmap(lambda own, body: wired(own.nerves, own.centre, body, room))(genotypes, bodies)


def born(genotypes: Genotype, room: NerveRoom = ROOM) -> tuple[GrownBody, Brain]:
    """Bodies and brains of genotypes [COUNT]."""
    bodies = grown(genotypes)
    return bodies, _wired(genotypes, bodies, room)


@partial(jax.jit, static_argnums=1)
def _drawn(keys: jax.Array, room: NerveRoom) -> Genotype:
    return jax.vmap(GraphOperators(CAPACITY, room, Ranges()).create)(keys)


def drawn(seed: int, room: NerveRoom = ROOM) -> Genotype:
    """Random genotypes [COUNT]."""
    return jax.device_get(_drawn(jax.random.split(key_of(seed), COUNT), room))


@pytest.mark.parametrize("name", NEURONS)
def test_a_neuron_computes_the_function_of_its_name(name: str):
    rng = np.random.default_rng(0)
    inputs, memory = rng.normal(0, 3, (300, 3)).astype(np.float32), rng.uniform(0, 1, 300)
    inputs[:20, 1] = 0.0
    kinds = jnp.full(300, NEURONS.index(name))
    output, kept = NEURON_STEP(kinds, jnp.asarray(inputs), jnp.float32(memory), 0.005)
    plain, remembered = fire(name, np.float64(inputs).T, memory, 0.005)
    np.testing.assert_allclose(output, plain, atol=2e-4)
    np.testing.assert_allclose(kept, remembered, atol=2e-4)


def test_any_input_gives_a_finite_value():
    values = np.array([0.0, 1e-30, -1e-4, 3.0, -10.0, 1e8, -1e30], np.float32)
    inputs = np.stack(np.meshgrid(values, values, values), -1).reshape(-1, 3)
    for kind in range(len(NEURONS)):
        output, kept = NEURON_STEP(
            jnp.full(len(inputs), kind), jnp.asarray(inputs), jnp.ones(len(inputs)), 0.005
        )
        assert np.isfinite(output).all(), NEURONS[kind]
        assert np.isfinite(kept).all(), NEURONS[kind]


@pytest.mark.parametrize("room", [ROOM, HEARING], ids=["one child", "three children"])
def test_a_brain_matches_its_reference_controller(room: NerveRoom):
    """The two may differ where a threshold is met within rounding, in fewer than 3 % of brains."""
    genotypes = drawn(3, room)
    bodies, brains = jax.device_get(born(genotypes, room))
    skills = np.arange(COUNT) % ROOM.skills
    minds = repeated(blank(NEURONS_IN_ALL))
    links, references = zip(
        *(reference(one(genotypes, i), one(bodies, i), skills[i], room) for i in range(COUNT)),
        strict=True,
    )
    memories = [t.init(1) for t in references]
    rng, wrong, driven = np.random.default_rng(4), np.zeros(COUNT), 0
    for _ in range(4):
        angles = np.float32(rng.uniform(-1, 1, (COUNT, CAPACITY.links)))
        contact = np.float32(rng.integers(0, 2, (COUNT, CAPACITY.links)))
        light = np.float32(rng.normal(size=(COUNT, CAPACITY.links, 3)))
        torque, minds = BRAIN_STEP(brains, minds, Perceived(angles, contact, light), skills)
        for i in np.flatnonzero([len(found) > 0 for found in links]):
            last = one(bodies, i).parts.last[: len(references[i].parts)]
            senses = {
                "joint_pos": angles[i][None, links[i]],
                "contact": contact[i][None, last],
                "light": light[i][None, last],
            }
            plain, memories[i] = references[i].act(memories[i], senses)
            most = one(bodies, i).strength[links[i]]
            wrong[i] = max(
                wrong[i], (np.abs(np.asarray(torque)[i, links[i]] - plain[0]) / most).max()
            )
            driven += int((plain != 0).any())
    assert driven > COUNT
    assert np.median(wrong) < 1e-5
    assert np.mean(wrong > 1e-2) < 0.03


def test_a_part_hears_its_first_children_in_order():
    """The three inputs of each neuron are the neurons of its place in three children."""
    genotypes, local = drawn(13, HEARING), HEARING.local
    codes = 1 + SENSORS + local * (2 + np.arange(3)) + np.arange(local)[:, None]
    source = np.broadcast_to(codes, genotypes.nerves.source.shape)
    nerves = dataclasses.replace(genotypes.nerves, source=source)
    bodies, brains = jax.device_get(born(dataclasses.replace(genotypes, nerves=nerves), HEARING))
    first, heard, beyond = first_neuron(CAPACITY.links), np.zeros(3, int), 0
    for body, brain in ((one(bodies, i), one(brains, i)) for i in range(COUNT)):
        for part in np.flatnonzero(body.parts.exists):
            own = (np.flatnonzero(body.parts.exists[1:] & (body.parts.parent[1:] == part)) + 1)[:3]
            wanted = np.full((3, local), NOTHING)
            wanted[: len(own)] = first + own[:, None] * local + np.arange(local)
            found = brain.source[part * local : (part + 1) * local]
            np.testing.assert_array_equal(found, wanted.T)
            heard[: len(own)] += 1
            beyond += len(own) < 3
    assert (heard > 3).all()
    assert beyond > COUNT


def test_the_reference_brains_values_and_memory_are_separate_arrays():
    """The reference simulator writes into the initial arrays."""
    first = brain_of(one(some(), 0)).init(2)
    first["values"][:] = 1.0
    assert (first["memory"] == 0).all()


def repeated(tree: Any) -> Any:
    """One of COUNT that are all alike."""
    return jax.tree.map(lambda leaf: np.repeat(np.asarray(leaf)[None], COUNT, axis=0), tree)


@cache
def some() -> Genotype:
    """Thirty random genotypes."""
    return jax.tree.map(lambda leaf: leaf[:30], drawn(11))


def test_each_skill_has_effectors_of_its_own():
    """Each drives the hinges in its own way; the neurons are the same."""
    moving = [found for found in (one(some(), i) for i in range(30)) if brain_of(found).hinges]
    each = [[pulled(brain_of(found, skill), True) for skill in range(3)] for found in moving]
    apart = [(a != b).any() and (b != c).any() for a, b, c in each]
    assert np.mean(apart) > 0.8
    first, second = (brain_of(moving[0], skill) for skill in (0, 1))
    np.testing.assert_array_equal(first.column, second.column)


def brain_of(genotype: Genotype, skill: int = 0, room: NerveRoom = ROOM) -> BrainReference:
    """The reference brain for the body of a genotype, without the arrays."""
    genome = arrays_of(genotype)
    parts = grow(genome, CAPACITY.parts, CAPACITY.links)
    hinges = [(p, h) for p, part in enumerate(parts) for h in range(len(part.hinges))]
    return BrainReference(genome, parts, hinges, STEP, skill=skill, children=room.children)


def reference(
    genotype: Genotype, body: GrownBody, skill: int, room: NerveRoom
) -> tuple[list[int], BrainReference]:
    """The links of all hinges, part by part, and the brain that drives them."""
    plain = brain_of(genotype, skill, room)
    links = [
        int(np.flatnonzero((body.part == p) & (body.hinge == h) & (body.tree.moves > 0))[0])
        for p, h in plain.hinges
    ]
    return links, plain


def pulled(brain: BrainReference, lit: bool) -> np.ndarray:
    """Torques of four commands under fixed random observations. lit: with a light."""
    rng, memory, torques = np.random.default_rng(7), brain.init(3), []
    for _ in range(4):
        senses = {
            "joint_pos": rng.uniform(-1, 1, (3, len(brain.hinges))),
            "contact": rng.integers(0, 2, (3, len(brain.parts))),
            "light": rng.normal(size=(3, len(brain.parts), 3)) * lit,
        }
        torque, memory = brain.act(memory, senses)
        torques.append(torque)
    return np.array(torques)


@pytest.mark.parametrize("lit", [True, False])
def test_what_a_drawn_brain_leaves_out_has_no_effect(lit: bool):
    """What it shows is complete: a neuron's inputs are wires or numbers, or have no effect."""
    rng, moving, left_out = np.random.default_rng(12), 0, 0
    for brain in [found for found in (brain_of(one(some(), i)) for i in range(30)) if found.hinges]:
        before, network = pulled(brain, lit), network_of(brain, lit)
        for neuron, column in enumerate(sorted(brain.place.values())):
            shown = READS.get(kind_of(brain, column), 1) if column in network.cells else 0
            brain.weight[neuron, shown:] = rng.normal(0, 3, 3 - shown)
            left_out += shown == 0
            assert lit or not any("light" in cell.label for cell in network.cells.values())
        np.testing.assert_array_equal(pulled(brain, lit), before)
        for wire in network.wires:
            # At most one wire farther from the hinges; nearer where a hinge's neuron feeds others.
            assert network.cells[wire.source].depth <= network.cells[wire.target].depth + 1
        moving += bool(before.any())
    assert moving > 10
    assert left_out > 100


def test_a_brain_is_drawn_by_parts():
    """A wave drives one hinge; nothing drives the other hinge of the same joint."""
    brain = brain_of(one(some(), 0))
    wave = brain.place[0, 0]
    brain.alike = {"oscillate-wave": np.arange(len(brain.place))}
    brain.hinges, brain.driver, brain.gain = ((0, 0), (0, 1)), np.array([wave, 0]), np.ones(2)
    brain.column[0], brain.weight[0] = [1, wave, 1], [0.25, -2.0, 9.0]
    network = network_of(brain, lit=False)
    with figure(shape(network)) as drawing:
        draw_brain(drawing, network)
        said = [text.get_text() for text in drawing.axes[0].texts if text.get_text()]
    assert said == ["part 0", "none 0", "none 1 = 0", "oscillate-wave(0.25, ·)", "1.00", "-2.00"]


def test_mirrored_limbs_have_mirrored_torques():
    """Both limbs of a pair have mirrored observations and the same neurons."""
    from controllers.sims_brain.test_growth import moving, star

    genotypes = dataclasses.replace(drawn(5), graph=repeated(star(mirror=2, joint="universal")))
    bodies, brains = jax.device_get(born(genotypes))
    body = one(bodies, 0)
    sign, copies = np.asarray(body.sign), np.asarray(body.parts.copies)[np.asarray(body.part)]
    bent = np.where(moving(body), 0.3 + 0.1 * np.asarray(body.hinge), 0.0) * sign
    ahead = np.where(copies[:, None] > 0, [0.2, -0.4, 0.1], [0.2, 0.4, 0.1])
    seen = Perceived(np.float32(bent), np.zeros(CAPACITY.links, np.float32), np.float32(ahead))
    perceived, minds = repeated(seen), repeated(blank(NEURONS_IN_ALL))
    for _ in range(3):
        torques, minds = BRAIN_STEP(brains, minds, perceived, np.zeros(COUNT, int))
    left, right = (np.flatnonzero(moving(body) & (copies == image)) for image in (0, 1))
    torque = np.asarray(torques) * sign
    np.testing.assert_allclose(torque[:, left], torque[:, right], rtol=1e-5)
    assert (torque[:, left] != 0).any(0).all()
