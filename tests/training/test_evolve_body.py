"""Proportions as genes: a lane's body equals the one in the scaled files."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import STOOL, said_by, short_examination
from jax.tree_util import keystr
from scipy.spatial.transform import Rotation

import mjxgait
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion, read_champion
from mjxgait.controllers.base import Bodied
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.overlap import find_crossings
from mjxgait.creature.proportions import grown, proportions
from mjxgait.evolution.chance import key_of
from mjxgait.inspect import facts, read_snapshot
from mjxgait.physics.derived import observation_layout
from mjxgait.physics.lane_major import lane_major_plant
from mjxgait.physics.mjx import mjx_plant
from mjxgait.reference.starts import nominal_starts
from mjxgait.tasks.starts import draw_starts
from mjxgait.training.folder import BODY, CHAMPION
from mjxgait.training.spec import SizeGrowth

MOST = 1.3


def some_sizes(creature: Creature, seed: int) -> np.ndarray:
    count = len(proportions(creature).names)
    return np.random.default_rng(seed).uniform(-np.log(MOST), np.log(MOST), count)


def test_mirrored_parts_share_a_size(shipped: Creature):
    known = proportions(shipped)
    model = shipped.model
    trunk = model.body(shipped.trunk).name
    named = [name for names in known.names for name in names]
    assert len(set(named)) == len(named)
    assert trunk not in named
    assert set(named) | {trunk} == {model.body(b).name for b in range(1, model.nbody)}
    if shipped.mirror.symmetric:
        body_of = model.dof_bodyid[shipped.joints.dof_adr]
        for joint, partner in enumerate(shipped.mirror.partner):
            pair = {model.body(body_of[j]).name for j in (joint, partner)}
            assert any(pair <= set(names) for names in known.names), pair


OF_MODEL = ("body_iquat", "body_inertia", "body_pos", "qpos0", "qpos_spring")
APART = {".axes", ".inertia", ".pos", *(f".model['{name}']" for name in OF_MODEL)}
"""Compared separately: equal moments of inertia allow any axes, and the root's place in the file
does not matter.
"""


def rootless(numbers: Any) -> np.ndarray:
    """Positions of the bodies below the root, m."""
    if hasattr(numbers, "pos"):
        return np.asarray(numbers.pos)[1:]
    return np.asarray(numbers.model["body_pos"])[2:]


def tensors(numbers: Any) -> np.ndarray:
    """Inertia tensors [B, 3, 3] of the parts, in units of the largest moment."""
    if hasattr(numbers, "inertia"):
        first, second = np.moveaxis(np.asarray(numbers.axes, float), 1, 0)
        axes = np.stack([first, second, np.cross(first, second)], axis=2)
        moments = np.asarray(numbers.inertia, float)
    else:
        quats = np.asarray(numbers.model["body_iquat"], float)
        axes = Rotation.from_quat(quats, scalar_first=True).as_matrix()
        moments = np.asarray(numbers.model["body_inertia"], float)
    whole = np.einsum("bij,bj,bkj->bik", axes, moments, axes)
    return whole / moments.max()


LARGER = pytest.mark.thorough("luxo shows it on nested parts, and the stool on mirrored ones")


@pytest.mark.parametrize(
    "shipped",
    ["luxo", *(pytest.param(name, marks=LARGER) for name in ("crab", "duck"))],
    indirect=True,
)
def test_a_lanes_body_equals_the_one_in_the_scaled_files(shipped: Creature):
    compare_with_the_scaled_files(shipped, lane_major_plant)


@pytest.mark.parametrize("make", [lane_major_plant, mjx_plant])
def test_a_lanes_stool_equals_the_scaled_files_in_both_plants(stool: Creature, make: Any):
    compare_with_the_scaled_files(stool, make)


def compare_with_the_scaled_files(shipped: Creature, make: Any) -> None:
    """Compare every number that the plant reads, from positions to constraint weights."""
    known, sizes = proportions(shipped), some_sizes(shipped, 3)
    layout, touch = observation_layout(shipped), shipped.settings.termination.touch
    plant = make(shipped.model_where(touch), layout, None)
    factors = np.exp(np.append(sizes, 0.0))[known.size_of]
    ours = jax.jit(plant.with_length_scale)(plant.parameters, jnp.float32(factors))
    other = grown(shipped, known.by_part(sizes))
    theirs = plant.parameters_of(other.model_where(touch), observation_layout(other), None)
    for (path, a), b in zip(
        jax.tree_util.tree_leaves_with_path(ours), jax.tree.leaves(theirs), strict=True
    ):
        if keystr(path) in APART:
            continue
        most = 2e-5 * np.abs(b).max(initial=1e-6)
        np.testing.assert_allclose(a, b, rtol=0, atol=most, err_msg=keystr(path))
    assert abs(rootless(ours) - rootless(theirs)).max() < 1e-5
    np.testing.assert_allclose(tensors(ours), tensors(theirs), rtol=0, atol=1e-5)


@pytest.mark.parametrize("shipped", ["crab", "luxo"], indirect=True)
def test_a_grown_body_starts_at_the_height_of_the_scaled_files(shipped: Creature):
    known, sizes = proportions(shipped), some_sizes(shipped, 4)
    plant = lane_major_plant(shipped.model, observation_layout(shipped), None)
    config = mjxgait.config.schema.RolloutConfig(starts=1)
    start = jax.tree.map(lambda x: x[0], draw_starts(key_of(0), shipped, config))
    # Only the position is compiled; the body's other numbers take the compiler ten seconds.
    place = jax.jit(lambda genome: SizeGrowth(known).body(plant, genome, start).qpos)
    other = grown(shipped, known.by_part(sizes))
    grew = place(Bodied({}, jnp.float32(sizes)))
    np.testing.assert_allclose(grew, other.stand_qpos, atol=2e-5)
    # The trunk keeps its size, so a body that stands on it stands as before.
    stands_on_its_trunk = shipped.model.body(shipped.trunk).name in shipped.feet.names
    moved = abs(other.stand_qpos - shipped.stand_qpos).max() > 1e-3
    assert moved != stands_on_its_trunk


def test_watched_bars_grow_with_their_parts(stool: Creature):
    """Equal factors scale every depth equally."""
    plant = lane_major_plant(
        stool.evolution_model, observation_layout(stool), find_crossings(stool)
    )
    assert plant.topology.first
    grew = jax.jit(plant.with_length_scale)(plant.parameters, jnp.full(stool.model.nbody - 1, 1.2))
    for name in ("centre", "half", "radius", "reach"):
        before, after = getattr(plant.parameters.bars, name), getattr(grew.bars, name)
        np.testing.assert_allclose(after, 1.2 * before, rtol=1e-5, err_msg=name)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> mjxgait.Run:
    out = tmp_path_factory.mktemp("body") / "run"
    settings = {
        "evolution": {"body": MOST},
        "rollout": {"seconds": 0.5, "starts": 2, "promote": 1.0, "lanes": 8},
        "examination": {"candidates": 1, "every": 0, "draws": 1},
    }
    small = {"population": 8, "generations": 2, "settings": settings, "quiet": True}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mjxgait.certification.certificate.CertificateConfig", short_examination)
        return mjxgait.train(STOOL, out=out, **small)


def test_the_run_stores_the_champions_body(run: mjxgait.Run):
    champion, body = run.champion, load_creature(run.folder / BODY)
    assert champion.sizes
    assert all(1 / MOST <= f <= MOST for f in champion.sizes.values())
    assert len(set(champion.sizes.values())) > 1
    assert body.digest == run.creature.digest != load_creature(run.folder / "creature").digest
    assert run.certificate
    assert run.certificate["creature_digest"] == body.digest


def test_individuals_move_in_c_mujoco_as_in_evolution(run: mjxgait.Run):
    """Each individual with its own body, and not with the original one."""
    snapshot = read_snapshot(run.folder)
    told = snapshot.arrays["outcome"][:, 0, 0]
    everybody = [snapshot.champion(rank + 1) for rank in range(len(told))]

    def forward(creature: Creature, champion: Champion) -> float:
        return float(simulate(creature, champion, nominal_starts(creature, 1), 0.5).travel[0, 0])

    known = snapshot.creature
    own = np.array([forward(one.embodied(known), one) for one in everybody])
    ancestors = np.array([forward(known, one) for one in everybody])
    assert np.median(abs(own - told)) < 2e-3
    assert abs(own - told).sum() < 0.3 * abs(ancestors - told).sum()


def test_the_sizes_are_in_the_snapshot_its_facts_and_the_walk(run: mjxgait.Run):
    snapshot = read_snapshot(run.folder)
    best = snapshot.champion(1)
    kept = read_champion(run.folder / CHAMPION, snapshot.creature)
    assert best.sizes == pytest.approx(kept.sizes)
    assert best.fingerprint == kept.fingerprint
    assert facts(snapshot)["champion"]["sizes"] == pytest.approx(kept.sizes)
    assert len(mjxgait.walk(run, 0.3)["time"]) > 10


def test_an_unreasonable_body_range_gives_one_sentence(capsys: pytest.CaptureFixture):
    told = said_by(capsys, "train", "--env", "tall_quadruped", "--evolve-body", 9, code=2)
    assert "evolution.body" in told
