"""Compilation of a generation as a few programs in a row; no other module of `training` jits.

Only the program that simulates is worth the compiler's best effort.
"""

import contextlib
import dataclasses
import functools
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from typing import Literal

import jax
import jax.numpy as jnp
from jax.sharding import NamedSharding, PartitionSpec

from mjxgait.cache import own_folder
from mjxgait.config.schema import Config
from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.output import LOG
from mjxgait.processes import cores
from mjxgait.simulation.evaluator import Evaluator
from mjxgait.simulation.rollout import Simulator
from mjxgait.tasks.starts import Starts
from mjxgait.training.generation import (
    RunParams,
    absorb,
    all_trials,
    evaluate,
    evaluate_small,
    first_state,
    first_trials,
    promote,
    propose,
)
from mjxgait.training.simulator import BodyParams, SimulatorSpec
from mjxgait.types import Evaluation, RequestedTrials, Tree


def prepare_devices(devices: int | None = None, kind: str = "") -> None:
    """Set one JAX host device per core, and keep compiled programs in the user's cache folder.

    Call before JAX's first computation.

    Args:
      devices: number of devices; one per core by default.
      kind: machine type. Each type has its own program cache, because a home folder may be shared.
    """
    if jax.config.values["jax_num_cpu_devices"] < 0:
        jax.config.update("jax_num_cpu_devices", devices or cores())
    if jax.config.values["jax_compilation_cache_dir"] is None:
        jax.config.update("jax_compilation_cache_dir", str(own_folder() / kind))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    LOG.debug("compiled programs: %s", jax.config.values["jax_compilation_cache_dir"])


def everywhere(simulator: Simulator) -> NamedSharding:
    """Return the sharding that puts whole arrays on every device of a simulator."""
    return NamedSharding(simulator.mesh, PartitionSpec())


Effort = Literal["best", "some", "least"]
"""Compiler effort for a part of a generation."""


def compiled(lowered: jax.stages.Lowered, effort: Effort = "best") -> jax.stages.Compiled:
    """Compile a lowered program."""
    return lowered.compile(compiler_options=compiler_options(effort))


def compiler_options(effort: Effort) -> dict[str, str | bool]:
    """Return the compiler options for this machine.

    The widest vectors make the lane-major plant a third faster; XLA's CPU compiler does not use
    them by default.
    """
    if jax.default_backend() != "cpu":
        return {}
    if effort == "best":
        return {"xla_cpu_prefer_vector_width": "512"}
    level = {"some": "1", "least": "0"}[effort]
    return {"xla_backend_optimization_level": level, "xla_llvm_disable_expensive_passes": True}


Turn = Callable[[str], AbstractContextManager[object]]
"""Context to compile a named program in, so that processes with a shared cache take turns."""


def at_once(name: str) -> AbstractContextManager[object]:
    """Compile without waiting for other processes."""
    return contextlib.nullcontext()


@dataclasses.dataclass(frozen=True)
class CompiledGeneration:
    """Compiled programs of one shape; see `generation`.

    evaluate: None if another evaluator is used. small: evaluates small bodies before all others;
    None if `evaluate` simulates all. promote: None if all individuals run all trials.
    """

    propose: jax.stages.Compiled
    absorb: jax.stages.Compiled
    evaluate: jax.stages.Compiled | None = None
    promote: jax.stages.Compiled | None = None
    small: jax.stages.Compiled | None = None

    def step(
        self,
        numbers: BodyParams | None,
        rows: RunParams,
        states: EvolutionState,
        evaluator: Evaluator | None = None,
    ) -> tuple[EvolutionState, GenerationMetrics]:
        """Run a generation of the rows [B]. evaluator: replaces this machine's program."""
        proposals, starts = self.propose(numbers, rows, states)

        def evaluated(*requested: RequestedTrials) -> Evaluation:
            if evaluator is not None:
                return evaluator.evaluate(proposals.offspring, starts, rows.settings, *requested)
            assert self.evaluate is not None, "compiled for an evaluator elsewhere"
            given = (numbers, rows.settings, starts, proposals.offspring)
            if self.small is not None:
                asked = requested or (all_trials(states, proposals),)
                requested = (self.small(*given, *asked),)
            found: Evaluation = self.evaluate(*given, *requested)
            return found

        if self.promote is None:
            evaluation = evaluated()
        else:
            first = evaluated(first_trials(states, proposals))
            evaluation = evaluated(self.promote(numbers, rows, states, proposals, first))
        after: tuple[EvolutionState, GenerationMetrics] = self.absorb(
            numbers, rows, states, proposals, evaluation
        )
        return after


def lowered(
    spec: SimulatorSpec, function: Callable[..., object], *given: object
) -> jax.stages.Lowered:
    """Lower a part of a generation for these shapes.

    The program is the same for all settings with these shapes, so the compiler's cache has it.
    """
    placed = everywhere(spec.own)
    program = jax.jit(functools.partial(function, spec), in_shardings=placed, out_shardings=placed)
    return program.lower(spec.numbers, *given)


def lower_stages(
    spec: SimulatorSpec, rows: RunParams, states: EvolutionState, evaluates: bool = True
) -> Iterator[tuple[str, jax.stages.Lowered]]:
    """Yield the names and programs for rows and states of these shapes, each traced on demand.

    evaluates: whether to include the program that evaluates.
    """
    first = lowered(spec, propose, rows, states)
    yield "propose", first
    proposals, starts = first.out_info
    promotes = rows.settings.rollout.promotes
    asked = all_trials(states, proposals)
    small = evaluates and spec.small is not None
    given = (rows.settings, starts, proposals.offspring, *((asked,) if promotes or small else ()))
    if evaluates:
        middle = lowered(spec, evaluate, *given)
        yield "evaluate", middle
        evaluation = middle.out_info
        if small:
            yield "small", lowered(spec, evaluate_small, *given)
    else:
        evaluation = jax.eval_shape(functools.partial(evaluate, spec), spec.numbers, *given)
    if promotes:
        yield "promote", lowered(spec, promote, rows, states, proposals, evaluation)
    yield "absorb", lowered(spec, absorb, rows, states, proposals, evaluation)


def compile_stages(
    programs: Iterable[tuple[str, jax.stages.Lowered]], turn: Turn = at_once, long: bool = False
) -> CompiledGeneration:
    """Compile each program while the next is traced.

    long: whether proposing takes long (`Variation`). Crossover of expressions takes half a second
    compiled with "some" effort and three with the least; poses take a hundredth with either.
    """
    efforts: dict[str, Effort] = {
        "propose": "some" if long else "least",
        "evaluate": "best",
        "small": "best",
    }

    def in_turn(part: str, program: jax.stages.Lowered) -> jax.stages.Compiled:
        with turn(part):
            began = time.perf_counter()
            done = compiled(program, efforts.get(part, "least"))
            LOG.debug(
                "%s: compiled, or read from the cache, in %.1f s", part, time.perf_counter() - began
            )
            return done

    with ThreadPoolExecutor() as aside:
        found = {part: aside.submit(in_turn, part, program) for part, program in programs}
    return CompiledGeneration(**{part: one.result() for part, one in found.items()})


def begin(
    spec: SimulatorSpec, numbers: BodyParams | None, settings: Config, key: jax.Array
) -> EvolutionState:
    """Return the state of a run before its first evaluation."""
    # One compiled function for all runs, single or in a batch: they begin with the same bits.
    return _beginning()(spec, numbers, settings, key)


@functools.cache
def _beginning() -> Callable[..., EvolutionState]:
    """Return the jitted `first_state`; not at import, because the options depend on the machine."""
    options = compiler_options("least")
    return jax.jit(first_state, static_argnums=0, compiler_options=options)


@jax.jit
def stacked(trees: Sequence[Tree]) -> Tree:
    """Stack trees to leaves [B, ...] in one program, not one per shape."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def embodied(spec: SimulatorSpec, starts: Starts) -> Starts:
    """Return the starts with the parameters of their bodies."""
    # Else each of its hundreds of operations would be compiled alone.
    return jax.jit(spec.embodied)(starts)
