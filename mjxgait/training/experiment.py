"""Experiment and batch: one or several runs assembled from creature and config."""

import dataclasses
import hashlib
from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import cached_property, partial

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.champion import TRIALS, Champion
from mjxgait.config.schema import Config
from mjxgait.config.traced import traced, traced_structure
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.kinds import skills_of
from mjxgait.plugins import make_task
from mjxgait.plugins.registry import find, what_ends
from mjxgait.simulation.evaluator import Evaluator
from mjxgait.simulation.rollout import Episodes, Simulator
from mjxgait.tasks.starts import Starts
from mjxgait.training.generation import RunParams, evaluate, first_state
from mjxgait.training.simulator import BodyParams, SimulatorSpec
from mjxgait.training.spec import make_spec
from mjxgait.training.stages import (
    CompiledGeneration,
    Turn,
    at_once,
    begin,
    compile_stages,
    embodied,
    everywhere,
    lower_stages,
    lowered,
    stacked,
)
from mjxgait.types import RequestedTrials, Tree, by_name


@dataclasses.dataclass(frozen=True)
class ProgramKey:
    """Key of a run's compiled programs.

    body: digest of the creature. settings: their structure; traced numbers may differ. code: the
    controller and task classes, so that redefining a class in a notebook changes the key.
    """

    body: str
    settings: Hashable
    code: tuple[Hashable, ...]

    def name(self, *more: Hashable) -> str:
        """Return a hash of body and settings, the same in all processes; `code` is left out."""
        return hashlib.sha256(repr((self.body, self.settings, *more)).encode()).hexdigest()[:16]


def program_key(creature: Creature, config: Config) -> ProgramKey:
    """Return the program key of a creature's run under a config."""
    code = (find("controller", config.use.controller), find("task", config.use.task))
    return ProgramKey(creature.digest, traced_structure(config), code)


Step = Callable[[EvolutionState], tuple[EvolutionState, GenerationMetrics]]
"""A compiled generation."""


@dataclasses.dataclass(frozen=True, eq=False)
class Experiment:
    """Pure functions of a run: one creature under one config. The starts follow from the seed.

    creature: as in its files, on the ground of the run. `spec.creature` also has the pose
    ranges of the settings.
    """

    creature: Creature
    config: Config
    spec: SimulatorSpec
    row: RunParams

    @cached_property
    def simulator(self) -> Simulator:
        """See `SimulatorSpec.own`."""
        return self.spec.own

    @property
    def starts(self) -> Starts:
        """The starts on which individuals are evaluated, [R] in each generation."""
        return self.row.starts

    @property
    def plant_note(self) -> str:
        """Note for the user on the physics; empty if there is none."""
        return self.simulator.plant.note

    @property
    def shape(self) -> Hashable:
        """Key of its compiled programs; see `ProgramKey`."""
        return program_key(self.creature, self.config), jax.tree.structure(self.row)

    def init(self, island: int = 0) -> EvolutionState:
        """Return the state of generation -1: a population that is not evaluated yet.

        island: each number has its own population, on the same starts; 0 is the run's own.
        """
        return begin(self.spec, *self._origin(island))

    def abstract(self) -> EvolutionState:
        """Return the shapes and types of a state."""
        shapes: EvolutionState = jax.eval_shape(partial(first_state, self.spec), *self._origin())
        return shapes

    def _origin(self, island: int = 0) -> tuple[BodyParams | None, Config, jax.Array]:
        """Return the inputs of the first state."""
        key = jax.random.fold_in(key_of(self.config.seed), 0)
        known = (self.spec.numbers, self.row.settings)
        return *known, jax.random.fold_in(key, island) if island else key

    def simulate(self, genomes: object, starts: Starts | None = None) -> Episodes:
        """Simulate genomes [N, ...] on starts [R], by default the run's.

        The episodes have leaves [N, R, ...].
        """
        rows = one_row((genomes, starts or self.starts, self.row.settings))
        episodes = self.simulator.simulate(*rows)
        return Episodes(row_of(episodes.stats), episodes.computed_steps)

    def compile(self, evaluator: Evaluator | None = None) -> Step:
        """Compile a generation of this run alone; `evaluator` evaluates it elsewhere."""
        together = Batch((self,)).compile(evaluator)

        def alone(state: EvolutionState) -> tuple[EvolutionState, GenerationMetrics]:
            return row_of(together(one_row(state)))

        return alone

    def candidates(self, state: EvolutionState) -> list[int]:
        """Return the ranks of the best individuals that differ, at most `candidates`; best first.

        Equal fitness means equal motion: expressions may differ in parts that have no effect.
        """
        rows = self.simulator.controller.genes(state.genomes, self.config.controller)
        fitness, settings = np.asarray(state.fitness), self.config.examination
        chosen: list[int] = []
        for rank in np.flatnonzero(np.isfinite(fitness)):
            apart = np.sqrt(np.mean((rows[chosen] - rows[rank]) ** 2, axis=1))
            differs = (apart > settings.difference).all() and fitness[rank] not in fitness[chosen]
            if differs and len(chosen) < settings.candidates:
                chosen.append(int(rank))
        return chosen

    def place(self, state: EvolutionState) -> EvolutionState:
        """Put the state on all devices, as the compiled program requires."""
        return jax.device_put(state, everywhere(self.simulator))

    def champion(self, state: EvolutionState, versions: dict[str, str], rank: int = 0) -> Champion:
        """Return an individual of a state; rank 0 is the best."""
        # One transfer instead of one per array: this runs in every generation.
        genomes, every_term, outcome, fitness, born, generation = jax.device_get(
            (state.genomes, state.terms, state.outcome, state.fitness, state.born, state.generation)
        )
        task = self.simulator.task
        best = jax.tree.map(lambda leaf: leaf[rank], genomes)
        terms = every_term[rank].mean(axis=0)
        origin = {
            "generation": int(generation),
            "born": int(born[rank]),
            "seed": self.config.seed,
            "nominal": dict(zip(task.outcomes, map(float, outcome[rank, 0]), strict=True)),
            "versions": versions,
        }
        if skills := skills_of(self.config.use.task):
            # The first trial of each skill is undisturbed.
            each = [dict(zip(task.outcomes, map(float, one), strict=True)) for one in outcome[rank]]
            origin[TRIALS] = dict(zip(skills, each, strict=False))
        return Champion.of(
            self.creature,
            self.config,
            arrays_of(best),
            fitness=float(fitness[rank]),
            terms=dict(zip(task.terms, map(float, terms), strict=True)),
            origin=origin,
        )


def arrays_of(genome: object) -> dict[str, np.ndarray]:
    """Return the arrays of a genome by dotted name, as in checkpoints."""
    return {name: np.asarray(leaf) for name, leaf in by_name(genome).items()}


@dataclasses.dataclass(frozen=True, eq=False)
class Batch:
    """Evolution runs of one creature, the rows `B` of one program: lanes are shared."""

    experiments: tuple[Experiment, ...]

    @cached_property
    def rows(self) -> RunParams:
        """Settings and starts, leaves [B, ...]."""
        return stacked([experiment.row for experiment in self.experiments])

    def init(self) -> EvolutionState:
        """Return the states before the first evaluation, leaves [B, ...]."""
        return stacked([experiment.init() for experiment in self.experiments])

    def abstract(self) -> EvolutionState:
        """Return the shapes and types of the states."""
        count, one = len(self.experiments), self.experiments[0].abstract()
        return jax.tree.map(
            lambda leaf: jax.ShapeDtypeStruct((count, *leaf.shape), leaf.dtype), one
        )

    def compile(self, evaluator: Evaluator | None = None) -> Step:
        """Compile a generation of all rows: states and metrics have leaves [B, ...].

        evaluator: evaluates instead of this machine.
        """
        return self.bound(self.stages(evaluates=evaluator is None), evaluator)

    def stages(self, evaluates: bool = True, turn: Turn = at_once) -> CompiledGeneration:
        """See `compile_stages`."""
        first = self.experiments[0]
        settings = first.config.controller, first.config.evolution
        long = first.simulator.controller.variation(*settings).long
        return compile_stages(self.lower(evaluates), turn, long)

    def lower(self, evaluates: bool = True) -> Iterator[tuple[str, jax.stages.Lowered]]:
        """Lower the programs of a generation, equal for equal shapes; see `lower_stages`."""
        return lower_stages(self._spec, self.rows, self.abstract(), evaluates)

    def bound(self, stages: CompiledGeneration, evaluator: Evaluator | None = None) -> Step:
        """Return the generation of these rows with compiled programs of their shape."""
        return partial(stages.step, *self.known, evaluator=evaluator)

    def lower_evaluate(
        self, genomes: object, starts: Starts, requested: RequestedTrials | None = None
    ) -> jax.stages.Lowered:
        """Lower the program that evaluates genomes [B, N, ...]; see `generation.evaluate`."""
        given = (self.rows.settings, starts, genomes)
        return lowered(self._spec, evaluate, *given, *([] if requested is None else [requested]))

    @property
    def _spec(self) -> SimulatorSpec:
        return self.experiments[0].spec

    @cached_property
    def known(self) -> tuple[BodyParams | None, RunParams]:
        """Body parameters and rows that the programs read, on all devices."""
        one = self.experiments[0]
        known: tuple[BodyParams | None, RunParams] = jax.device_put(
            (one.spec.numbers, self.rows), everywhere(one.simulator)
        )
        return known

    def place(self, states: EvolutionState) -> EvolutionState:
        """Put the states on all devices, as the compiled program requires."""
        return jax.device_put(states, everywhere(self.experiments[0].simulator))


def build_experiment(creature: Creature, config: Config) -> Experiment:
    """Build simulator, settings and starts from creature and config.

    Raises:
      UserError: the physics does not support the creature's model.
    """
    return _experiment(creature, make_spec(creature, config), config)


def build_batch(
    creature: Creature,
    configs: Sequence[Config],
    spec: SimulatorSpec | None = None,
    sources: Sequence[Sequence[int]] = (),
) -> Batch:
    """Build runs of one creature with configs that share one program.

    Args:
      spec: of this creature, with settings of the same shape; made here by default.
      sources: for each run, the runs whose best are evaluated among its children; none by default.

    Raises:
      UserError: two configs need different programs, or the physics does not support the creature's
        model.
    """
    if len({traced_structure(config) for config in configs}) != 1:
        raise UserError(
            "these settings need programs of different shapes: run them in batches of their own"
        )
    spec = spec or make_spec(creature, configs[0])
    experiments = [_experiment(creature, spec, config) for config in configs]
    if any(sources):
        experiments = [
            dataclasses.replace(one, row=dataclasses.replace(one.row, sources=jnp.int32(rows)))
            for one, rows in zip(experiments, _filled_up(sources), strict=True)
        ]
    return Batch(tuple(experiments))


def _filled_up(sources: Sequence[Sequence[int]]) -> list[list[int]]:
    """Pad all to the longest with the row's own number, which means no source."""
    most = max(map(len, sources))
    return [[*rows, *[own] * (most - len(rows))] for own, rows in enumerate(sources)]


def _experiment(creature: Creature, spec: SimulatorSpec, config: Config) -> Experiment:
    creature = creature.on(config.rollout.ground)
    key = jax.random.fold_in(key_of(config.seed), 1)
    rollout = config.rollout
    drawn = dataclasses.replace(rollout, starts=1 + (rollout.starts - 1) * rollout.variety)
    # Each run needs its own task: the commands in a trial differ between the rows of a program.
    step, ends = float(creature.model.opt.timestep), what_ends(creature, rollout)
    task = make_task(spec.own.creature, step, ends, config)
    starts = task.trials(key, creature, drawn)
    if starts.mass_scale is not None:
        starts = embodied(spec, starts)
    return Experiment(creature, config, spec, RunParams(traced(config), starts))


def one_row(tree: Tree) -> Tree:
    """Add an axis of one row [1, ...] to all leaves."""
    return stacked([tree])


def row_of(tree: Tree, row: int = 0) -> Tree:
    """Return one row of leaves [B, ...]."""
    return jax.tree.map(lambda leaf: leaf[row], tree)
