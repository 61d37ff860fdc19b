"""Networks: the two implementations agree, and an environment's policy is the controller."""

import dataclasses
import io
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config
from rich.console import Console

from mjxgait.champion import Champion, read_champion, write_champion
from mjxgait.controllers.config import DriveConfig
from mjxgait.controllers.network.config import MIRRORED, READS, NetworkConfig
from mjxgait.controllers.network.controller import Network, split
from mjxgait.controllers.network.reference import NetworkReference
from mjxgait.controllers.network.report import NetworkView
from mjxgait.controllers.observations import sense
from mjxgait.creature import Creature
from mjxgait.environments.problem import make_problem
from mjxgait.errors import UserError

COUNT = 5
SETTINGS = NetworkConfig(hidden=(6, 5), every=2, period=0.4)


@pytest.fixture
def network(stool: Creature) -> Network:
    return Network.with_settings(stool, 0.005, SETTINGS, ())


@pytest.fixture
def genome(network: Network) -> dict[str, np.ndarray]:
    draw = np.random.default_rng(0)
    return {name: draw.uniform(low, high) for name, (low, high) in network.bounds(SETTINGS).items()}


@pytest.fixture
def champion(stool: Creature, genome: dict[str, np.ndarray]) -> Champion:
    made = {"settings": SETTINGS, "drive": DriveConfig(), "task": "walk", "fitness": 0.0}
    told = {"creature": stool.name, "digest": stool.digest, "terms": {}, "origin": {}}
    return Champion(controller="network", genome=genome, **made, **told)


@pytest.fixture
def senses() -> dict[str, np.ndarray]:
    """Observations [S] that a body with four joints may have."""
    draw = np.random.default_rng(1)
    shapes = {"joint_pos": (4,), "joint_vel": (4,), "nose_vel": (2,)}
    found = {name: draw.normal(size=(COUNT, *shapes.get(name, ()))) for name in READS}
    return found | {"time": draw.uniform(0, 20, COUNT)}


def commands(network: Network, genome: dict, senses: dict) -> np.ndarray:
    plan = network.prepare(jax.tree.map(jnp.float32, genome), SETTINGS)
    return np.asarray(jax.vmap(lambda seen: network.act(plan, (), seen)[0])(senses))


def test_both_implementations_agree(network, genome, champion, senses, stool):
    reference = NetworkReference(stool, champion, 0.005)
    wanted, _ = reference.act(reference.init(COUNT), senses)
    found = commands(network, genome, senses)
    assert np.allclose(found, wanted, atol=1e-4)
    assert np.ptp(found, axis=0).min() > 0.01
    assert reference.every == network.every == 2
    assert set(reference.reads) == set(network.reads)
    assert np.isnan(reference.phase(reference.init(COUNT))).all()


def test_the_mirror_image_moves_as_the_mirror_image_half_a_period_later(
    network, genome, senses, stool
):
    image = {name: sign * senses[name] for name, sign in MIRRORED.items()}
    image |= {name: stool.mirror.image(senses[name]) for name in ("joint_pos", "joint_vel")}
    image |= {"nose_vel": senses["nose_vel"] * [1, -1], "time": senses["time"] + 0.2}
    here, there = commands(network, genome, senses), commands(network, genome, image)
    assert np.allclose(stool.mirror.image(here), there, atol=1e-3)
    assert not np.allclose(here, there, atol=0.01)


def test_zero_is_the_standing_pose_and_the_largest_outputs_end_in_the_pose_range(network, stool):
    joints = stool.joints
    assert np.allclose(network.angles(jnp.zeros(4)), joints.stand)
    for sign in (-9.0, 9.0):
        angles = np.asarray(network.angles(jnp.full(4, sign)))
        assert (angles >= joints.pose_low - 1e-6).all()
        assert (angles <= joints.pose_high + 1e-6).all()


def test_an_environment_observes_what_the_controller_reads(network, stool):
    """So a policy trained there is this controller: from the same state, the same inputs."""
    problem = make_problem(stool, small_config(), READS)
    progress, blank = problem._blank()
    draw = np.random.default_rng(2)
    rotation, _ = np.linalg.qr(draw.normal(size=(3, 3)))
    filled = {
        field.name: np.float32(draw.normal(size=np.shape(getattr(blank, field.name))))
        for field in dataclasses.fields(blank)
        if getattr(blank, field.name) is not None
    }
    sensed = dataclasses.replace(blank, **filled | {"trunk_rot": np.float32(rotation)})
    progress = jax.tree.map(lambda leaf: np.ones(leaf.shape, leaf.dtype), progress)
    observation = problem.observation(progress, sensed)
    seen = sense(stool, sensed, jnp.float32(problem.step), network.reads)
    for period in (0.4, 0.7):
        from_environment = network.inputs(split(observation, 4), period)
        assert np.allclose(from_environment, network.inputs(seen, period), atol=1e-6)
    assert len(observation) + 1 == network.layers[0][0]


def test_a_champion_comes_back_from_its_file(champion, stool, tmp_path):
    write_champion(champion, stool, tmp_path / "champion.json")
    back = read_champion(tmp_path / "champion.json", stool)
    assert back.fingerprint == champion.fingerprint
    assert back.settings == SETTINGS


@pytest.mark.parametrize("name", ["weight_0", "bias_2", "weight_1"])
def test_weights_of_another_shape_are_refused(champion, stool, tmp_path, name: str):
    spoilt = {**champion.genome, name: champion.genome[name][:-1]}
    write_champion(dataclasses.replace(champion, genome=spoilt), stool, tmp_path / "champion.json")
    with pytest.raises(UserError, match=name):
        read_champion(tmp_path / "champion.json", stool)


def test_the_report_has_the_layers_and_not_the_weights(genome):
    snapshot = SimpleNamespace(genomes={n: np.stack([a, 3 * a]) for n, a in genome.items()})
    view, out = NetworkView(), io.StringIO()
    found = view.facts(snapshot, 1)
    assert found["layers"]["weight_1"]["shape"] == [6, 5]
    size = 3 * np.sqrt(np.square(genome["weight_1"]).mean())
    assert found["layers"]["weight_1"]["size"] == pytest.approx(size)
    view.show({"rank": 1, **found}, view.spread(snapshot), Console(file=out, width=80))
    assert "6 x 5" in out.getvalue()
    assert f"{size:.3f}" in out.getvalue()
    assert f"{size / 3:.3f}" in out.getvalue().partition("spread over the population")[2]
