"""Bodies that compete for a cube: all meet the best of the generation before."""

import dataclasses
import re
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pygltflib import GLTF2

from mjxgait.animation.export.glb import build_glb
from mjxgait.animation.export.loop import walk_loop
from mjxgait.api import load_creature
from mjxgait.certification import CertificateConfig, nominal_check
from mjxgait.certification.acceptance import acceptance_of
from mjxgait.certification.check_body import check_body
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.config.schema import Config
from mjxgait.controllers.sims_brain.operators import Genotype
from mjxgait.controllers.sims_brain.reference_body import CUBE, DISTANCE, grow, opponent_genome
from mjxgait.creature.load import creature_of
from mjxgait.errors import UserError
from mjxgait.evolution.state import EvolutionState
from mjxgait.plugins.fit import check_fit
from mjxgait.plugins.registry import build_config
from mjxgait.reference.contest import contest_of
from mjxgait.reference.measure import measure
from mjxgait.reference.starts import nominal_starts, perturbed_starts
from mjxgait.rendering.walk import record_walk
from mjxgait.tasks.modular.compete_criteria import nearness
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.generation import evolution_of
from mjxgait.training.initial import planted
from mjxgait.types import by_name
from mjxgait.web.page import build_page

SECONDS, COUNT = 1.6, 60
RACE = {
    "survival": "children",
    "elite": 0.25,
    "forced": {"enabled": False},
}
TABLE: dict[str, Any] = {
    "use": {"controller": "brain", "task": "compete"},
    "controller": {"nodes": 3, "parts": 3, "links": 3, "local": 2, "central": 1},
    "evolution": {"population": COUNT, **RACE},
    "seed": 1,
    "rollout": {"seconds": SECONDS, "starts": 1, "promote": 1.0, "lanes": 24},
    "fitness": {"settle": 0.0},
}


def config_of(**changed: Any) -> Config:
    """The settings with other tables."""
    return build_config({**TABLE, **changed}, "test")


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return build_experiment(load_creature("blocks"), config_of())


@pytest.fixture(scope="module")
def played(experiment: Experiment) -> Callable[[Any], Any]:
    """The simulation of a population, compiled once: genomes -> statistics [N, 1]."""
    simulate = jax.jit(experiment.simulate)
    return lambda genomes: jax.tree.map(np.asarray, simulate(genomes).stats)


@pytest.fixture(scope="module")
def first(experiment: Experiment) -> Any:
    """The first population."""
    return experiment.init().genomes


def met(experiment: Experiment, genomes: Any, place: int) -> Any:
    """The same population, which meets one of its own."""
    config = experiment.config
    variation = experiment.simulator.controller.variation(config.controller, config.evolution)
    assert variation.met is not None
    best = jax.tree.map(lambda leaf: leaf[place], genomes)
    return variation.met(genomes, best, jnp.ones((), bool))


def champion_of(experiment: Experiment, genomes: Any, place: int) -> Champion:
    """An individual as if it had been evaluated."""
    state = dataclasses.replace(experiment.init(), genomes=genomes, key=jnp.zeros(()))
    known = jax.tree.map(np.asarray, dataclasses.replace(state, terms=np.zeros((COUNT, 1, 3))))
    outcome = np.tile([0.5, SECONDS, 0.0], (COUNT, 1, 1))
    return experiment.champion(dataclasses.replace(known, outcome=outcome), {}, place)


def movers(genomes: Any) -> list[int]:
    """Places of the individuals with hinges."""
    arrays = {n: np.asarray(a) for n, a in by_name(genomes).items() if n.startswith("graph.")}
    grown = [grow({n: a[i] for n, a in arrays.items()}, 3, 3) for i in range(COUNT)]
    return [i for i, parts in enumerate(grown) if any(len(part.hinges) for part in parts)]


def alike(one: Any, other: Any) -> bool:
    """Whether two pytrees are the same."""
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(np.array_equal(a, b) for a, b in pairs)


@pytest.fixture(scope="module")
def opponents(experiment: Experiment) -> Callable[[EvolutionState], Any]:
    """The opponents of a generation's offspring, which change every three generations."""
    rollout = dataclasses.replace(experiment.config.rollout, hold=3)
    config = dataclasses.replace(experiment.config, rollout=rollout)
    evolution = evolution_of(experiment.simulator, config)
    return jax.jit(lambda state: evolution.propose(state).offspring.opponent)


@pytest.mark.parametrize(("generation", "changes"), [(-1, False), (0, True), (1, False), (6, True)])
def test_all_meet_the_best_of_the_generation_before(
    experiment: Experiment,
    opponents: Callable[[EvolutionState], Any],
    generation: int,
    changes: bool,
):
    """Every three generations; in between the opponent stays, for those too that are drawn anew."""
    state = experiment.init()
    best = jax.tree.map(lambda leaf: leaf[0], state.genomes)
    expected = dataclasses.replace(best, opponent=None) if changes else best.opponent
    count = COUNT * (generation >= 0)
    known = dataclasses.replace(state, generation=generation, seeded=count)
    theirs = jax.device_get(opponents(known))
    offspring = len(jax.tree.leaves(theirs)[0])
    for place in range(offspring):
        assert alike(jax.tree.map(lambda leaf, at=place: leaf[at], theirs), expected)


def test_children_keep_the_opponent_of_their_mother(experiment: Experiment, first: Any):
    config = experiment.config
    variation = experiment.simulator.controller.variation(config.controller, config.evolution)
    one, other = (
        jax.tree.map(lambda leaf, at=i: leaf[at], met(experiment, first, i)) for i in (0, 1)
    )
    key = experiment.init().key

    @jax.jit
    def bred(mother: Any, father: Any) -> tuple[Any, Any]:
        return variation.cross(key, mother, father), variation.mutate(key, mother)

    child, mutant = bred(one, other)
    assert alike(child.opponent, one.opponent)
    assert alike(mutant.opponent, one.opponent)
    assert not alike(mutant.nerves, one.nerves)


def test_a_body_draws_with_its_like(
    experiment: Experiment, first: Any, played: Callable[[Any], Any]
):
    place = movers(first)[0]
    stats = played(met(experiment, first, place))
    settings, task = experiment.config.fitness, experiment.simulator.task
    terms = jax.jit(jax.vmap(jax.vmap(lambda s: task.evaluate(s, settings))))(stats)
    share = np.asarray(terms["share"])[:, 0]
    assert share[place] == pytest.approx(0.5, abs=0.01)
    still = np.setdiff1d(np.arange(COUNT), movers(first))
    np.testing.assert_array_equal(share[still], 0.0)


@pytest.fixture(scope="module")
def contests(
    experiment: Experiment, first: Any, played: Callable[[Any], Any]
) -> list[tuple[Any, Champion]]:
    """Contests in evolution's physics: statistics and champions, all against one that goes far."""
    alone = played(first)
    way = np.linalg.norm((alone.place - alone.settled)[:, 0, :2], axis=1)
    whole = alone.steps[:, 0] == round(SECONDS / 0.01)
    genomes = met(experiment, first, int(np.argmax(np.where(whole, way, 0.0))))
    stats = played(genomes)
    places = [i for i in movers(first) if stats.steps[i, 0] == round(SECONDS / 0.01)]
    return [
        (jax.tree.map(lambda leaf, at=i: leaf[at, 0], stats), champion_of(experiment, genomes, i))
        for i in places[:8]
    ]


def test_a_contest_goes_as_in_mujoco(contests: list[tuple[Any, Champion]]):
    """The way of the body, and the distances of both from the cube."""
    apart, moved, theirs = [], [], []
    for stats, champion in contests:
        creature = champion.embodied(load_creature("blocks"))
        outcome = simulate(creature, champion, nominal_starts(creature, 1), SECONDS, record=1)
        middle = outcome.middle[0, -1] + creature.frame.stand_pos
        apart.append(np.abs(middle - stats.place).max())
        moved.append(np.linalg.norm(stats.place - stats.settled))
        theirs.append(abs(outcome.gaps[0, -1, 1] - outcome.gaps[0, 0, 1]))
        found, steps = nearness(outcome.gaps[0]).sum(), len(outcome.gaps[0])
        assert found / steps == pytest.approx(stats.nearness / steps, abs=0.01)
    assert np.max(moved) > 0.05
    assert np.min(theirs) > 0.1
    assert np.median(apart) < 0.01


def test_the_examined_model_holds_both_and_the_cube(contests: list[tuple[Any, Champion]]):
    champion = contests[0][1]
    creature = champion.embodied(load_creature("blocks"))
    check_body(creature)
    model, contest = creature.model, contest_of(creature)
    assert contest is not None
    settings = champion.settings
    own = grow(champion.genome, settings.parts, settings.links)
    theirs = grow(opponent_genome(champion.genome), settings.parts, settings.links)
    assert [len(geoms) for geoms in contest.geoms] == [len(own), len(theirs)]
    assert model.nbody == 1 + len(own) + len(theirs) + 1
    assert len(creature.joints.names) == sum(len(part.hinges) for part in own)
    assert len(creature.feet.names) == len(own)
    assert creature.frame.mass == pytest.approx(
        sum(1000 * 8 * float(part.half.prod()) for part in own)
    )
    middle = creature.stand_qpos[model.joint("cube").qposadr[0]]
    start = creature.stand_qpos[model.joint("opponent_root").qposadr[0]]
    leaning = [p.box.corners[:, 0] + p.box.corners[:, 2] - _low(own) for p in own]
    assert middle == pytest.approx(np.max(leaning) + DISTANCE + CUBE / 2)
    leaning = [p.box.corners[:, 0] + p.box.corners[:, 2] - _low(theirs) for p in theirs]
    assert start - middle == pytest.approx(np.max(leaning) + DISTANCE + CUBE / 2)


def _low(parts: Any) -> float:
    return float(min(part.box.corners[:, 2].min() for part in parts))


def test_only_the_body_itself_is_measured(contests: list[tuple[Any, Champion]]):
    champion = contests[0][1]
    creature = champion.embodied(load_creature("blocks"))
    outcome = simulate(creature, champion, nominal_starts(creature, 1), SECONDS, record=1)
    film = outcome.trajectory
    # The opponent is thrown into the air, and stands in the cube.
    film.qvel[0, :, -12:-6] = 30.0
    known = measure(creature, film, drag=0.0)
    assert known.body_speed.max() < 5
    assert known.grown is not None
    assert list(known.grown.sizes) == list(creature.feet.names)
    assert known.grown.gaps[:-1] == pytest.approx(outcome.gaps[0][:-1], abs=0.05)
    assert not any("opponent" in name for pair in known.overlap_pairs for name in pair)


def test_perturbed_starts_disturb_the_body_alone(contests: list[tuple[Any, Champion]]):
    champion = contests[0][1]
    creature = champion.embodied(load_creature("blocks"))
    rng = np.random.default_rng(0)
    outcome = simulate(creature, champion, perturbed_starts(creature, 4, rng), SECONDS)
    assert outcome.gaps.shape == (4, round(SECONDS / 0.01), 2)
    assert np.ptp(outcome.gaps[:, 0, 0]) > 1e-6
    assert np.ptp(outcome.gaps[:, 0, 1]) < 1e-3
    wins = acceptance_of("compete").succeeded(
        outcome, perturbed_starts(creature, 4, rng), CertificateConfig()
    )
    half = outcome.gaps[:, len(outcome.gaps[0]) // 2 :]
    np.testing.assert_array_equal(wins, (half[..., 0] < half[..., 1]).mean(1) > 0.5)


def test_the_check_evaluates_the_share_of_the_cube(contests: list[tuple[Any, Champion]]):
    champion = contests[0][1]
    config = dataclasses.replace(CertificateConfig(), seconds=3.0, warmup=0.5)
    found = nominal_check(champion.embodied(load_creature("blocks")), champion, config)
    assert {2, 7, 8, 9} <= {c.number for c in found.criteria}
    (share,) = next(c for c in found.criteria if c.number == 2).measures
    assert share.name == "share of the cube"
    assert 0 < share.value < 1


def test_the_first_opponent_is_the_same_for_all(first: Any):
    theirs = jax.tree.map(np.asarray, first.opponent)
    assert isinstance(first.opponent, Genotype)
    assert first.opponent.opponent is None
    for place in range(1, COUNT):
        assert alike(
            jax.tree.map(lambda leaf, at=place: leaf[at], theirs),
            jax.tree.map(lambda leaf: leaf[0], theirs),
        )


def test_other_moving_bodies_are_refused_unless_they_are_named(
    contests: list[tuple[Any, Champion]],
):
    files = dict(contests[0][1].embodied(load_creature("blocks")).files)
    whole = files["creature.toml"]
    files["creature.toml"] = re.sub(r"beside = \[[^]]*\]", "beside = []", whole)
    assert files["creature.toml"] != whole
    with pytest.raises(UserError, match="moves but is no part"):
        creature_of(files)
    files["creature.toml"] = whole.replace(', "cube"', "").replace('    "cube",\n', "")
    with pytest.raises(UserError, match="beside: must name the opponent and the cube"):
        creature_of(files)


def test_walkers_begin_a_run_with_the_first_opponent(experiment: Experiment, first: Any):
    """Their genomes have no opponent."""
    controller = experiment.simulator.controller
    arrays = {n: np.asarray(a) for n, a in by_name(first).items() if not n.startswith("opponent.")}
    turned = {name: np.roll(array, 1, axis=0) for name, array in arrays.items()}
    state = planted(experiment.init(), turned, controller)
    np.testing.assert_array_equal(state.genomes.graph.half, turned["graph.half"])
    assert alike(state.genomes.opponent, first.opponent)


@pytest.mark.parametrize(
    ("changed", "remedy"),
    [
        ({"survival": "best", "elite": 0.0}, r"take --evolution\.survival children"),
        ({"elite": 0.0}, r"take --evolution\.elite 0\.25"),
        ({"remember": True}, r"take --evolution\.no-remember"),
        ({"forced": {"enabled": True}}, r"take --evolution\.forced\.no-enabled"),
        ({"islands": {"count": 2}}, r"take --evolution\.islands\.count 1"),
    ],
)
def test_settings_under_which_opponents_differ_are_refused(changed: dict[str, Any], remedy: str):
    config = config_of(evolution={"population": COUNT} | RACE | changed)
    with pytest.raises(UserError, match=remedy):
        check_fit(load_creature("blocks"), config)


def test_a_contest_is_shown_whole(contests: list[tuple[Any, Champion]]):
    """Pictures and files hold both bodies and the cube, not one's stride; the opponent is dark."""
    champion = contests[0][1]
    walk = record_walk(champion.embodied(load_creature("blocks")), champion, 2.0)
    loop = walk_loop(walk)
    assert (len(loop.qpos), loop.strides) == (60, 0)
    model = walk.creature.model
    cube, theirs = (model.joint(name).qposadr[0] for name in ("cube", "opponent_root"))
    np.testing.assert_allclose(loop.qpos[0, cube : cube + 2], 0.0, atol=1e-9)
    assert loop.qpos[0, 0] < -DISTANCE < DISTANCE < loop.qpos[0, theirs]
    nodes = {node.name for node in GLTF2.load_from_bytes(build_glb(loop)).nodes}
    assert {"part0", "opponent_part0", "cube"} <= nodes
    assert "A contest of 2 s" in build_page(walk, loop, "", "")
    bright, dark = (
        max(_rgba(walk.dressed, name).max() for name in names)
        for names in (("block0", "block1"), ("opponent_block0", "opponent_block1"))
    )
    assert dark < 0.6 * bright


def _rgba(model: Any, name: str) -> np.ndarray:
    return np.asarray(model.geom(name).rgba[:3])
