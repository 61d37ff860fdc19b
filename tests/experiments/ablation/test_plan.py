"""Contents of a study file; mistakes in it are reported before anything runs."""

import dataclasses
from pathlib import Path

import pytest
from helpers import STOOL

from mjxgait.config.layers import data_folder, resolve_config
from mjxgait.config.tables import build
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.experiments.ablation.plan import (
    Plan,
    Study,
    make_plan,
    read_study,
)
from mjxgait.experiments.ablation.rows import groups
from mjxgait.tasks.walk.targets import WalkTargets, with_targets

TWO = [{"name": "base"}, {"name": "half", "settings": {"evolution": {"mutation_rate": 0.4}}}]


def plan(stool: Creature, **keys) -> Plan:
    table = {
        "question": "?",
        "seeds": 3,
        "generations": 5,
        **({"variant": TWO} if "grid" not in keys else {}),
        **keys,
    }
    return make_plan(build(Study, table, "study.toml"), stool, "study.toml")


def test_every_variant_runs_with_every_seed(stool: Creature):
    found = plan(stool)
    assert found.variants == ("base", "half")
    assert [(run.variant, run.seed) for run in found.runs] == [
        (name, seed) for name in ("base", "half") for seed in range(3)
    ]
    assert [run.config.evolution.mutation_rate for run in found.runs] == [0.8] * 3 + [0.4] * 3
    assert all(run.config.seed == run.seed for run in found.runs)


def test_unpaired_variants_have_their_own_seeds(stool: Creature):
    assert [run.seed for run in plan(stool, paired=False, first_seed=10).runs] == [
        10,
        11,
        12,
        13,
        14,
        15,
    ]


def test_a_variant_with_its_own_config_ignores_that_of_the_study(stool: Creature):
    """The study's config and base do not apply to it; the settings common to all studies do."""
    tables = [
        {"name": "base"},
        {"name": "thesis", "config": "wilson"},
        {"name": "long", "config": "wilson", "settings": {"rollout": {"seconds": 8.0}}},
    ]
    found = plan(stool, variant=tables, base={"rollout": {"starts": 5}})
    shipped = resolve_config({}, stool.name, Path("wilson"))
    asked = (dataclasses.asdict(found.of(name)[1].config) for name in ("thesis", "long"))
    for table, seconds in zip(asked, (6.0, 8.0), strict=True):
        wanted = dataclasses.asdict(shipped) | {"seed": 1}
        wanted["evolution"] |= {"generations": 5}
        wanted["evolution"]["forced"] |= {"patience": 0}
        wanted["rollout"] |= {"seconds": seconds}
        assert table == wanted
    assert found.of("base")[0].config.rollout.starts == 5


def test_a_variant_can_have_a_target_gait_as_a_walk_can(stool: Creature):
    """An unsuitable gait is reported with the variant's name."""
    found = plan(stool, variant=[{"name": "base"}, {"name": "animal", "gait": "natural"}])
    assert found.of("base")[0].config.fitness.wish.requested == ()
    asked = found.of("animal")[0].config
    walk = with_targets(resolve_config({}, stool.name, None), stool, WalkTargets(gait="natural"))
    assert asked.fitness.wish == walk.fitness.wish
    assert asked.fitness.wish.stride == 1.0
    assert asked.controller == walk.controller
    with pytest.raises(UserError, match='variant "animal": --gait flight'):
        plan(stool, variant=[{"name": "base"}, {"name": "animal", "gait": "flight"}])


def test_a_grid_is_the_base_and_every_combination(stool: Creature):
    found = plan(stool, grid={"evolution.mutation_rate": [0.2, 0.6], "drive.law": ["pd"]})
    assert found.variants == (
        "base",
        "mutation_rate = 0.2, law = pd",
        "mutation_rate = 0.6, law = pd",
    )


def test_no_run_stops_early(stool: Creature):
    """A run that stopped early would be compared with runs of more generations."""
    for run in plan(stool, base={"evolution": {"target": 1.0, "forced": {"patience": 2}}}).runs:
        assert run.config.evolution.target is None
        assert run.config.evolution.forced.patience == 0


def test_values_share_a_program_and_shapes_need_one_each(stool: Creature):
    variants = [
        *TWO,
        {"name": "poses", "settings": {"controller": {"key_poses": 3}}},
        {"name": "more", "generations": 9},
    ]
    variants[3]["settings"] = {"fitness": {"speed": 0.5}}
    variants.append({"name": "no end", "settings": {"rollout": {"terminate": False}}})
    parts = groups(plan(stool, variant=variants))
    assert [sorted({run.variant for run in part}) for part in parts] == [
        ["base", "half", "more"],
        ["poses"],
        ["no end"],
    ]


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (
            {"variant": [TWO[0], {"name": "x", "settings": {"evolution": {"mutation_rat": 0.4}}}]},
            ['variant "x"', "mutation_rat", "mutation_rate"],
        ),
        (
            {"variant": [TWO[0], {"name": "x", "settings": {"evolution": {"mutation_rate": 4.0}}}]},
            ['variant "x"', "mutation_rate"],
        ),
        ({"variant": [TWO[0], {"name": "x"}]}, ['"base" and "x" are equal', "allow_equal"]),
        ({"variant": [TWO[0], TWO[0]]}, ["two variants", '"base"']),
        ({"variant": [TWO[0], {"name": "x", "config": "wilsn"}]}, ["wilsn", "wilson"]),
        ({"variant": TWO[:1]}, ["two variants"]),
        ({"grounds": ["flat", "lava"]}, ["grounds", "lava"]),
        ({"grounds": ["flat", "flat"]}, ["grounds", "none twice"]),
        (
            {"variant": [TWO[0], {"name": "x", "settings": {"seed": 3}}]},
            ["seeds and generations are the study's own keys"],
        ),
        (
            {"base": {"evolution": {"islands": {"count": 4}}}},
            ["[base]", "one population; evolution.islands.count"],
        ),
        ({"base": {"rollout": {"start": 3}}}, ["[base]", "start"]),
        ({"measure": "beauty"}, ["measure", "beauty"]),
        ({"measure": "generations"}, ["threshold"]),
        ({"measure": "certified"}, ["certify = true"]),
        ({"seeds": 1}, ["seeds"]),
        ({"grid": {"evolution.sigma": [0.1]}, "variant": TWO}, ["one of the two"]),
        ({"qustion": "?"}, ["qustion", "question"]),
    ],
)
def test_mistakes_are_reported_before_anything_runs(stool: Creature, keys: dict, words: list[str]):
    with pytest.raises(UserError) as error:
        plan(stool, **keys)
    assert str(error.value).startswith("study.toml")
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(
    "path",
    sorted((data_folder("configs") / "ablations").glob("*.toml")),
    ids=lambda path: path.stem,
)
def test_shipped_studies_are_valid_and_have_enough_seeds(path: Path):
    study = read_study(Path(path.stem), {})
    assert study.seeds >= 16
    creature = load_creature(data_folder("envs") / study.env)
    assert len(make_plan(study, creature, path.name).variants) >= 2


def test_variants_of_the_sizes_study_have_equal_evaluations():
    study = read_study(Path("sizes"), {})
    creature = load_creature(data_folder("envs") / study.env)
    spent = set()
    for run in make_plan(study, creature, "sizes").runs:
        evolution = run.config.evolution
        seeding = -(-evolution.population // evolution.offspring) * evolution.offspring
        spent.add(run.generations * evolution.offspring + seeding)
    assert max(spent) / min(spent) < 1.05


def test_other_generations_keep_the_share_of_evaluations():
    study = read_study(Path("sizes"), {"generations": 41})
    assert {v.name: v.generations for v in study.variant}["population 50"] == 83
    assert {v.name: v.generations for v in study.variant}["3 key poses"] is None


def test_an_unknown_study_names_the_shipped_ones():
    with pytest.raises(UserError, match="switches"):
        read_study(Path("swiches"), {})


def test_the_upper_bound_counts_every_simulation_step(stool: Creature):
    assert plan(stool, env=str(STOOL)).upper_bound(stool) == 6 * (5 + 1) * 256 * 3 * 1600
