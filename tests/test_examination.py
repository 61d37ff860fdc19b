"""When a run looks at its best, and when that ends it."""

import dataclasses
import io
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import STOOL, small_config
from rich.console import Console

from mjxgait import examination, run
from mjxgait.certify import Certificate, CertificateConfig, Criterion, Measure
from mjxgait.config import ExaminationConfig
from mjxgait.creature import load_creature
from mjxgait.evolution import EvolutionState
from mjxgait.examination import Examiner, due
from mjxgait.experiment import Experiment, build_experiment
from mjxgait.fitness import TERMS
from mjxgait.folder import CERTIFICATE, create_run, read_metrics
from mjxgait.inspect.snapshot import read_snapshot
from mjxgait.screen import Screen

SECONDS = 0.4


def certificate(margin: float) -> Certificate:
    """One that depends on a single measure."""
    measure = Measure("speed", 0.5 + margin, ">=", 0.5, 1.0)
    return Certificate(
        "stool",
        "",
        "",
        (Criterion(2, "progress", (measure,)),),
        {"gait": "walk", "speed": 1.0},
        CertificateConfig(),
        1.0,
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
    """A population whose best walks at a speed in body lengths/s on both starts."""
    state = experiment.init()
    best = np.zeros(state.terms.shape[1:], np.float32)
    best[:, TERMS.index("distance")] = speed * SECONDS
    best[:, TERMS.index("alive")] = [1.0, alive]
    return dataclasses.replace(
        state, generation=jnp.int32(generation), terms=state.terms.at[0].set(best)
    )


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[float]]:
    """What the examiner will say (`glance`, `certify`), and how often it was asked."""
    said: dict[str, list[float]] = {"glance": [0.3], "certify": [0.3], "asked": []}

    def glance(*_: object) -> SimpleNamespace:
        said["asked"].append(0.1)
        return SimpleNamespace(
            margin=said["glance"][min(said["asked"].count(0.1), len(said["glance"])) - 1]
        )

    monkeypatch.setattr(examination, "glance", glance)
    monkeypatch.setattr(
        examination,
        "certify",
        lambda *_, seen: said["asked"].append(1.0) or certificate(said["certify"][0]),
    )
    return said


def test_it_looks_every_few_generations_and_not_at_the_first():
    settings = ExaminationConfig(every=5)
    assert [g for g in range(-1, 21) if due(settings, g)] == [5, 10, 15, 20]
    assert not any(due(ExaminationConfig(every=0), g) for g in range(20))
    assert not any(due(ExaminationConfig(candidates=0), g) for g in range(20))


def test_a_promising_best_that_passes_with_room_ends_the_run(
    experiment: Experiment, looks: dict[str, list[float]]
):
    examined = Examiner(experiment, {}, lambda _: None).early(state_with(experiment, 3))
    assert examined is not None
    assert examined.certificate.margin == pytest.approx(0.3)
    assert examined.champion.origin["generation"] == 3


@pytest.mark.parametrize(
    ("generation", "speed", "alive", "glance", "certify", "asked"),
    [
        (4, 0.7, 1.0, 0.3, 0.3, 0),  # not the generation to look
        (3, 0.55, 1.0, 0.3, 0.3, 0),  # hardly faster than it must be
        (3, 0.7, 0.9, 0.3, 0.3, 0),  # falls on one of its starts
        (3, 0.7, 1.0, 0.1, 0.3, 1),  # fails, or nearly, when nobody disturbs it
        (3, 0.7, 1.0, 0.3, 0.1, 2),  # passes, but with too little room
    ],
)
def test_else_it_goes_on_and_spares_what_it_can(
    experiment: Experiment, looks, generation, speed, alive, glance, certify, asked
):
    looks["glance"], looks["certify"] = [glance], [certify]
    assert (
        Examiner(experiment, {}, lambda _: None).early(
            state_with(experiment, generation, speed, alive)
        )
        is None
    )
    assert len(looks["asked"]) == asked


def test_who_did_not_do_is_not_looked_at_again(
    experiment: Experiment, looks: dict[str, list[float]]
):
    looks["certify"] = [0.1]
    examiner = Examiner(experiment, {}, lambda _: None)
    for _ in range(2):
        assert examiner.early(state_with(experiment, 3)) is None
    assert looks["asked"] == [0.1, 1.0]


def test_in_the_second_half_any_pass_will_do(experiment: Experiment, looks: dict[str, list[float]]):
    looks["certify"] = [0.1]
    examiner = Examiner(experiment, {}, lambda _: None)
    assert examiner.early(state_with(experiment, 3)) is None
    assert examiner.early(state_with(experiment, 6)) is not None
    looks["certify"] = [-0.1]
    assert Examiner(experiment, {}, lambda _: None).early(state_with(experiment, 6)) is None


def test_in_the_end_nobody_is_examined_further_who_fails_undisturbed(
    experiment: Experiment, looks: dict[str, list[float]]
):
    config = dataclasses.replace(
        experiment.config, examination=ExaminationConfig(candidates=3, difference=0.0)
    )
    judged = dataclasses.replace(
        experiment.init(), fitness=jnp.arange(6.0)[::-1], generation=jnp.int32(9)
    )
    examiner = Examiner(dataclasses.replace(experiment, config=config), {}, lambda _: None)
    assert examiner.best(judged).certificate.passed
    assert looks["asked"] == [0.1, 1.0]  # the first does
    looks["asked"].clear()
    looks["glance"] = [-0.3]
    assert examiner.best(judged) is not None
    assert looks["asked"] == [
        0.1,
        0.1,
        0.1,
        1.0,
    ]  # none of three does, and one is examined to say why
    looks["asked"].clear()
    looks["glance"], looks["certify"] = [0.3, -0.3, -0.5], [-3.0]
    assert examiner.best(judged) is not None
    # The first falls when disturbed; the second, which fails by less, may be the nearest.
    assert looks["asked"] == [0.1, 1.0, 0.1, 0.1, 1.0]


@pytest.fixture
def promising(monkeypatch: pytest.MonkeyPatch, looks: dict[str, list[float]]) -> None:
    """Everybody is promising, so that the small run is looked at."""
    monkeypatch.setattr(examination, "_promising", lambda *_: True)


def trained(folder: Path, experiment: Experiment, resume: bool = False) -> str:
    said = io.StringIO()
    run.train(
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


def test_one_that_never_passes_goes_on_to_the_end(
    tmp_path: Path, experiment: Experiment, promising: None, looks: dict[str, list[float]]
):
    looks["certify"] = [-0.5]
    folder = tmp_path / "run"
    create_run(folder, experiment.creature, experiment.config)
    assert "All 9 generations are done" in trained(folder, experiment)
    assert (folder / CERTIFICATE).exists()
    assert looks["asked"].count(1.0) >= 2  # generation 3, and the best few at the end
