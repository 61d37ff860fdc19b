"""Modular swimmers with bodies and brains that evolve, through the same run as all creatures.

Their blocks push and feel each other, which other tests leave at the default.
"""

import dataclasses
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from controllers.sims_brain.made_up import CALM, moment
from PIL import Image

from mjxgait.api import load_creature
from mjxgait.certification.trials import simulate
from mjxgait.champion import read_champion, write_champion
from mjxgait.cli.plot import plot_command
from mjxgait.controllers.sims_brain.reference_body import DRAG, grow
from mjxgait.evolution.state import EvolutionState
from mjxgait.inspect.family import Family
from mjxgait.inspect.snapshot import read_snapshot
from mjxgait.plugins.registry import build_config
from mjxgait.reference.grown import seen_grown
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.curves import figure
from mjxgait.rendering.genomes import bodies_of, draw_bodies, draw_graph
from mjxgait.rendering.walk import record_walk
from mjxgait.tasks.modular.base import FASTEST_HINGE, FURTHEST
from mjxgait.tasks.modular.config import SwimConfig
from mjxgait.tasks.modular.swim import Swim
from mjxgait.training.advance import metrics_line
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.experiment import Experiment, Step, build_experiment
from mjxgait.training.family import keep_newborns
from mjxgait.training.folder import CHAMPION, METRICS, create_run
from mjxgait.training.logs import Line, write_lines

TABLE = {
    "use": {"controller": "brain", "task": "swim"},
    "controller": {
        "nodes": 3,
        "parts": 4,
        "links": 4,
        "local": 2,
        "central": 1,
        "collide": True,
        "touch": True,
    },
    "evolution": {"population": 60, "lineage": True},
    "rollout": {"seconds": 1.6, "starts": 2, "promote": 1.0, "lanes": 20, "joint_noise": 0.1},
    "fitness": {"settle": 0.1, "weights": {"overlap": 0.0, "elsewhere": 0.0}},
}


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    """An experiment with small capacities, so that it compiles fast."""
    return build_experiment(load_creature("blocks"), build_config(TABLE, "test"))


@pytest.fixture(scope="module")
def step(experiment: Experiment) -> Step:
    """The only program compiled here."""
    return experiment.compile()


@pytest.fixture(scope="module")
def evolved(experiment: Experiment, step: Step) -> tuple[EvolutionState, list[float]]:
    state, best = experiment.place(experiment.init()), []
    for _ in range(5):
        state, metrics = step(state)
        best.append(float(metrics.best))
    return jax.device_get(_without_key(state)), best


def test_swimmers_get_faster(evolved: tuple[EvolutionState, list[float]]):
    _, best = evolved
    assert np.isfinite(best).all()
    assert best == sorted(best)
    assert best[-1] > best[0] > 0


@pytest.fixture(scope="module")
def again(experiment: Experiment, step: Step, evolved) -> EvolutionState:
    """The best 56 and four without any connection, evaluated as a first population."""
    best = evolved[0].genomes
    alone = dataclasses.replace(
        best, graph=dataclasses.replace(best.graph, used=np.zeros_like(best.graph.used))
    )
    both = jax.tree.map(lambda a, b: jnp.concatenate([a[:56], b[:4]]), best, alone)
    state, _ = step(experiment.place(dataclasses.replace(experiment.init(), genomes=both)))
    return jax.device_get(_without_key(state))


def _without_key(state: EvolutionState) -> EvolutionState:
    """The state without its typed key, which stays on the device."""
    return dataclasses.replace(state, key=jnp.zeros(()))


def test_evaluating_again_gives_the_same_metrics(evolved, again: EvolutionState):
    np.testing.assert_allclose(again.outcome[:56], evolved[0].outcome[:56], rtol=1e-3, atol=1e-6)


def test_a_single_block_does_not_swim(again: EvolutionState):
    way, seconds = np.moveaxis(again.outcome[56:], -1, 0)
    np.testing.assert_allclose(way, 0, atol=1e-6)
    np.testing.assert_allclose(seconds, 1.6, rtol=1e-6)


def test_implausible_speed_or_bending_ends_the_episode(experiment: Experiment):
    task = experiment.simulator.task
    assert int(task.ended(CALM, ())) == 0
    wild = dataclasses.replace(CALM, joint_vel=CALM.joint_vel.at[2].set(FASTEST_HINGE + 1))
    bent = moment({"limit_excess": jnp.float32(FURTHEST + 0.01)})
    assert [int(task.ended(each, ())) for each in (wild, bent)] == [1, 1]


def evaluation(task: Swim, given: float, overlap: float = 0.0) -> dict[str, float]:
    """Terms of a 2 kg swimmer that the water pushes with 3 N along x. `given`: the share of its
    momentum that the water gave. Counting begins in motion.
    """
    settings, step = SwimConfig(settle=0.1), task.step
    stats, params = task.init(), task.params(settings)
    push, place = 3.0, 0.0
    for k in range(task.horizon):
        momentum = 1.0 + push / given * step * k
        along = jnp.array([1.0, 0.0, 0.0])
        own = {"com": place * along, "momentum": momentum * along, "water_force": push * along}
        sensed = moment(own)
        stats = task.update(stats, sensed, jnp.zeros(3), params, ())
        place += momentum / 2 * step
    stats = dataclasses.replace(stats, overlap=jnp.float32(overlap))
    return {name: float(value) for name, value in task.evaluate(stats, settings).items()}


def test_momentum_not_from_the_water_costs_speed(experiment: Experiment):
    task = experiment.simulator.task
    assert isinstance(task, Swim)
    clean, doubtful, stolen = (evaluation(task, share) for share in (1.0, 1 / 1.02, 0.5))
    assert clean["elsewhere"] == pytest.approx(0, abs=1e-3 * clean["speed"])
    assert doubtful["elsewhere"] == pytest.approx(0.5 * doubtful["speed"], rel=0.1)
    assert stolen["elsewhere"] > 0.99 * stolen["speed"] > 0
    assert clean["overlap"] == 0


def test_overlapping_blocks_cost_speed(experiment: Experiment):
    task = experiment.simulator.task
    assert isinstance(task, Swim)
    touching, deep = evaluation(task, 1.0, SwimConfig().overlap), evaluation(task, 1.0, 1.0)
    assert touching["overlap"] == pytest.approx(touching["speed"] / 2)
    assert deep["overlap"] > 0.99 * deep["speed"]
    both = evaluation(task, 0.5, 1.0)
    assert both["overlap"] + both["elsewhere"] < both["speed"]


def test_the_reference_simulator_finds_the_same_distance(experiment: Experiment, evolved):
    """Two implementations of body, brain and water move every swimmer equally far."""
    state, _ = evolved
    mine, ways = state.outcome[:8, 0, 0], []
    for rank in range(8):
        champion = experiment.champion(state, {}, rank)
        body = champion.embodied(experiment.creature)
        film = simulate(body, champion, nominal_starts(body, 1), 1.6, record=1).trajectory
        middle = seen_grown(body, film.qpos[0], film.qvel[0], DRAG).middle
        # Counting starts at 0.1 s; the statistics end before the last step.
        ways.append(np.linalg.norm(middle[-1] - middle[10]))
    lengths = np.array(ways)
    assert lengths.max() > 0.02
    apart = np.abs(mine - lengths)
    assert np.median(apart / (lengths + 0.01)) < 0.02
    assert (apart < 0.1 * lengths + 0.002).mean() >= 0.75, "a threshold may be met a tick apart"


def test_the_drawn_graph_has_the_nodes_of_the_champions_body(experiment, evolved):
    champion = experiment.champion(evolved[0], {})
    body = champion.embodied(experiment.creature)
    parts = grow(champion.genome, champion.settings.parts, champion.settings.links)
    with figure((10, 4.6)) as drawing:
        draw_graph(drawing, record_walk(body, champion, 0.1))
        graph, picture = drawing.axes
        said = [text.get_text() for text in graph.texts]
    nodes = {str(part.node) for part in parts}
    assert {text for text in said if text.isdigit()} == nodes
    assert sum("cm" in text for text in said) == len(nodes)
    assert len(picture.images) == 1


def test_a_champion_is_drawn_with_its_ancestors(experiment: Experiment, step: Step, tmp_path: Path):
    """From the stored generations; the best of each where the log lists no mothers."""
    run = tmp_path / "run"
    create_run(run, experiment.creature, experiment.config)
    state, checkpoints, lines = experiment.place(experiment.init()), Checkpoints(run), []
    for _ in range(4):
        state, metrics = step(state)
        lines.append(metrics_line(jax.device_get(metrics), 1.0, experiment.simulator.task))
        checkpoints.save(state, experiment.creature.name, experiment.creature.digest)
    checkpoints.close()
    (run / METRICS).write_text("".join(json.dumps(line) + "\n" for line in lines))
    rank = 2
    row = bodies_of(run, experiment.champion(state, {}, rank))
    assert [body.label for body in row.bodies] == [f"generation {g}" for g in range(4)]
    places = [rank]
    for line in lines[:0:-1]:
        places.append(line["mothers"][places[-1]])
    for body, generation, place in zip(row.bodies, range(4), places[::-1], strict=True):
        half = read_snapshot(run, generation).genomes["graph.half"][place]
        np.testing.assert_array_equal(body.walk.champion.genome["graph.half"], half)
    with figure((8, 2.4)) as drawing:
        draw_bodies(drawing, row)
        assert len(drawing.axes) == 4
    (run / METRICS).write_text(json.dumps(lines[3] | {"mothers": [-1] * 60}) + "\n")
    assert not bodies_of(run, experiment.champion(state, {})).descend


def test_the_family_of_a_champion_is_recorded_and_drawn(
    experiment: Experiment, step: Step, tmp_path: Path
):
    run = tmp_path / "run"
    create_run(run, experiment.creature, experiment.config)
    state, checkpoints = experiment.place(experiment.init()), Checkpoints(run)
    lines: list[Line] = []
    graphs = []
    for _ in range(4):
        state, metrics = step(state)
        lines.append(metrics_line(jax.device_get(metrics), 1.0, experiment.simulator.task))
        seen = jax.device_get(_without_key(state))
        keep_newborns(run, seen)
        graphs.append(seen.genomes.graph)
    checkpoints.save(state, experiment.creature.name, experiment.creature.digest)
    checkpoints.close()
    write_lines(run / METRICS, lines)
    family = Family(run, lines)
    for generation, graph in enumerate(graphs):
        for place in range(60):
            found = family.individual(generation, place)
            assert found is not None
            for name in ("half", "target", "used", "turn"):
                recorded = found.body[f"graph.{name}"]
                np.testing.assert_array_equal(recorded, getattr(graph, name)[place])
    champion = experiment.champion(state, {})
    write_champion(champion, champion.embodied(experiment.creature), run / CHAMPION)
    births = family.line(3, 0)
    assert births[0].operator == "first generation"
    assert plot_command([str(run), "--family-tree", str(tmp_path / "tree.png")]) == 0
    with Image.open(tmp_path / "tree.png") as poster:
        assert poster.width > 700
        assert len(poster.convert("RGB").getcolors(1 << 24) or ()) > 1000, "bodies are drawn"


def test_a_modular_champion_survives_its_file(experiment: Experiment, evolved, tmp_path: Path):
    champion = experiment.champion(evolved[0], {})
    write_champion(champion, experiment.creature, tmp_path / "champion.json")
    again = read_champion(tmp_path / "champion.json", experiment.creature)
    assert again.fingerprint == champion.fingerprint
    assert again.embodied(experiment.creature).files == champion.embodied(experiment.creature).files
