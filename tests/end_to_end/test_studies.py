"""Every shipped study ends with its report, with few individuals and short episodes."""

import tomllib
from pathlib import Path

import pytest
import tomli_w
from end_to_end.shipped import STUDIES, creature_of
from helpers import STOOL, said_by

from mjxgait.config.layers import data_folder
from mjxgait.config.tables import merge
from mjxgait.experiments.ablation.plan import Study, read_study

SEEDS = 2
"""Minimum number of seeds of a study."""


def shrunk(name: str) -> dict:
    """The study on a small body, each variant with few individuals and short episodes."""
    path = data_folder("configs") / "ablations" / f"{name}.toml"
    study = tomllib.loads(path.read_text(encoding="utf-8"))
    # Configuration wilson has its own population of 40.
    few: dict = {"evolution": {"population": 4}, "rollout": {"seconds": 0.3, "lanes": 2}}
    if "grounds" in study:  # every initial condition drawn needs its own rough ground
        few["rollout"]["variety"] = 2
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
def test_a_study_ends_with_its_report(name: str, tmp_path: Path, capsys: pytest.CaptureFixture):
    """`--thorough` evolves every study; tests/experiments/ablation evolves one."""
    file, out = tmp_path / f"{name}.toml", tmp_path / "out"
    file.write_text(tomli_w.dumps(shrunk(name)))
    rows = ("--rows", SEEDS) if name == "null" else ()
    given = ("--generations", 1, "--seeds", SEEDS, *rows, "--out", out)
    said = said_by(capsys, "ablate", file, *given, code=0)
    assert f"in {len(list((out / 'groups').iterdir()))} program" in said
    assert f"in {len(shrunk(name)['variant'])} program" in said or not rows
    report = (out / "report.md").read_text()
    assert report in said
    variants = shrunk(name)["variant"]
    assert all(variant["name"] in report for variant in variants)
    assert len((out / "results.csv").read_text().splitlines()) == 1 + SEEDS * len(variants)


@pytest.mark.parametrize("name", STUDIES)
def test_a_shipped_study_can_be_run_unchanged(name: str, capsys: pytest.CaptureFixture):
    """All variants on their own creature can be certified; seeds differ in nothing else."""
    study = read_study(Path(name), {})
    few = ("--dry-run", "--seeds", SEEDS)
    said = said_by(capsys, "ablate", name, *few, "--hours", 1000, code=0)
    assert f"{SEEDS} seeds = {SEEDS * len(study.variant)} runs in" in said


def test_the_studies_cover_a_walker_blocks_and_the_lamp():
    assert {"thesis", "blocks", "lamp"} <= set(STUDIES)
    assert {shrunk(name)["env"] for name in STUDIES} == {str(STOOL), "blocks", "luxo"}
    assert all(creature_of(name) for name in ("blocks", "luxo"))
