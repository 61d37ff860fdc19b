"""Every shipped study runs to its report: its own variants, with few individuals and short episodes."""

import dataclasses
import tomllib
from functools import partial
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import tomli_w
from end_to_end.shipped import STUDIES, creature_of
from helpers import STOOL, said_by

from mjxgait.ablation.plan import Study
from mjxgait.champion import Champion
from mjxgait.cluster import board
from mjxgait.cluster.crew import Report
from mjxgait.cluster.here import Here
from mjxgait.cluster.jobs import Advanced, AdvanceRows
from mjxgait.cluster.programs import Programs
from mjxgait.cluster.recipe import Recipe
from mjxgait.runs.experiment import Experiment
from mjxgait.runs.packed import pack
from mjxgait.settings.shipped import data_folder
from mjxgait.settings.tables import merge

SEEDS, ROWS = 2, 2
"""The fewest seeds of a study; of all studies, runs of the same shape share a program."""
SHARED = Programs()
EVOLVED = "thesis"
"""The study that is evolved every time; the others compile for minutes."""


class Unevolved(Here):
    """A worker that evolves nothing: champions are the first of the first population.

    Bodies, settings, starts and genomes are made as ever; no generation is compiled.
    """

    def wait(self, seconds: float) -> list[Report]:
        """See `Hands`."""
        if self._work is None:
            return []
        (worker, recipe, job), self._work = self._work, None
        return [Report(worker, first_population(recipe, job))]


def first_population(recipe: Recipe, job: AdvanceRows) -> Advanced:
    """Return what evolution would, as if nothing came of it."""
    batch = SHARED.batch(recipe)
    packed = job.state or pack(batch.init())
    rows = range(len(batch.experiments))
    begun = -1 if job.state is None else job.state.generation
    lines = [[line_of(g) for _ in rows] for g in range(begun + 1, job.until + 1)]
    after = packed.with_arrays({"generation": np.full(len(rows), job.until, np.int32)})
    ends = [row for row in rows if batch.experiments[row].config.evolution.generations == job.until]
    champions = {row: champion_of(batch.experiments[row]) for row in ends}
    return Advanced(after, lines, "", 1.0, len(rows), champions)


def line_of(generation: int) -> dict[str, Any]:
    """Return a line of the log of a run that has not got better."""
    told = {"best": 0.5, "mean": 0.25, "sim_steps": 10, "forced": False, "term_distance": 0.5}
    return {"generation": generation} | told


def champion_of(experiment: Experiment) -> Champion:
    """Return the first genome of the first population."""
    state = experiment.init()
    known = {"fitness": jnp.ones_like(state.fitness), "terms": jnp.zeros_like(state.terms)}
    return experiment.champion(dataclasses.replace(state, **known), {})


def shrunk(name: str) -> dict:
    """The study on a small body, each variant with few individuals and short episodes."""
    path = data_folder("configs") / "ablations" / f"{name}.toml"
    study = tomllib.loads(path.read_text(encoding="utf-8"))
    # The thesis's configuration has 40 of its own.
    few: dict = {"evolution": {"population": 4}, "rollout": {"seconds": 0.3, "lanes": 2}}
    if study.get("env") == "blocks":
        few["fitness"] = {"settle": 0.1}
    for variant in study["variant"]:
        settings = variant.get("settings", {})
        own = "population" in settings.get("evolution", {})
        small = few | {"evolution": {"population": 6}} if own else few
        variant["settings"] = merge(settings, small)
    if study.get("env", Study.env) == Study.env:
        study["env"] = str(STOOL)
    return study | {"allow_equal": True}


@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_a_study_ends_with_its_report(
    name: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
):
    """With `--thorough` every study is evolved."""
    evolves = name == EVOLVED or request.config.getoption("--thorough")
    monkeypatch.setattr(board, "Here", partial(Here if evolves else Unevolved, SHARED))
    file, out = tmp_path / f"{name}.toml", tmp_path / "out"
    file.write_text(tomli_w.dumps(shrunk(name)))
    given = ("--generations", 1, "--seeds", SEEDS, "--rows", ROWS, "--out", out)
    said = said_by(capsys, "ablate", file, *given, code=0)
    report = (out / "report.md").read_text()
    assert report in said
    variants = shrunk(name)["variant"]
    assert all(variant["name"] in report for variant in variants)
    assert len((out / "results.csv").read_text().splitlines()) == 1 + SEEDS * len(variants)


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_can_be_run_as_it_is_shipped(name: str, capsys: pytest.CaptureFixture):
    """All its variants, on its own creature: each can be examined in the end."""
    said = said_by(capsys, "ablate", name, "--dry-run", "--hours", 1000, code=0)
    assert "runs in" in said


def test_there_are_studies():
    assert {"thesis", "blocks", "lamp"} <= set(STUDIES)
    assert {shrunk(name)["env"] for name in STUDIES} == {str(STOOL), "blocks", "luxo"}
    assert all(creature_of(name) for name in ("blocks", "luxo"))
