"""The report of a study with made-up results."""

import dataclasses
from pathlib import Path

import pytest
from helpers import STOOL

from mjxgait.creature import Creature
from mjxgait.experiments.ablation.measures import Result
from mjxgait.experiments.ablation.plan import (
    Plan,
    Study,
    VariantTable,
    make_plan,
)
from mjxgait.experiments.ablation.report import write_report

SEEDS = 16
RESULT = Result(
    "base",
    0,
    walk=0.5,
    up=1.0,
    certified=None,
    fitness=1.0,
    area=0.8,
    generations=5,
    steps=1000,
    finite=True,
)


def report(
    creature: Creature,
    folder: Path,
    measure: str = "walk",
    settings: dict | None = None,
    names: tuple[str, str] = ("base", "other"),
    question: str = "?",
    **other,
) -> str:
    """Report of two variants: the base's runs lie around RESULT, `other` changes the second's."""
    variants = (
        VariantTable(names[0]),
        VariantTable(names[1], settings or {"evolution": {"mutation_rate": 0.4}}),
    )
    study = Study(
        question,
        env=str(STOOL),
        seeds=SEEDS,
        generations=2,
        threshold=0.0,
        measure=measure,
        variant=variants,
    )
    plan = make_plan(study, creature, "study.toml")
    results = [_result(plan, run.variant, run.seed, other) for run in plan.runs]
    lines = [
        {
            "variant": r.variant,
            "seed": r.seed,
            "generation": g,
            "best": r.fitness + g if r.finite else None,
        }
        for r in results
        for g in range(3)
    ]
    return write_report(folder, plan, results, lines, "mjxgait ablate").read_text()


def _result(plan: Plan, variant: str, seed: int, other: dict) -> Result:
    spread = 0.01 * ((seed * 7) % SEEDS)
    found = dataclasses.replace(
        RESULT, variant=variant, seed=seed, walk=0.5 + spread, generations=5 + seed % 3
    )
    if variant == plan.variants[0]:
        return found
    shifted = {
        key: getattr(found, key) + value
        for key, value in other.items()
        if key in ("walk", "generations", "steps")
    }
    broken = (
        {"finite": False, "fitness": -1e9, "area": -1e9, "walk": 0.0}
        if seed in other.get("broken", ())
        else {}
    )
    return dataclasses.replace(found, **{**shifted, **broken})


def test_a_clear_difference_is_reported(stool: Creature, tmp_path: Path):
    assert "“other” is better than “base” by 0.30" in report(stool, tmp_path, walk=0.3)
    assert "“other” is worse than “base” by 0.30" in report(stool, tmp_path, walk=-0.3)


def test_fewer_generations_are_reported_as_better(stool: Creature, tmp_path: Path):
    assert "“other” is better than “base” by 3" in report(
        stool, tmp_path, "generations", generations=-3
    )


def test_a_missing_difference_is_not_reported_as_proof_of_none(stool: Creature, tmp_path: Path):
    text = report(stool, tmp_path)
    assert "no difference is shown" in text
    assert "That is not proof of none" in text


def test_broken_runs_are_named_and_count_as_the_worst(stool: Creature, tmp_path: Path):
    """Six of sixteen are more than the interquartile mean cuts off."""
    text = report(stool, tmp_path, broken=range(6))
    assert "counted as the worst: other, seed 0; other, seed 1" in text
    assert "“other” is worse than “base”" in text


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"steps": 1000}, "equal generations are not equal cost"),
        ({"measure": "fitness", "settings": {"fitness": {"speed": 0.5}}}, "not on one scale"),
    ],
)
def test_variants_that_are_not_comparable_are_reported(
    stool: Creature, tmp_path: Path, keys: dict, words: str
):
    assert words in report(stool, tmp_path, **keys)
    assert words not in report(stool, tmp_path)


def test_names_and_questions_are_escaped(stool: Creature, tmp_path: Path):
    """No HTML and no remote picture in the page, no formula in the table."""
    names = ("=1+1", "<img src=x> ![a](http://x) | b")
    report(stool, tmp_path, names=names, question="<script>alert(1)</script>\n# more")
    page = (tmp_path / "report.html").read_text()
    for unwanted in ("<script", "<img src=x", 'src="http', "<h1>more"):
        assert unwanted not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; # more" in page
    rows = (tmp_path / "results.csv").read_text().splitlines()
    assert rows[1].startswith("'=1+1,0,0.5,")


def test_numbers_of_a_table_stay_numbers(stool: Creature, tmp_path: Path):
    report(stool, tmp_path, walk=-1.0)
    assert any(",-0." in row for row in (tmp_path / "results.csv").read_text().splitlines())
