"""Wires the rooms into a run: the one place that jits and that knows the devices."""

import dataclasses
import os
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from mjxgait.champion import Champion
from mjxgait.config import Config
from mjxgait.creature import Creature
from mjxgait.evolution import Evolution, EvolutionState, Judged
from mjxgait.fitness import TERMS, fitness_terms, forward_distance, score, weight_vector
from mjxgait.gait import TUNING, Genome, PoseTracker
from mjxgait.physics import make_plant
from mjxgait.rollout import AXIS, Simulator
from mjxgait.starts import Starts, draw_starts
from mjxgait.tally import Judge, Reason
from mjxgait.variation import Box, pose_variation


def prepare_devices() -> None:
    """One JAX host device per core, and compiled programs kept in the user's cache folder. Call before JAX's first computation."""
    if jax.config.values["jax_num_cpu_devices"] < 0:
        jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
    if jax.config.values["jax_compilation_cache_dir"] is None:
        cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        jax.config.update("jax_compilation_cache_dir", os.path.join(cache, "mjxgait", "jax"))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 1.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Experiment:
    """One creature under one config: the pure functions of a run. The starts follow from the seed, the same in every generation."""

    creature: Creature
    config: Config
    simulator: Simulator
    evolution: Evolution
    starts: Starts

    def init(self) -> EvolutionState:
        """The state of generation -1: a population that nobody has judged."""
        key = jax.random.fold_in(jax.random.key(self.config.seed), 0)
        return self.evolution.init(key, self.config.rollout.starts, len(TERMS))

    def candidates(self, state: EvolutionState) -> list[int]:
        """Ranks of the best individuals that differ from each other, as many as the config asks for; best first."""
        low, high = self.simulator.tracker.bounds()
        genes = jax.tree.map(lambda leaf, a, b: np.asarray((leaf - a) / jnp.maximum(b - a, 1e-9)), state.genomes, low, high)
        rows = np.concatenate([leaf.reshape(leaf.shape[0], -1) for leaf in jax.tree.leaves(genes)], axis=1)
        chosen: list[int] = []
        for rank in np.flatnonzero(np.isfinite(state.fitness)):
            apart = np.sqrt(np.mean((rows[chosen] - rows[rank]) ** 2, axis=1))
            if (apart > self.config.examination.difference).all() and len(chosen) < self.config.examination.candidates:
                chosen.append(int(rank))
        return chosen

    def compile(self) -> jax.stages.Compiled:
        """The generation as one compiled program: state -> (state, metrics)."""
        everywhere = self._everywhere
        program = jax.jit(self.evolution.step, in_shardings=everywhere, out_shardings=everywhere)
        return program.lower(jax.eval_shape(self.init)).compile(compiler_options=_compiler_options())

    def place(self, state: EvolutionState) -> EvolutionState:
        """The state on all devices, where the compiled program wants it."""
        return jax.device_put(state, self._everywhere)

    @property
    def _everywhere(self) -> NamedSharding:
        return NamedSharding(self.simulator.mesh, PartitionSpec())

    def champion(self, state: EvolutionState, versions: dict[str, str], rank: int = 0) -> Champion:
        """An individual of a state; rank 0 is the best."""
        # One transfer instead of one per array: it happens in every generation.
        genomes, every_term, fitness, born, generation = jax.device_get(
            (state.genomes, state.terms, state.fitness, state.born, state.generation)
        )
        best = jax.tree.map(lambda leaf: leaf[rank], genomes)
        terms = every_term[rank].mean(axis=0)
        nominal = forward_distance(
            self.creature, self.config.fitness, self.config.rollout.seconds, float(every_term[rank, 0, TERMS.index("distance")])
        )
        origin = {
            "generation": int(generation),
            "born": int(born[rank]),
            "seed": self.config.seed,
            "nominal_forward": nominal,
            "nominal_seconds": self.config.rollout.seconds,
            "versions": versions,
        }
        return Champion(
            creature=self.creature.name,
            digest=self.creature.digest,
            key_poses=best.key_poses,
            tuning=dict(zip(TUNING, map(float, best.tuning), strict=True)),
            controller=self.config.controller,
            fitness=float(fitness[rank]),
            terms=dict(zip(TERMS, map(float, terms), strict=True)),
            origin=origin,
        )


def build_experiment(creature: Creature, config: Config) -> Experiment:
    """Joins the rooms: creature and config to simulator, starts and evolution.

    Raises:
      UserError: the physics does not support the creature's model.
    """
    simulator = _simulator(creature, config)
    starts = draw_starts(jax.random.fold_in(jax.random.key(config.seed), 1), creature, config.rollout)
    box = Box(*simulator.tracker.bounds())

    def judge(genomes: Genome) -> Judged:
        episodes = simulator.simulate(genomes, starts)
        terms = jax.vmap(jax.vmap(partial(fitness_terms, creature, config.fitness, simulator.tracker.step, simulator.steps)))(
            episodes.tally
        )
        broken = episodes.tally.reason == Reason.NONFINITE
        return Judged(
            terms=jnp.where(broken[..., None], jnp.nan, terms),
            failed=episodes.tally.reason != Reason.FINISHED,
            sim_steps=jnp.sum(episodes.tally.steps),
            computed_steps=episodes.computed_steps,
        )

    def rank(terms: jax.Array, generation: jax.Array) -> jax.Array:
        return score(terms, weight_vector(config.fitness, generation), config.rollout.worst)

    evolution = Evolution(config.evolution, pose_variation(box, config.evolution), judge, rank)
    return Experiment(creature, config, simulator, evolution, starts)


def _compiler_options() -> dict[str, str | bool]:
    """The fast plant gains a third from the widest vectors, which XLA's CPU compiler does not use by itself."""
    return {"xla_cpu_prefer_vector_width": "512"} if jax.default_backend() == "cpu" else {}


def _simulator(creature: Creature, config: Config) -> Simulator:
    step = float(creature.model.opt.timestep)
    steps = max(round(config.rollout.seconds / step), 1)
    plant, lanes = make_plant(creature, config.rollout.physics)
    return Simulator(
        creature=creature,
        plant=plant,
        tracker=PoseTracker(creature, config.controller, step),
        judge=Judge(creature, step, config.fitness.clearance * creature.hip_height, steps // 2),
        steps=steps,
        lanes=config.rollout.lanes or lanes,
        mesh=Mesh(np.array(jax.devices()), (AXIS,)),
    )
