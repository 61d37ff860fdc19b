"""Controller that grows with its body: blocks and neurons from one graph (Sims 1994)."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.traced import Choice, chosen
from mjxgait.controllers.base import Command, Senses
from mjxgait.controllers.sims_brain.brain import (
    Brain,
    BrainMemory,
    Perceived,
    blank,
    brain_step,
    wired,
)
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.genotype import Capacity, NerveRoom, Ranges
from mjxgait.controllers.sims_brain.operators import Genotype, GraphOperators, Mating, Rates
from mjxgait.controllers.sims_brain.phenotype import body_of
from mjxgait.controllers.sims_brain.reference_body import grow
from mjxgait.creature.body import Body
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.variation import Variation
from mjxgait.types import Sensed, Tree, choose

LIGHT, SKILL, OPPONENT = "light", "skill", "opponent"


def capacity_of(settings: BrainConfig) -> Capacity:
    """Return the capacity for graphs and bodies."""
    return Capacity(settings.nodes, settings.connections, settings.parts, settings.links)


class Brains:
    """Implementation of `Controller`.

    A command holds the torques of all hinges that a body may have.
    """

    Settings: ClassVar[type] = BrainConfig
    command: ClassVar[Command] = "torque"
    genes_of: ClassVar[Mapping[str, Sequence[str]]] = {
        LIGHT: ("nerves.steer",),
        OPPONENT: ("opponent.",),
    }
    """Arrays of a genome that do nothing without an observation, by the beginning of their dotted
    names."""

    @classmethod
    def with_settings(
        cls, creature: Body, step: float, settings: BrainConfig, added: Sequence[str]
    ) -> "Brains":
        """Return the controller. added: names of the observations that the task adds."""
        return cls(step, settings, added)

    def __init__(self, step: float, settings: BrainConfig, added: Sequence[str] = ()) -> None:
        self.every, self.capacity = settings.every, capacity_of(settings)
        self.pause = step * settings.every
        self.room = NerveRoom(
            local=settings.local,
            central=settings.central,
            steer=settings.steer,
            skills=settings.skills,
            children=settings.children,
        )
        self.skill = settings.skill
        # Numbers of sources count what a part can hear, and the arrays that hold them do not show it.
        self.meaning = {"controller.children": settings.children}
        known = (LIGHT, SKILL, OPPONENT)
        self.reads = ("joint_pos", "contact", *(name for name in known if name in added))

    def variation(self, settings: BrainConfig, evolution: EvolutionConfig) -> Variation:
        """Offspring are crossed, grafted, or have one parent."""
        rates = Rates(
            value=settings.values,
            sigma=settings.sigma,
            connection=settings.connect,
            node=settings.grow,
            resize=settings.resize,
            strength=settings.strength,
        )
        mating = Mating(graft=settings.graft, centre=settings.centre)
        operators = GraphOperators(self.capacity, self.room, Ranges(), rates, mating)

        def create(key: jax.Array, count: int) -> Genotype:
            return jax.vmap(operators.create)(jax.random.split(key, count))

        def cross(key: jax.Array, mother: Genotype, father: Genotype) -> Genotype:
            how, key = jax.random.split(key)
            draw = jax.random.uniform(how)
            crossed, grafted = (
                operators.cross(key, mother, father),
                operators.graft(key, mother, father),
            )
            crosses, grafts = draw < settings.crossover, draw > 1 - settings.grafting
            child = jax.tree.map(
                lambda own, c, g: jnp.where(crosses, c, jnp.where(grafts, g, own)),
                mother,
                crossed,
                grafted,
            )
            return kept(child, mother)

        def mutate(key: jax.Array, genotype: Genotype) -> Genotype:
            return kept(operators.mutate(key, genotype), genotype)

        def kept(child: Genotype, mother: Genotype) -> Genotype:
            return _restricted(settings.evolves, child, mother)

        usual = Variation(create, cross, mutate)
        return opposed(usual) if OPPONENT in self.reads else usual

    def genes(self, genomes: Genotype, settings: BrainConfig) -> np.ndarray:
        """Kinds, flags and numbers as they are, in no common unit; without the opponent's."""
        leaves = [np.asarray(leaf, float) for leaf in jax.tree.leaves(alone(genomes))]
        return np.concatenate([leaf.reshape(len(leaf), -1) for leaf in leaves], axis=1)

    def genome_statistics(self, genomes: Genotype) -> Mapping[str, np.ndarray]:
        """The number of parts, without tracing code that no program needs."""
        names = [field.name for field in dataclasses.fields(genomes.graph)]
        graph = {f"graph.{name}": np.asarray(getattr(genomes.graph, name)) for name in names}
        counts = [
            len(grow({n: a[i] for n, a in graph.items()}, self.capacity.parts, self.capacity.links))
            for i in range(len(graph["graph.half"]))
        ]
        return {"parts": np.array(counts)}

    def prepare(self, genome: Genotype, settings: BrainConfig) -> Brain:
        """The wiring of the body that grows from the genome."""
        body = body_of(genome.graph, self.capacity)
        return wired(genome.nerves, genome.centre, body, self.room)

    def load(self, plan: Brain) -> None:
        """Equal for all individuals."""

    def init(self) -> BrainMemory:
        """See `Controller`."""
        return blank(self.capacity.parts * self.room.local + self.room.central)

    def act(
        self, plan: Brain, memory: BrainMemory, senses: Senses
    ) -> tuple[jax.Array, BrainMemory]:
        """Torques in N·m of the links' hinges, without the root."""
        links = self.capacity.links
        light = senses[LIGHT] if LIGHT in self.reads else jnp.zeros((links, 3))
        angles = jnp.concatenate([jnp.zeros(1), senses["joint_pos"]])
        perceived = Perceived(angles, senses["contact"], light)
        skill = senses[SKILL] if SKILL in self.reads else self.skill
        torque, memory = brain_step(plan, memory, perceived, self.pause, skill)
        return torque[1:], memory


def opposed(usual: Variation[Genotype]) -> Variation[Genotype]:
    """Return the operators for genotypes with an opponent; of the first it is one and the same."""

    def create(key: jax.Array, count: int) -> Genotype:
        first = jax.tree.map(lambda leaf: leaf[0], usual.create(key_of(0), 1))
        return _facing(usual.create(key, count), first)

    def cross(key: jax.Array, mother: Genotype, father: Genotype) -> Genotype:
        child = usual.cross(key, alone(mother), alone(father))
        return dataclasses.replace(child, opponent=mother.opponent)

    def mutate(key: jax.Array, genotype: Genotype) -> Genotype:
        return dataclasses.replace(usual.mutate(key, alone(genotype)), opponent=genotype.opponent)

    def met(genotypes: Genotype, best: Genotype, changes: jax.Array) -> Genotype:
        assert best.opponent is not None
        return _facing(genotypes, choose(changes, alone(best), best.opponent))

    return Variation(create, cross, mutate, met=met)


def _facing(genotypes: Genotype, opponent: Genotype) -> Genotype:
    """Return genotypes [M, ...] that all meet one opponent."""
    count = len(jax.tree.leaves(genotypes)[0])
    spread = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (count, *leaf.shape)), opponent)
    return dataclasses.replace(genotypes, opponent=spread)


def alone(genotype: Genotype) -> Genotype:
    """Return a genotype without its opponent."""
    return dataclasses.replace(genotype, opponent=None)


def directions(place: jax.Array, sensed: Sensed) -> jax.Array:
    """Return the directions [G, 3] of a place [3] in the axes of each block."""
    axes = sensed.body.geom_rot
    assert axes is not None
    there = place - sensed.geom_pos
    there = there / jnp.sqrt(jnp.sum(there**2, axis=1, keepdims=True))
    return jnp.sum(axes * there[:, None], axis=2)


def _restricted(evolves: str | Choice, child: Genotype, mother: Genotype) -> Genotype:
    """Return the child with the mother's genes wherever they may not evolve."""

    def of_mother(fixed: jax.Array, own: Tree, other: Tree) -> Tree:
        return choose(fixed, other, own)

    steering_only = chosen(evolves, "steering")
    fixed = steering_only | chosen(evolves, "brain")
    nerves = of_mother(steering_only, child.nerves, mother.nerves)
    return Genotype(
        of_mother(fixed, child.graph, mother.graph),
        dataclasses.replace(nerves, steer=child.nerves.steer),
        of_mother(steering_only, child.centre, mother.centre),
    )
