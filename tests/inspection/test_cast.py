"""Participants of a race: the best of a population or of several generations."""

import pytest
from inspection.made_up import POPULATION

from mjxgait.errors import UserError
from mjxgait.rendering.video import champion_of, through_generations, top_of


def test_the_best_of_the_population(finished_run):
    runners = top_of(finished_run, 2, 0.1)
    assert [runner.label for runner in runners] == ["rank 1", "rank 2"]
    assert runners[0].walk.champion.fitness > runners[1].walk.champion.fitness


def test_the_best_of_generations(finished_run):
    runners = through_generations(finished_run, [0, 2], 0.1)
    assert [runner.label for runner in runners] == ["generation 0", "generation 2"]
    poses = [runner.walk.champion.genome["key_poses"] for runner in runners]
    assert (poses[0] != poses[1]).all()


def test_the_champion_has_no_label(finished_run):
    assert champion_of(finished_run, 0.1).label == ""


def test_a_missing_rank_or_generation_is_named(finished_run):
    with pytest.raises(UserError, match="ranks 1 to"):
        top_of(finished_run, POPULATION + 1, 0.1)
    with pytest.raises(UserError, match="no checkpoint of generation 99"):
        through_generations(finished_run, [0, 99], 0.1)
