"""A generation evaluated in chunks equals one evaluated at once."""

import jax
import numpy as np
import pytest
from helpers import made_up_evaluate, small_config

from mjxgait.creature import Creature
from mjxgait.distributed.jobs import AdvanceRows, Programs, Recipe
from mjxgait.distributed.rows import ChunkedEvaluator, block_size
from mjxgait.distributed.scheduler import LocalBackend, Scheduler
from mjxgait.errors import UserError
from mjxgait.training import experiment, stages
from mjxgait.training.experiment import build_experiment

CONFIG = small_config(rollout={"block": 3})


@pytest.mark.parametrize(
    ("offspring", "most", "size"), [(256, 64, 64), (250, 64, 50), (64, 100, 64), (6, 4, 3)]
)
def test_chunks_are_equal_and_not_too_large(offspring: int, most: int, size: int):
    assert block_size(offspring, most) == size


def test_a_population_without_equal_chunks_is_refused():
    with pytest.raises(UserError, match=r"251 offspring.*another --population"):
        block_size(251, 64)


SIMULATED = pytest.mark.thorough(
    "the same without a simulation; a part of a row is simulated below"
)


@pytest.mark.parametrize(
    ("promote", "simulated"),
    [
        (0.5, False),
        pytest.param(0.5, True, marks=SIMULATED),
        pytest.param(1.0, True, marks=pytest.mark.thorough("without promotion")),
    ],
    ids=["the better half goes on", "the better half goes on, simulated", "all, simulated"],
)
def test_a_chunked_generation_equals_that_of_one_program(
    stool: Creature, monkeypatch: pytest.MonkeyPatch, promote: float, simulated: bool
):
    """The same individuals, order and cost; terms up to the rounding of another program."""
    if not simulated:
        for module in (stages, experiment):  # of whole populations, and of chunks
            monkeypatch.setattr(module, "evaluate", made_up_evaluate)
    config = small_config(rollout={"block": 3, "promote": promote})
    run = build_experiment(stool, config)
    alone = run.compile()
    spread = run.compile(ChunkedEvaluator(Scheduler(LocalBackend()), stool, config))
    state = run.place(run.init())
    (mine, counts), (theirs, others) = alone(state), spread(state)
    for one, other in zip(
        jax.tree.leaves(mine.genomes), jax.tree.leaves(theirs.genomes), strict=True
    ):
        assert np.array_equal(one, other)
    np.testing.assert_allclose(mine.terms, theirs.terms, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(mine.fitness, theirs.fitness, rtol=1e-4, atol=1e-5)
    for name in ("sim_steps", "episodes", "failures", "evaluations", "generation"):
        assert getattr(counts, name) == getattr(others, name), name
    assert (jax.random.key_data(mine.key) == jax.random.key_data(theirs.key)).all()


def test_rows_dispatched_in_parts_give_the_same_bits(stool: Creature):
    """Stopped and packed after each generation, or not."""
    recipe, programs = Recipe.of(stool, [CONFIG]), Programs()
    whole = AdvanceRows(None, 2).do(programs, recipe)
    state = None
    for until in range(3):
        part = AdvanceRows(state, until).do(programs, recipe)
        state = part.packed
    assert state is not None
    for name, array in whole.packed.arrays.items():
        assert np.array_equal(array, state.arrays[name]), name
    assert len(whole.lines) == 3
    assert not whole.champions
