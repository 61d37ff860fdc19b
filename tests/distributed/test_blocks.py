"""A generation judged in blocks is the generation judged at once."""

import jax
import numpy as np
import pytest
from helpers import made_up_evaluate, small_config

from mjxgait.creature import Creature
from mjxgait.distributed.jobs import AdvanceRows
from mjxgait.distributed.recipe import Programs, Recipe
from mjxgait.distributed.rows import ChunkedEvaluator, block_size
from mjxgait.distributed.scheduler import LocalBackend, Scheduler
from mjxgait.errors import UserError
from mjxgait.training import experiment, stages
from mjxgait.training.experiment import build_experiment

CONFIG = small_config(rollout={"block": 3})


@pytest.mark.parametrize(
    ("offspring", "most", "size"), [(256, 64, 64), (250, 64, 50), (64, 100, 64), (6, 4, 3)]
)
def test_blocks_are_equal_and_not_too_large(offspring: int, most: int, size: int):
    assert block_size(offspring, most) == size


def test_what_cannot_be_cut_is_refused():
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
def test_a_generation_by_blocks_is_that_of_one_program(
    stool: Creature, monkeypatch: pytest.MonkeyPatch, promote: float, simulated: bool
):
    """Who was judged, in which order, and what it cost; terms to the rounding of another program."""
    if not simulated:
        for module in (stages, experiment):  # of whole populations, and of blocks
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


def test_rows_that_are_handed_out_in_parts_go_where_they_would_have_gone(stool: Creature):
    """Stopped and packed after each generation, or not: the same bits."""
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
