"""The config as the compiled program reads it, and several runs in one program."""

import dataclasses
import re
import shutil
from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import STOOL, made_up_evaluate, program_text, small_config

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.schema import Config
from mjxgait.config.traced import chosen, traced
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.training import stages
from mjxgait.training.experiment import Batch, Step, build_batch


def shape(**tables: dict) -> object:
    return jax.tree.structure(traced(small_config(**tables)))


@pytest.mark.parametrize(
    "tables",
    [
        {
            "evolution": {
                "mutation_rate": 0.1,
                "mutation": "bit",
                "generations": 7,
                "remove_duplicates": False,
            }
        },
        {"evolution": {"forced": {"enabled": False, "patience": 9}}},
        {
            "controller": {"advance": "clock", "mirror": False},
            "drive": {"law": "pd", "stiffness": 2.0},
        },
        {"rollout": {"push": 0.0, "worst": 0.0}},
        {"fitness": {"speed": 0.0, "weights": {"slip": 3.0, "fall": 9.0}}},
    ],
    ids=["evolution", "forced", "controller", "rollout", "fitness"],
)
def test_numbers_and_switches_do_not_shape_the_program(tables: dict):
    assert shape(**tables) == shape()


@pytest.mark.parametrize(
    "tables",
    [
        {"controller": {"key_poses": 3}},
        {"evolution": {"population": 8}},
        {"evolution": {"growth": 1.5}},
        {"rollout": {"starts": 3}},
        {"rollout": {"seconds": 0.6}},
        {"rollout": {"terminate": False}},
        {"rollout": {"termination": {"touch": False}}},
        {"evolution": {"pose_span": 90.0}},
        {"evolution": {"pool": "growing"}},
    ],
    ids=[
        "key poses",
        "population",
        "growth",
        "starts",
        "seconds",
        "no end",
        "no end by touch",
        "pose span",
        "growing pool",
    ],
)
def test_sizes_and_built_in_settings_shape_the_program(tables: dict):
    assert shape(**tables) != shape()


def test_a_choice_can_be_read_plain_and_traced():
    config = dataclasses.replace(Config(), evolution=EvolutionConfig(mutation="bit"))
    for kind in (config.evolution.mutation, traced(config).evolution.mutation):
        assert bool(chosen(kind, "bit"))
        assert not bool(chosen(kind, "byte"))


VARIANTS = {
    "as it is": {},
    "another seed": {"seed": 5},
    "plain PD, and slower": {"drive": {"law": "pd"}, "fitness": {"speed": 0.4}},
    "bit flips by the clock": {
        "controller": {"advance": "clock"},
        "evolution": {"mutation": "bit", "selection": "tournament"},
    },
}
OTHERWISE = {
    "seed": 5,
    "drive": {"law": "pd"},
    "controller": {"advance": "clock"},
    "evolution": {"mutation": "bit", "selection": "tournament"},
    "fitness": {"weights": {"slip": 3.0}},
    "rollout": {"push": 0.0},
}
"""The changes of the variants at once, with another weight and no push."""


def variant(tables: dict, physics: str = "mjx") -> Config:
    """A config with the lanes of a run alone, so that rounding is equal; half of the individuals
    run one start only.

    In lane-major physics rounding depends on the lane.
    """
    tables = dict(tables)
    seed = tables.pop("seed", 0)
    tables["rollout"] = {"physics": physics, "promote": 0.5} | tables.get("rollout", {})
    return dataclasses.replace(small_config(**tables), seed=seed)


@pytest.fixture(scope="module")
def balls(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    """The stool with a ball for its plate and a single central leg that is only a foot.

    Its programs are short, and its plain MJX compiles sooner as users get it.
    """
    folder = shutil.copytree(STOOL, tmp_path_factory.mktemp("hyper") / "balls")
    xml = (folder / "creature.xml").read_text()
    xml = xml.replace('type="box" size="0.25 0.12 0.04"', 'type="sphere" size="0.1"')
    xml = re.sub(r'<geom name="\w*_leg".*?/>', "", xml)
    xml = xml.replace('"front_left" pos="0.2 0.12 0"', '"front_left" pos="0 0 0"')
    xml = re.sub(r'<body name="(hind_|front_right).*?</body>', "", xml, flags=re.DOTALL)
    (folder / "creature.xml").write_text(xml.replace("1 0 0 0 0 0 0 0", "1 0 0 0 0"))
    toml = (folder / "creature.toml").read_text()
    toml = re.sub(r"feet = .*", 'feet = ["front_left_foot"]', toml)
    (folder / "creature.toml").write_text(toml)
    return load_creature(folder)


def test_one_program_serves_every_value(balls: Creature):
    """Other seeds, weights and mutations hit the compilation cache: the text is the same."""
    texts = [
        program_text(build_batch(balls, [variant(tables, physics="auto")]))
        for tables in ({}, OTHERWISE)
    ]
    assert texts[0] == texts[1]


SIMULATED = pytest.mark.thorough(
    "test_episode_parity simulates several rows, test_ablate compares one with its run"
)


@pytest.fixture(scope="module", params=["made up", pytest.param("simulated", marks=SIMULATED)])
def batch(request: pytest.FixtureRequest, balls: Creature) -> Iterator[Batch]:
    """Runs that compile only evolution, and whole runs, as users get them."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "simulated":
            request.getfixturevalue("emitted_as_shipped")
        else:
            patch.setattr(stages, "evaluate", made_up_evaluate)
        yield build_batch(balls, [variant(tables) for tables in VARIANTS.values()])


@pytest.fixture(scope="module")
def step(batch: Batch) -> Step:
    return batch.compile()


def test_a_row_equals_its_run_alone_bit_for_bit(balls: Creature, batch: Batch, step: Step):
    states = batch.place(batch.init())
    for _ in range(3):
        states, metrics = step(states)
    # One program serves every value, so it is compiled once; the body's numbers are in it.
    compiled = build_batch(balls, [variant({})]).stages()
    for row, tables in enumerate(VARIANTS.values()):
        one = build_batch(balls, [variant(tables)])
        rows, state = one.place(one.rows), one.place(one.init())
        for _ in range(3):
            state, metrics_alone = compiled.step(None, rows, state)
        assert np.array_equal(state.fitness[0], states.fitness[row])
        assert np.array_equal(state.genomes.key_poses[0], states.genomes.key_poses[row])
        assert float(metrics_alone.best[0]) == float(metrics.best[row])
        assert int(metrics_alone.sim_steps[0]) == int(metrics.sim_steps[row])


def test_a_row_that_goes_non_finite_does_not_touch_the_others(batch: Batch, step: Step):
    states = batch.init()
    poisoned = dataclasses.replace(
        states,
        genomes=dataclasses.replace(
            states.genomes, key_poses=states.genomes.key_poses.at[1].set(jnp.nan)
        ),
    )
    sound, _ = step(batch.place(states))
    mixed, metrics = step(batch.place(poisoned))
    others = np.arange(len(VARIANTS)) != 1
    assert np.array_equal(sound.fitness[others], mixed.fitness[others])
    assert not np.isfinite(metrics.best[1])


def test_settings_of_different_shapes_are_refused(stool: Creature):
    with pytest.raises(UserError, match="different shapes"):
        build_batch(stool, [small_config(), small_config(controller={"key_poses": 3})])


@pytest.mark.parametrize("use", [bool, lambda x: x + 1, lambda x: x < 1, jnp.asarray, float])
def test_host_settings_are_not_available_to_the_program(use: Callable[[object], object]):
    program = traced(small_config(evolution={"generations": 9}))
    for setting in (program.evolution.generations, program.seed, program.examination.every):
        with pytest.raises(TypeError):
            use(setting)
