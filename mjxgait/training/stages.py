"""The one place that jits: a generation as a few compiled programs in a row, of which only the one
that simulates is worth the compiler's best effort.
"""

import contextlib
import dataclasses
import functools
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from typing import Any

import jax

from mjxgait.config.schema import Config
from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.simulation.evaluator import Evaluator
from mjxgait.tasks.starts import Starts
from mjxgait.training.blueprint import Numbers, Plan
from mjxgait.training.devices import (
    Effort,
    compiled,
    compiler_options,
    everywhere,
)
from mjxgait.training.generation import (
    Row,
    absorb,
    first_state,
    first_trials,
    judge,
    promote,
    propose,
)
from mjxgait.types import Asked, Judged

Turn = Callable[[str], AbstractContextManager[object]]
"""Whose turn it is to compile a program, by its name, where several processes share a cache."""


def at_once(name: str) -> AbstractContextManager[object]:
    """Nobody waits for anybody."""
    return contextlib.nullcontext()


@dataclasses.dataclass(frozen=True)
class Stages:
    """The compiled programs of one shape; see `generation`. judge: None where others judge. promote: None
    where everybody is tried in all trials.
    """

    propose: jax.stages.Compiled
    absorb: jax.stages.Compiled
    judge: jax.stages.Compiled | None = None
    promote: jax.stages.Compiled | None = None

    def step(
        self,
        numbers: Numbers | None,
        rows: Row,
        states: EvolutionState,
        evaluator: Evaluator | None = None,
    ) -> tuple[EvolutionState, GenerationMetrics]:
        """A generation of the rows [B]. evaluator: who judges instead of this machine's program."""
        proposals, starts = self.propose(numbers, rows, states)

        def verdict(*asked: Asked) -> Judged:
            if evaluator is not None:
                return evaluator.judge(proposals.offspring, starts, rows.settings, *asked)
            assert self.judge is not None, "compiled for an evaluator elsewhere"
            given = (numbers, rows.settings, starts, proposals.offspring)
            found: Judged = self.judge(*given, *asked)
            return found

        if self.promote is None:
            judged = verdict()
        else:
            first = verdict(first_trials(states, proposals))
            judged = verdict(self.promote(numbers, rows, states, proposals, first))
        after: tuple[EvolutionState, GenerationMetrics] = self.absorb(
            numbers, rows, states, proposals, judged
        )
        return after


def lowered(blueprint: Plan, function: Callable[..., Any], *given: Any) -> jax.stages.Lowered:
    """A part of a generation as a program of these shapes, the same for all settings that have them:
    what has been compiled once is found again.
    """
    placed = everywhere(blueprint.own)
    program = jax.jit(
        functools.partial(function, blueprint), in_shardings=placed, out_shardings=placed
    )
    return program.lower(blueprint.numbers, *given)


def lower_stages(
    blueprint: Plan, rows: Row, states: EvolutionState, judges: bool = True
) -> Iterator[tuple[str, jax.stages.Lowered]]:
    """The programs for rows and states of these shapes, by name, each traced when it is asked for.

    judges: whether one of them does.
    """
    first = lowered(blueprint, propose, rows, states)
    yield "propose", first
    proposals, starts = first.out_info
    promotes = rows.settings.rollout.promotes
    asked = (first_trials(states, proposals),) if promotes else ()
    given = (rows.settings, starts, proposals.offspring, *asked)
    if judges:
        middle = lowered(blueprint, judge, *given)
        yield "judge", middle
        judged = middle.out_info
    else:
        judged = jax.eval_shape(functools.partial(judge, blueprint), blueprint.numbers, *given)
    if promotes:
        yield "promote", lowered(blueprint, promote, rows, states, proposals, judged)
    yield "absorb", lowered(blueprint, absorb, rows, states, proposals, judged)


def compile_stages(
    programs: Iterable[tuple[str, jax.stages.Lowered]], turn: Turn = at_once, long: bool = False
) -> Stages:
    """Each compiled while the next is traced.

    long: whether it takes long to propose (`Variation`): expressions are crossed in half a second by
    some effort of the compiler's and in three by the least, poses in a hundredth by either.
    """
    efforts: dict[str, Effort] = {"propose": "some" if long else "least", "judge": "best"}

    def in_turn(part: str, program: jax.stages.Lowered) -> jax.stages.Compiled:
        with turn(part):
            return compiled(program, efforts.get(part, "least"))

    with ThreadPoolExecutor() as aside:
        found = {part: aside.submit(in_turn, part, program) for part, program in programs}
    return Stages(**{part: one.result() for part, one in found.items()})


def begin(
    blueprint: Plan, numbers: Numbers | None, settings: Config, key: jax.Array
) -> EvolutionState:
    """See `first_state`; the same compiled function for every run, alone or beside others, so that they
    begin with the same bits.
    """
    return _beginning()(blueprint, numbers, settings, key)


@functools.cache
def _beginning() -> Callable[..., EvolutionState]:
    """Not at import: the options ask which machine this is."""
    options = compiler_options("least")
    return jax.jit(first_state, static_argnums=0, compiler_options=options)


def embodied(blueprint: Plan, starts: Starts) -> Starts:
    """See `Plan.embodied`; as one program, or each of its hundreds of operations is compiled alone."""
    return jax.jit(blueprint.embodied)(starts)
