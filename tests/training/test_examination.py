"""When a run validates its best individuals, and when that ends the run."""

import concurrent.futures
import dataclasses
import io
import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import STOOL, Shares, made_up_evaluate, small_config
from rich.console import Console

from mjxgait.certification import (
    Certificate,
    CertificateConfig,
    Criterion,
    Measure,
)
from mjxgait.certification.stress import Stress, StressConfig, Trial
from mjxgait.config.schema import ExaminationConfig
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.evolution.state import EvolutionState
from mjxgait.inspect.snapshot import read_snapshot
from mjxgait.training import examination, loop, stages
from mjxgait.training.examination import Examiner, due
from mjxgait.training.examination import Validation as RunLooks
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.folder import CERTIFICATE, EXAMS, create_run
from mjxgait.training.logs import read_metrics
from mjxgait.training.screen import Screen
from mjxgait.training.stored import stored_generations

SECONDS = 0.4


def certificate(margin: float, attempts: int = 1) -> Certificate:
    """A certificate with a single measure."""
    measure = Measure("speed", 0.5 + margin, ">=", 0.5, 1.0)
    return Certificate(
        "stool",
        "",
        "walk",
        "",
        (Criterion(2, "progress", (measure,)),),
        {"summary": "walk, 1.00 m/s", "overlap": None},
        CertificateConfig(),
        1.0,
        attempts,
    )


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    config = small_config(evolution={"population": 6, "generations": 9})
    return build_experiment(
        load_creature(STOOL),
        dataclasses.replace(config, examination=ExaminationConfig(every=3, enough=0.2)),
    )


def state_with(
    experiment: Experiment, generation: int, speed: float = 0.7, alive: float = 1.0
) -> EvolutionState:
    """A population with a best that walks at `speed`, in body lengths/s, on both starts."""
    state, names = experiment.init(), experiment.simulator.task.outcomes
    best = np.zeros(state.outcome.shape[1:], np.float32)
    best[:, names.index("forward")] = speed * SECONDS * experiment.creature.frame.body_length
    best[:, names.index("seconds")] = [SECONDS, alive * SECONDS]
    return dataclasses.replace(
        state,
        generation=jnp.int32(generation),
        fitness=state.fitness.at[0].set(0.0),
        outcome=state.outcome.at[0].set(best),
    )


class Validations:
    """Scripted results of the checks (the last of a list repeats), and a record of the calls."""

    def __init__(self) -> None:
        self.nominal, self.trial_runs, self.certificates = [0.3], [0.3], [0.3]
        self.requested: list[str] = []
        self.wanted: list[float] = []
        self.cautions: list[float] = []
        self.starts: list[int] = []

    def answer(self, kind: str, answers: list[float]) -> float:
        self.requested.append(kind)
        return answers[min(self.requested.count(kind), len(answers)) - 1]


@pytest.fixture
def validations(monkeypatch: pytest.MonkeyPatch) -> Validations:
    said = Validations()

    def nominal_check(*_: object) -> SimpleNamespace:
        return SimpleNamespace(margin=said.answer("nominal check", said.nominal))

    def certify(*_: object, attempts: int, **__: object) -> Certificate:
        return certificate(said.answer("exam", said.certificates), attempts)

    monkeypatch.setattr(examination, "nominal_check", nominal_check)

    def trial_run(*args: Any, wanted: float, caution: float) -> float:
        said.starts.append(args[2])
        said.wanted.append(wanted)
        said.cautions.append(caution)
        return said.answer("trial run", said.trial_runs)

    monkeypatch.setattr(examination, "trial_run", trial_run)
    monkeypatch.setattr(examination, "certify", certify)
    return said


@pytest.fixture
def exams(tmp_path: Path) -> Exams:
    return Exams(tmp_path / "exams.jsonl")


def test_validation_is_due_every_few_generations_but_not_at_the_first():
    settings = ExaminationConfig(every=5)
    assert [g for g in range(-1, 21) if due(settings, g)] == [5, 10, 15, 20]
    assert not any(due(ExaminationConfig(every=0), g) for g in range(20))
    assert not any(due(ExaminationConfig(candidates=0), g) for g in range(20))


def test_trial_runs_use_the_caution_of_the_settings(
    experiment: Experiment, validations: Validations, exams: Exams
):
    examiner(experiment, exams, caution=1.5).best(ranked(experiment))
    assert set(validations.cautions) == {1.5}


def examiner(experiment: Experiment, exams: Exams, **settings: float | str) -> Examiner:
    """An `Examiner` with other examination settings."""
    examination = dataclasses.replace(experiment.config.examination, **settings)
    config = dataclasses.replace(experiment.config, examination=examination)
    return Examiner(dataclasses.replace(experiment, config=config), {}, lambda _: None, exams)


def ranked(experiment: Experiment, generation: int = 9) -> EvolutionState:
    """A population at its last generation, sorted by fitness."""
    return dataclasses.replace(
        experiment.init(), fitness=jnp.arange(6.0)[::-1], generation=jnp.int32(generation)
    )


def test_a_promising_best_with_margin_is_certified_and_ends_the_run(experiment, validations, exams):
    examined = examiner(experiment, exams).early(state_with(experiment, 3))
    assert examined is not None
    assert validations.requested == ["nominal check", "trial run", "exam"]
    assert examined.certificate.margin == pytest.approx(0.3)
    assert examined.champion.origin["generation"] == 3


@pytest.mark.parametrize(
    ("generation", "speed", "alive", "nominal_check", "trial_margin", "requested"),
    [
        (4, 0.7, 1.0, 0.3, 0.3, 0),  # no validation is due
        (3, 0.55, 1.0, 0.3, 0.3, 0),  # hardly faster than required
        (3, 0.7, 0.9, 0.3, 0.3, 0),  # falls on one of its starts
        (3, 0.7, 1.0, 0.1, 0.3, 1),  # fails, or nearly, without disturbance
        (3, 0.7, 1.0, 0.3, 0.1, 2),  # stays up, but with too little margin
    ],
)
def test_otherwise_the_run_continues_without_further_checks(
    experiment, validations, exams, generation, speed, alive, nominal_check, trial_margin, requested
):
    validations.nominal, validations.trial_runs = [nominal_check], [trial_margin]
    state = state_with(experiment, generation, speed, alive)
    assert examiner(experiment, exams).early(state) is None
    assert len(validations.requested) == requested
    assert exams.taken(9) == 0


def test_a_failed_candidate_is_not_validated_again(experiment, validations, exams):
    validations.trial_runs = [0.1]
    same = examiner(experiment, exams)
    for _ in range(2):
        assert same.early(state_with(experiment, 3)) is None
    assert validations.requested == ["nominal check", "trial run"]


def test_in_the_second_half_any_positive_margin_leads_to_an_attempt(experiment, validations, exams):
    validations.trial_runs = [0.1]
    same = examiner(experiment, exams)
    assert same.early(state_with(experiment, 3)) is None
    assert same.early(state_with(experiment, 6)) is not None
    assert validations.wanted == pytest.approx([0.2, 0.0])
    validations.trial_runs = [-0.1]
    assert examiner(experiment, exams).early(state_with(experiment, 6)) is None


def test_any_certificate_that_passes_ends_the_run(experiment, validations, exams):
    validations.certificates = [0.01]
    assert examiner(experiment, exams).early(state_with(experiment, 3)) is not None


def test_a_failed_champion_is_not_retried_and_the_next_is_attempt_two(
    experiment, validations, exams
):
    validations.certificates = [-0.1, 0.3]
    assert examiner(experiment, exams).early(state_with(experiment, 3)) is None
    # A resumed run reads the failure from the file.
    assert examiner(experiment, exams).early(state_with(experiment, 6)) is None
    assert validations.requested.count("exam") == 1
    examined = examiner(experiment, exams).early(other_best(state_with(experiment, 6)))
    assert examined is not None
    assert examined.certificate.attempts == 2
    assert validations.requested.count("exam") == 2


def test_after_a_failed_certificate_more_starts_choose(experiment, validations, exams):
    """The one that failed was lucky on the usual draw. What missed that one is tried again."""
    validations.certificates, validations.trial_runs = [-0.1, 0.3], [0.1, 0.3, 0.3]
    said: list[str] = []
    same = dataclasses.replace(examiner(experiment, exams), tell=said.append)
    missed = other_best(state_with(experiment, 3))
    assert same.early(missed) is None
    assert same.early(state_with(experiment, 3)) is None
    assert said[-1] == "Not certified: speed 0.4 (>= 0.5 required)."
    assert same.early(missed) is not None
    draws = experiment.config.examination.draws
    assert validations.starts == [draws, draws, 4 * draws]


def test_the_second_candidate_is_validated_where_the_first_fails(experiment, validations, exams):
    state = state_with(experiment, 3)
    both = dataclasses.replace(
        state,
        fitness=state.fitness.at[1].set(-1.0),
        outcome=state.outcome.at[1].set(state.outcome[0]),
    )
    validations.trial_runs = [-0.1, 0.3]
    assert examiner(experiment, exams).early(both) is None
    validations.requested.clear()
    examined = examiner(experiment, exams, on_the_way=2).early(both)
    assert examined is not None
    assert examined.champion.fitness == -1.0


def test_individuals_with_equal_fitness_are_one_candidate(experiment):
    alike = dataclasses.replace(ranked(experiment), fitness=jnp.float32([3, 3, 2, 2, 2, 1]))
    assert experiment.candidates(alike) == [0, 2, 5]


class RequestedTrials:
    """Scripted results of the second level, and whether each call was hasty and a rehearsal."""

    def __init__(self, *shares: float) -> None:
        self.shares, self.hasty, self.rehearsed = list(shares), list[bool](), list[bool]()

    def __call__(self, *_: object, hasty: bool, draw: object = None) -> Stress:
        self.hasty.append(hasty)
        self.rehearsed.append(draw is not None)
        share = self.shares.pop(0)
        return Stress("", (Trial("friction 0.4", share, share >= 0.9),), StressConfig())


def test_level_anywhere_ends_the_run_only_if_the_stress_test_passes(
    experiment, validations, exams, monkeypatch: pytest.MonkeyPatch
):
    """The certificate alone ends no run; if it fails, no stress test follows."""
    requested = RequestedTrials(0.9, 0.5, 0.95, 0.95)
    monkeypatch.setattr(examination, "stress", requested)
    anywhere = {"level": "anywhere", "attempts": 4}
    state = state_with(experiment, 3)
    assert examiner(experiment, exams, **anywhere).early(state) is None
    examined = examiner(experiment, exams, **anywhere).early(other_best(state))
    assert examined is not None
    assert examined.passed
    assert examined.beyond is not None
    validations.certificates = [-0.1]
    assert not examiner(experiment, exams, **anywhere).best(ranked(experiment)).passed
    assert requested.hasty == [True, True, True, True]
    assert requested.rehearsed == [True, False, True, False]


def test_a_failed_rehearsal_of_the_stress_tests_takes_no_attempt(
    experiment, validations, exams, monkeypatch: pytest.MonkeyPatch
):
    """It is neither examined nor rehearsed again."""
    requested = RequestedTrials(0.5)
    monkeypatch.setattr(examination, "stress", requested)
    anywhere, state = examiner(experiment, exams, level="anywhere"), state_with(experiment, 3)
    assert anywhere.early(state) is None
    assert anywhere.early(state) is None
    assert "exam" not in validations.requested
    assert requested.rehearsed == [True]


def test_at_the_end_the_whole_second_level_is_tested(
    experiment, validations, exams, monkeypatch: pytest.MonkeyPatch
):
    requested = RequestedTrials(0.5)
    monkeypatch.setattr(examination, "stress", requested)
    examined = examiner(experiment, exams, level="anywhere").best(ranked(experiment))
    assert examined.certificate.passed
    assert not examined.passed
    assert requested.hasty == [False]


def other_best(state: EvolutionState) -> EvolutionState:
    """The state with another best genome."""
    genomes = jax.tree.map(lambda leaf: leaf.at[0].set(leaf[1]), state.genomes)
    return dataclasses.replace(state, genomes=genomes)


def test_the_last_attempt_is_kept_for_the_end(experiment, validations, exams):
    validations.certificates = [-0.1]
    state = state_with(experiment, 3)
    two = examiner(experiment, exams, attempts=2)
    assert two.early(state) is None
    assert two.early(other_best(state)) is None
    assert validations.requested.count("exam") == 1
    assert two.best(ranked(experiment)).certificate.attempts == 2


def test_at_the_end_only_the_first_with_enough_margin_is_certified(experiment, validations, exams):
    settings = {"candidates": 3, "difference": 0.0}
    validations.trial_runs = [0.1, 0.25, 0.9]
    examined = examiner(experiment, exams, **settings).best(ranked(experiment))
    assert examined.certificate.passed
    assert validations.requested == ["nominal check", "trial run"] * 2 + ["exam"]
    assert examined.champion.fitness == 4.0


ONE = ["nominal check", "trial run"]


@pytest.mark.parametrize(
    ("attempts", "certificates", "requested", "fitness"),
    [
        (1, [-0.5], [*ONE * 2, "exam"], 4.0),
        (2, [-0.5], [*ONE * 2, "exam", *ONE, "exam"], 4.0),
        (3, [-0.5], [*ONE * 2, "exam", *ONE, "exam", "exam"], 4.0),
        (3, [-0.5, 0.3], [*ONE * 2, "exam", *ONE, "exam"], 3.0),
        (3, [-0.5, -0.5, 0.3], [*ONE * 2, "exam", *ONE, "exam", "exam"], 5.0),
    ],
)
def test_at_the_end_a_run_uses_its_remaining_attempts(
    experiment, validations, exams, attempts, certificates, requested, fitness
):
    """The second and third candidates have enough margin, the first has a little."""
    settings = {"candidates": 3, "difference": 0.0, "attempts": attempts}
    validations.trial_runs, validations.certificates = [0.1, 0.25, 0.9], certificates
    examined = examiner(experiment, exams, **settings).best(ranked(experiment))
    assert validations.requested == requested
    assert examined.champion.fitness == fitness
    assert exams.taken(9) == validations.requested.count("exam") <= attempts


def test_at_the_end_no_further_candidate_that_would_fail_is_certified(
    experiment, validations, exams
):
    """A candidate without margin is certified only so that the run has a result."""
    settings = {"candidates": 3, "difference": 0.0}
    validations.trial_runs, validations.certificates = [-0.3, -0.1, -0.2], [-0.5]
    examined = examiner(experiment, exams, **settings).best(ranked(experiment))
    assert validations.requested == [*ONE * 3, "exam"]
    assert examined.champion.fitness == 4.0


def test_at_the_end_the_best_margin_is_certified_where_none_is_enough(
    experiment, validations, exams
):
    settings = {"candidates": 3, "difference": 0.0}
    validations.nominal, validations.trial_runs = [-0.3, 0.3, 0.3], [0.05, 0.15]
    examined = examiner(experiment, exams, **settings).best(ranked(experiment))
    assert examined.champion.fitness == 3.0
    # No disturbed trials after a failed nominal check.
    assert validations.requested == ["nominal check", *["nominal check", "trial run"] * 2, "exam"]
    # A trial run ends once it can neither pass nor exceed the best so far.
    assert validations.wanted == pytest.approx([-0.3, 0.0])


def test_during_the_run_the_best_in_prescreening_are_validated(experiment, validations, exams):
    """Fitness does not matter; candidates below the wanted margin are skipped."""
    state = state_with(experiment, 6)
    all_alike = dataclasses.replace(
        state,
        fitness=jnp.arange(6.0)[::-1],
        outcome=jnp.tile(state.outcome[:1], (6, 1, 1)),
    )
    settings = {"candidates": 4, "difference": 0.0, "on_the_way": 2}
    validations.trial_runs = [-0.1]
    same = dataclasses.replace(
        examiner(experiment, exams, **settings), prescreen=Shares(0.8, 0.92, 0.85, 0.95)
    )
    assert same.early(all_alike) is None
    assert validations.requested == [*ONE * 2]
    validations.requested.clear()
    one = dataclasses.replace(same, prescreen=Shares(0.8, 0.92, 0.85, 0.85), _margins={})
    assert one.early(all_alike) is None
    assert validations.requested == ONE
    validations.trial_runs = [0.3]
    examined = dataclasses.replace(same, _margins={}).early(all_alike)
    assert examined.champion.fitness == 2.0


def test_at_the_end_prescreening_failures_are_validated_only_if_all_fail(
    experiment, validations, exams
):
    settings = {"candidates": 3, "difference": 0.0}
    validations.trial_runs = [0.1]
    some = dataclasses.replace(
        examiner(experiment, exams, **settings), prescreen=Shares(0.5, 0.95, 0.92)
    )
    assert some.best(ranked(experiment)).champion.fitness == 4.0
    assert validations.requested == [*ONE * 2, "exam"]
    validations.requested.clear()
    none = dataclasses.replace(
        examiner(experiment, exams, **settings), prescreen=Shares(0.5, 0.6, 0.7)
    )
    assert none.best(ranked(experiment)).champion.fitness == 3.0
    assert validations.requested == [*ONE, "exam"]


def test_at_the_end_a_candidate_that_has_failed_before_is_not_chosen(
    experiment, validations, exams
):
    settings = {"candidates": 2, "difference": 0.0, "attempts": 1}
    validations.certificates = [-0.1]
    # The same two candidates in three generations.
    chosen = [
        examiner(experiment, exams, **settings).best(ranked(experiment, generation))
        for generation in (7, 8, 9)
    ]
    assert [c.champion.fitness for c in chosen] == [5.0, 4.0, 5.0]
    # No candidate was left in the last: the failure stands, and is no further attempt.
    assert [c.certificate.attempts for c in chosen] == [1, 2, 1]
    assert exams.taken(9) == 2
    # A repetition gives the same result.
    assert examiner(experiment, exams, **settings).best(ranked(experiment, 8)).champion.fitness == 4


@pytest.fixture
def promising(monkeypatch: pytest.MonkeyPatch, validations: Validations) -> None:
    """All individuals are promising, so that the small run is validated."""
    monkeypatch.setattr(examination, "_promising", lambda *_: True)


@pytest.fixture(scope="module", autouse=True)
def made_up_verdicts() -> Iterator[None]:
    """Runs evolve but simulate nothing, like their validation."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "evaluate", made_up_evaluate)
        yield


def trained(folder: Path, experiment: Experiment, resume: bool = False) -> str:
    said = io.StringIO()
    loop.train(
        folder,
        experiment.creature,
        experiment.config,
        Screen(Console(file=said, width=200)),
        resume=resume,
    )
    return said.getvalue()


def test_a_certified_run_ends_early_and_stays_ended(
    tmp_path: Path, experiment: Experiment, promising: None
):
    folder = tmp_path / "run"
    create_run(folder, experiment.creature, experiment.config)
    assert "Certified with a margin of 0.30 in generation 3" in trained(folder, experiment)
    assert read_metrics(folder / "metrics.jsonl")[-1]["generation"] == 3
    assert read_snapshot(folder).generation == 3
    before = (folder / "champion.json").read_text(), (folder / CERTIFICATE).read_text()
    assert "in generation 3" in trained(folder, experiment, resume=True)
    assert before == ((folder / "champion.json").read_text(), (folder / CERTIFICATE).read_text())


def files_of(folder: Path) -> dict[str, str]:
    """The results of a run, without its timings."""
    names = ("champion.json", CERTIFICATE, EXAMS)
    found = {name: (folder / name).read_text() for name in names}
    clock = ("steps_per_second", "wall_s")
    lines = read_metrics(folder / "metrics.jsonl")
    told = [{key: value for key, value in line.items() if key not in clock} for line in lines]
    return found | {"log": json.dumps(told), "checkpoints": str(stored_generations(folder))}


def test_generations_evolved_during_a_passing_validation_are_dropped(
    tmp_path: Path,
    experiment: Experiment,
    promising: None,
    validations: Validations,
    monkeypatch: pytest.MonkeyPatch,
):
    """Whatever ends first, the folder equals that of a run that waited."""
    waited, beside = tmp_path / "waited", tmp_path / "beside"
    seen: list[int] = []
    soon = examination.nominal_check

    def late(*arguments: object) -> SimpleNamespace:
        until = time.monotonic() + 60
        while not seen and time.monotonic() < until:
            lines = read_metrics(beside / "metrics.jsonl")
            # By then a checkpoint is due; it must wait.
            seen.extend(line["generation"] for line in lines if line["generation"] > 4)
            time.sleep(0.01)
        return soon(*arguments)

    def never_beside(self: RunLooks, state: EvolutionState) -> None:
        begin(self, state)
        if self._result is not None:
            concurrent.futures.wait([self._result])

    for folder in (waited, beside):
        create_run(folder, experiment.creature, experiment.config)
    begin = RunLooks.begin
    with monkeypatch.context() as patch:
        patch.setattr(RunLooks, "begin", never_beside)
        trained(waited, experiment)
    monkeypatch.setattr(examination, "nominal_check", late)
    said = trained(beside, experiment)
    assert "up to generation 5, is forgotten" in said
    assert "Certified with a margin of 0.30 in generation 3" in said
    assert seen, "the look had ended before a further generation had"
    assert files_of(beside) == files_of(waited)


@pytest.mark.parametrize("what", ["trial_run", "certify"])
def test_at_most_one_generation_evolves_during_disturbed_walks(
    tmp_path: Path,
    experiment: Experiment,
    promising: None,
    monkeypatch: pytest.MonkeyPatch,
    what: str,
):
    """They take all cores; only the generation that has begun is finished."""
    folder, latest, soon = tmp_path / "run", [], getattr(examination, what)

    def slow(*arguments: object, **settings: object) -> object:
        for _ in range(2):
            latest.append(read_metrics(folder / "metrics.jsonl")[-1]["generation"])
            time.sleep(0.5)
        return soon(*arguments, **settings)

    monkeypatch.setattr(examination, what, slow)
    create_run(folder, experiment.creature, experiment.config)
    assert "in generation 3" in trained(folder, experiment)
    assert latest[1] - latest[0] <= 1


def test_an_error_in_validation_ends_the_run(
    tmp_path: Path, experiment: Experiment, promising: None, monkeypatch: pytest.MonkeyPatch
):
    def full(*_: object, **__: object) -> Certificate:
        raise UserError("the disk is full")

    monkeypatch.setattr(examination, "certify", full)
    create_run(tmp_path / "run", experiment.creature, experiment.config)
    with pytest.raises(UserError, match="the disk is full"):
        trained(tmp_path / "run", experiment)


def test_a_run_that_never_passes_goes_on_to_the_end(
    tmp_path: Path, experiment: Experiment, promising: None, validations: Validations
):
    validations.certificates, validations.trial_runs = [-0.5], [0.3, 0.4, 0.5]
    validations.nominal = [1.0]
    folder = tmp_path / "run"
    create_run(folder, experiment.creature, experiment.config)
    said = trained(folder, experiment)
    assert "All 9 generations are done" in said
    tries = validations.requested.count("exam")
    assert 2 <= tries <= experiment.config.examination.attempts
    assert f"This was examination {tries} of its run" in said
    written = (folder / CERTIFICATE).read_text(), (folder / EXAMS).read_text()
    assert json.loads(written[0])["attempts"] == tries
    # Resumed from an earlier checkpoint, it repeats its attempts; they count once.
    shutil.rmtree(folder / "checkpoints" / "9")
    trained(folder, experiment, resume=True)
    assert written == ((folder / CERTIFICATE).read_text(), (folder / EXAMS).read_text())
