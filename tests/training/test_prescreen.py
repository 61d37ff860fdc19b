"""Pre-screening: candidates are validated in the order of their success on many starts in
evolution's physics.
"""

import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import STOOL, Shares, small_config

from mjxgait.certification import CertificateConfig
from mjxgait.config.layers import find_creature
from mjxgait.config.schema import Config
from mjxgait.creature import load_creature
from mjxgait.plugins import resolve_config
from mjxgait.training import prescreen as prescreen
from mjxgait.training.examination import Examiner
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.prescreen import Prescreen, prescreen_of, tried_settings

STARTS, MOST = 5, 3
SECONDS = 0.1


def tried(tables: dict | None = None) -> Config:
    config = small_config(**(tables or {}))
    examination = dataclasses.replace(config.examination, tryout=STARTS, candidates=MOST)
    return dataclasses.replace(config, examination=examination)


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return build_experiment(load_creature(STOOL), tried())


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short episodes for pre-screening."""

    def shorter(config: Config) -> Config:
        long = tried_settings(config)
        return dataclasses.replace(long, rollout=dataclasses.replace(long.rollout, seconds=SECONDS))

    monkeypatch.setattr(prescreen, "tried_settings", shorter)


def test_episodes_have_the_length_and_disturbances_of_the_examination():
    config, exam = tried({"rollout": {"variety": 1, "joint_noise": 0.3}}), CertificateConfig()
    settings = tried_settings(config)
    assert settings.rollout.starts == 1 + STARTS
    assert settings.rollout.seconds == exam.seconds
    assert settings.rollout.joint_noise == exam.starts.joints
    assert settings.rollout.velocity_noise == exam.starts.velocities
    assert settings.rollout.gains == exam.starts.gains
    assert settings.rollout.latency == exam.starts.latency
    same = dataclasses.replace(settings, seed=config.seed, rollout=config.rollout)
    assert same == config


def test_starts_differ_from_those_of_the_generations(experiment: Experiment, brief: None):
    """Even with equal disturbances: a prefix of the same draw would not be independent."""
    ours, others = experiment.starts, Prescreen(experiment)._starts
    assert not np.isin(np.asarray(others.friction)[0, 1:], np.asarray(ours.friction)).any()


def test_trials_have_their_final_difficulty():
    """The limbo bar has its final height, although it hangs higher in the first generations."""
    luxo = load_creature(find_creature("luxo"))
    resolved = resolve_config(luxo.settings.train, "luxo", None, {"task": "limbo"})
    limbo = build_experiment(luxo, dataclasses.replace(resolved, examination=tried().examination))
    assert np.asarray(Prescreen(limbo)._starts.goal.raised).tolist() == [[0.0] * (1 + STARTS)]


def test_the_share_counts_the_disturbed_starts_that_succeed(
    experiment: Experiment, brief: None, monkeypatch: pytest.MonkeyPatch
):
    """The result is that of each individual alone; the nominal start does not count."""
    trying, state = Prescreen(experiment), experiment.init()
    task = trying._trials.simulator.task
    ranks = [4, 0]

    class AboveTheMedian:
        worth = 1.0

        @staticmethod
        def managed(outcome: dict, seconds: float, creature: object) -> np.ndarray:
            assert seconds == SECONDS
            assert len(outcome["forward"]) == STARTS
            return outcome["forward"] > middle

    program = trying._program
    numbers, rows = trying._batch.known

    def alone(rank: int) -> np.ndarray:
        """Distance in each disturbed start, in a population of this individual only."""
        genomes = jax.tree.map(lambda leaf: leaf[None, jnp.full(MOST, rank)], state.genomes)
        outcome = program(numbers, rows.settings, trying._starts, genomes).outcome
        return np.asarray(outcome)[0, 0, 1:, task.outcomes.index("forward")]

    ways = np.array([alone(rank) for rank in ranks])
    middle = float(np.median(ways))
    monkeypatch.setattr(Prescreen, "_demands", AboveTheMedian)
    assert trying.shares(state, ranks).tolist() == (ways > middle).mean(1).tolist()
    assert np.ptp((ways > middle).mean(1)) > 0
    ahead, compiled = Prescreen(experiment), list[Prescreen]()

    def once(self: Prescreen) -> jax.stages.Compiled:
        """Spare a second compilation of the same program."""
        compiled.append(self)
        return program

    monkeypatch.setattr(Prescreen, "_compile", once)
    ahead.begin()
    assert ahead.shares(state, ranks).tolist() == trying.shares(state, ranks).tolist()
    assert compiled == [ahead]


def test_the_margin_is_that_of_the_criterion_on_starts(experiment: Experiment):
    margin = Prescreen(experiment).margin
    assert margin(0.9) == pytest.approx(0.0)
    assert margin(0.95) == pytest.approx(0.5)
    assert margin(0.8) < 0


def test_prescreening_is_off_unless_requested(experiment: Experiment):
    def of(**settings: int) -> Prescreen | None:
        examination = dataclasses.replace(experiment.config.examination, **settings)
        config = dataclasses.replace(experiment.config, examination=examination)
        return prescreen_of(dataclasses.replace(experiment, config=config))

    assert of() is not None
    assert of(tryout=0) is None
    assert of(candidates=0) is None


@pytest.mark.parametrize(
    ("shares", "order"),
    [
        ((0.92, 0.95, 1.0), [2, 1, 0]),
        ((0.92, 0.95, 0.92), [1, 0, 2]),  # of equal shares the fittest first
        ((0.5, 0.95, 0.89), [1, 2, 0]),
    ],
)
def test_the_best_come_first_with_their_margins(
    experiment: Experiment, tmp_path: Path, shares: tuple, order: list
):
    exams = Exams(tmp_path / "exams.jsonl")
    trying = Examiner(experiment, {}, lambda _: None, exams, Shares(*shares))
    found = trying._in_order(experiment.init(), [0, 1, 2])
    assert found == [(rank, shares[rank] - 0.9) for rank in order]
    without = Examiner(experiment, {}, lambda _: None, exams)
    assert without._in_order(experiment.init(), [0, 1, 2]) == [(n, np.inf) for n in range(3)]
