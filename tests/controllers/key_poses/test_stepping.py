"""Stepping corrections: how a biped places its feet under a fall."""

import dataclasses
import json
from pathlib import Path

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from helpers import STOOL, altered, pose_champion
from importer.models import BIPED, QUADRUPED

from mjxgait.certification.check_body import check_body
from mjxgait.champion.record import read_champion, write_champion
from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.config import (
    STEPPING,
    TUNING,
    PoseConfig,
    gene_names,
)
from mjxgait.controllers.key_poses.controller import Genome, PoseTracker, stepping
from mjxgait.controllers.key_poses.reference import PoseReference
from mjxgait.controllers.observations import sense
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.load import creature_of
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model
from mjxgait.plugins import resolve_config
from mjxgait.reference.changing import ChangingReference, HaltingReference
from mjxgait.reference.controllers import ReferenceController
from mjxgait.reference.layout import start_frame
from mjxgait.reference.state import State
from mjxgait.reference.state import sense as examiner_sense
from mjxgait.tasks.walk.gaits import stride_limit
from mjxgait.types import Sensed

STEP = 0.005
ANKLES = 0.05
"""m, height of the feet in a swing: clear of the floor."""


@pytest.fixture(scope="module")
def biped(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    """A biped; left and right hips roll, then pitch; knees and ankles follow."""
    file = tmp_path_factory.mktemp("biped") / "biped.urdf"
    file.write_text(BIPED, encoding="utf-8")
    return creature_of(import_model(file, ImportChoices(apart=False)).files)


def seen(creature: Creature, lifted: int | None = None, **changed: np.ndarray) -> Sensed:
    """The standing creature, optionally with one foot lifted or other values changed."""
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.stand_qpos
    mujoco.mj_kinematics(creature.model, data)
    low = np.zeros(len(creature.feet.watched))
    if lifted is not None:
        low[: len(creature.feet.foot_of)][creature.feet.foot_of == lifted] = ANKLES
    values = {
        "joint_pos": creature.joints.stand,
        "joint_vel": np.zeros(len(creature.joints.names)),
        "bias": np.zeros(creature.model.nv),
        "trunk_pos": creature.frame.stand_pos,
        "trunk_rot": creature.frame.stand_rot,
        "trunk_vel": np.zeros(3),
        "trunk_angvel": np.zeros(3),
        "geom_pos": data.geom_xpos[creature.feet.watched],
        "geom_low": low,
    }
    return Sensed(**{k: jnp.asarray(v, jnp.float32) for k, v in (values | changed).items()})


def change(creature: Creature, moment: Sensed, **genes: float) -> dict[str, float]:
    """Nonzero angles in rad that stepping adds to the target, by joint."""
    values = jnp.array([genes.get(name, 0.0) for name in STEPPING])
    felt = sense(creature, moment, jnp.zeros(()), PoseTracker(creature, STEP).reads)
    found = np.asarray(stepping(creature, values, felt))
    pairs = zip(creature.joints.names, found, strict=True)
    return {name: float(value) for name, value in pairs if abs(value) > 1e-6}


def way(creature: Creature, joint: str, angle: float) -> np.ndarray:
    """Displacement [3] in m of the left foot when a joint turns from the standing pose."""
    data, places = mujoco.MjData(creature.model), []
    for turned in (0.0, angle):
        data.qpos[:] = creature.stand_qpos
        data.qpos[creature.joints.qpos_adr[creature.joints.names.index(joint)]] += turned
        mujoco.mj_kinematics(creature.model, data)
        places.append(data.geom_xpos[creature.feet.watched[0]].copy())
    return places[1] - places[0]


def test_import_weights_the_joints_that_move_a_foot_ahead_and_aside(biped: Creature):
    """In rad per hip height: one rad swings the foot about one hip height."""
    weights = biped.corrections.stepping
    assert weights is not None
    names, hip = biped.joints.names, biped.frame.hip_height
    ahead = {names[j] for j in np.flatnonzero(weights.ahead)}
    aside = {names[j] for j in np.flatnonzero(weights.aside)}
    assert ahead == {"left_hip_pitch", "right_hip_pitch"}
    assert aside == {"left_hip_roll", "right_hip_roll"}
    for table, joint, axis in (
        (weights.ahead, "left_hip_pitch", 0),
        (weights.aside, "left_hip_roll", 1),
    ):
        small = 0.02
        moved = way(biped, joint, small * table[names.index(joint)])
        assert moved[axis] == pytest.approx(small * hip, rel=0.15)


def test_a_biped_trains_on_more_trials_and_weights_staying_up(biped: Creature):
    """The import chooses the settings of its class and documents them."""
    usual, own = Config(), resolve_config(biped.settings.train, biped.name)
    assert own.rollout.starts > usual.rollout.starts
    assert own.rollout.latency == 1
    assert own.rollout.variety == own.evolution.generations, "no start comes again"
    assert own.evolution.elites, "and who lives on is judged again"
    assert own.fitness.weights.alive > usual.fitness.weights.alive
    hertz = own.fitness.frequency * stride_limit(biped.frame.mass)
    speed = own.fitness.speed * biped.frame.body_length
    assert speed / hertz == pytest.approx(0.7 * biped.frame.hip_height, rel=0.02)
    assert "on one foot or two it falls unless it walks" in biped.files["creature.toml"]


def test_quadrupeds_and_in_line_feet_do_not_step(tmp_path: Path):
    """Their settings are not those of two feet; tests/importer/test_manner.py looks at the rest."""
    bound = BIPED.replace('xyz="0 0.09 0"', 'xyz="0.4 0 0"').replace(
        'xyz="0 -0.09 0"', 'xyz="-0.4 0 0"'
    )
    assert bound != BIPED
    for kind, text in (("xml", QUADRUPED), ("urdf", bound)):
        file = tmp_path / f"body.{kind}"
        file.write_text(text, encoding="utf-8")
        choices = ImportChoices(apart=False, forward="x")
        creature = creature_of(import_model(file, choices).files)
        assert not creature.corrections.steps
        usual, own = Config(), resolve_config(creature.settings.train, creature.name)
        dear = {"foot_speed": own.fitness.weights.foot_speed, "fall": 1.0, "airborne": 9.0}
        weights = dataclasses.replace(usual.fitness.weights, **dear)
        assert own.fitness == dataclasses.replace(usual.fitness, weights=weights, leniency=1.0)
        assert own.controller.interpolation >= usual.controller.interpolation
        assert own.evolution.generations == usual.evolution.generations
        assert own.rollout.starts == usual.rollout.starts
        assert own.rollout.latency == 1
        assert own.rollout.promote == usual.rollout.promote


def test_bodies_without_weights_lack_step_genes_and_observations():
    stool = load_creature(STOOL)
    control = PoseTracker(stool, STEP)
    assert control.bounds(PoseConfig())[0].tuning.shape == (len(TUNING),)
    assert "foot_place" not in control.reads
    assert gene_names(steps=False) == TUNING


@pytest.mark.parametrize(
    ("genes", "push", "joint"),
    [
        ({"step_rate": 0.2}, [1.0, 0, 0], "hip_pitch"),
        ({"side_rate": 0.2}, [0, 1.0, 0], "hip_roll"),
    ],
    ids=["ahead", "aside"],
)
def test_the_swing_leg_steps_where_the_trunk_moves(biped, genes, push, joint):
    """Only the swing leg: the foot on the floor stays in place."""
    found = change(biped, seen(biped, lifted=0, trunk_vel=np.array(push)), **genes)
    assert list(found) == [f"left_{joint}"]
    speed = 1.0 / np.sqrt(9.81 * biped.frame.hip_height)
    moved = way(biped, f"left_{joint}", 0.1 * found[f"left_{joint}"]) @ push
    assert moved == pytest.approx(0.1 * 0.2 * speed * biped.frame.hip_height, rel=0.15)
    assert not change(biped, seen(biped, lifted=None, trunk_vel=np.array(push)), **genes)


def test_steps_grow_with_the_trunks_offset_from_its_support(biped):
    """The trunk is 5 cm ahead of its standing place over the right foot."""
    ahead = np.add(biped.frame.stand_pos, [0.05, 0, 0])
    found = change(biped, seen(biped, lifted=0, trunk_pos=ahead), step=1.0)
    assert list(found) == ["left_hip_pitch"]
    assert way(biped, "left_hip_pitch", found["left_hip_pitch"])[0] == pytest.approx(0.05, rel=0.2)
    assert not change(biped, seen(biped, lifted=0), step=1.0, side=1.0)


@pytest.mark.parametrize(
    ("axis", "genes", "joint", "away"),
    [
        ([0, 1.0, 0], {"hold_rate": 0.1}, "hip_pitch", [-1, 0, 0]),
        ([1.0, 0, 0], {"sway_rate": 0.1}, "hip_roll", [0, 1, 0]),
    ],
    ids=["nose goes down", "right side goes down"],
)
def test_the_stance_hip_turns_the_trunk_back(biped, axis, genes, joint, away):
    """When the nose drops, the leg moves back under it, so the trunk on that leg comes up."""
    found = change(biped, seen(biped, lifted=1, trunk_angvel=np.array(axis)), **genes)
    assert list(found) == [f"left_{joint}"]
    assert way(biped, f"left_{joint}", found[f"left_{joint}"]) @ away > 0


@pytest.fixture(scope="module")
def turner(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    """The biped with hips that turn about the vertical; the left axis points down."""
    text = BIPED
    for side, axis in (("left", "0 0 -1"), ("right", "0 0 1")):
        begin = text.index(f'<joint name="{side}_hip_roll"')
        text = text[:begin] + text[begin:].replace(
            '<axis xyz="1 0 0"/>', f'<axis xyz="{axis}"/>', 1
        )
    file = tmp_path_factory.mktemp("turner") / "turner.urdf"
    file.write_text(text, encoding="utf-8")
    return creature_of(import_model(file, ImportChoices(apart=False)).files)


def test_a_heading_error_turns_the_body_on_the_stance_leg(turner: Creature):
    """The nose points left: the trunk turns right over its right foot; the left foot lands
    turned right.
    """
    angle = 0.2
    rot = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    found = change(turner, seen(turner, lifted=0, trunk_rot=rot), turn=1.0)
    assert set(found) == {"left_hip_roll", "right_hip_roll"}
    turned = {}
    for side in ("left", "right"):
        joint = turner.joints.names.index(f"{side}_hip_roll")
        data = mujoco.MjData(turner.model)
        data.qpos[:] = turner.stand_qpos
        data.qpos[turner.joints.qpos_adr[joint]] += found[f"{side}_hip_roll"]
        mujoco.mj_kinematics(turner.model, data)
        toes = data.body(f"{side}_foot").xmat.reshape(3, 3)[:, 0]
        turned[side] = np.arctan2(toes[1], toes[0])
    assert np.abs(list(found.values())) == pytest.approx([angle] * 2, rel=1e-4)
    # The trunk stands slightly tipped, so the hip axes are not quite upright.
    assert turned == pytest.approx({"right": angle, "left": -angle}, rel=0.2)


def test_steps_keep_to_the_correction_limit(biped):
    fast = seen(biped, lifted=0, trunk_vel=np.array([50.0, 0, 0]))
    weights = biped.corrections.stepping
    most = 0.5 * np.abs(weights.ahead).max()
    found = change(biped, fast, step_rate=1.0)
    assert abs(found["left_hip_pitch"]) == pytest.approx(most, rel=1e-5)


def test_the_reference_controller_steps_the_same(biped):
    """Two implementations agree in many moments: feet up and down, tipped, turned and fast."""
    rng = np.random.default_rng(0)
    reads = PoseTracker(biped, STEP).reads
    genes = {name: float(rng.uniform(0, 1)) for name in STEPPING}
    swings = biped.corrections.stepping.ahead != 0
    weights = dataclasses.replace(biped.corrections.stepping, turn=rng.normal(size=8) * swings)
    creature = altered(
        biped,
        joints={"low": np.full(8, -9.0), "high": np.full(8, 9.0)},
        corrections={"stepping": weights},
    )
    values = dict.fromkeys(TUNING, 0.0) | {"threshold": 0.1, "period": 0.8} | genes
    champion = pose_champion(creature, np.stack([biped.joints.stand] * 2), values)
    reference = PoseReference(creature, champion, STEP)
    assert set(reference.reads) == set(reads)
    for _ in range(6):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        rot = turn if rng.random() < 0.3 else np.eye(3)
        moment = seen(
            creature,
            int(rng.integers(2)),
            trunk_rot=rot,
            trunk_pos=creature.frame.stand_pos + rng.normal(0, 0.05, 3),
            trunk_vel=rng.normal(0, 0.7, 3),
            trunk_angvel=rng.normal(0, 0.7, 3),
        )
        felt = sense(creature, moment, jnp.zeros(()), reads)
        ours = stepping(creature, jnp.array([genes[name] for name in STEPPING]), felt)
        state = as_examined(creature, moment)
        theirs = reference.target(
            np.zeros(1, int), examiner_sense(creature, state, reference.reads), np.zeros(1, int)
        )
        np.testing.assert_allclose(np.asarray(ours), theirs[0] - creature.joints.stand, atol=2e-5)


@pytest.mark.parametrize("begin", [0.0, 0.5])
def test_the_cycle_fades_in_from_the_standing_pose(biped: Creature, begin: float):
    """In evolution and in certification; with `begin` = 0 the full cycle applies at once."""
    stand = biped.joints.stand
    pose = np.clip(stand + 0.2, biped.joints.low, biped.joints.high)
    champion = pose_champion(
        biped, np.stack([pose] * 2), {"begin": begin}, PoseConfig(mirror=False)
    )
    control, reference = PoseTracker(biped, STEP), PoseReference(biped, champion, STEP)
    genome = Genome(*(jnp.asarray(champion.genome[name]) for name in ("key_poses", "tuning")))
    cycle = control.prepare(genome, champion.settings)
    moment = seen(biped)
    felt = sense(biped, moment, jnp.zeros(()), control.reads)
    examined = examiner_sense(biped, as_examined(biped, moment), reference.reads)
    for steps in (0, 24, 49, 99, 500):
        state = dataclasses.replace(control.init(), steps=jnp.int32(steps))
        ours, _ = control.act(cycle, state, felt)
        theirs = reference.target(np.zeros(1, int), examined, np.full(1, steps))[0]
        share = min(1.0, (steps + 1) * STEP / begin) if begin else 1.0
        expected = stand + share * (pose - stand)
        np.testing.assert_allclose(ours, expected, atol=1e-6)
        np.testing.assert_allclose(theirs, expected, atol=1e-12)


@pytest.mark.parametrize("told", ["to stop", "to change"])
def test_a_later_command_does_not_change_the_start(biped: Creature, told: str):
    pose = np.clip(biped.joints.stand + 0.2, biped.joints.low, biped.joints.high)
    champion = pose_champion(biped, np.stack([pose] * 2), {"begin": 0.5}, PoseConfig(mirror=False))
    usual, later, once = PoseReference(biped, champion, STEP), np.array([9.0]), np.ones(1)
    if told == "to stop":
        other: ReferenceController = HaltingReference(biped, champion, STEP, later, once)
    else:
        other = ChangingReference(biped, champion, champion, STEP, later, 1.0)
    felt = examiner_sense(biped, as_examined(biped, seen(biped)), usual.reads)
    known, memory = usual.init(1), other.init(1)
    for _ in range(150):
        expected, known = usual.act(known, felt)
        target, memory = other.act(memory, felt)
        np.testing.assert_allclose(target, expected, atol=1e-12)


@pytest.mark.parametrize("key", ["ahead", "aside", "turn"])
def test_a_wrong_stepping_weight_is_rejected(biped: Creature, turner: Creature, key: str):
    creature = turner if key == "turn" else biped
    check_body(creature)
    weights = creature.corrections.stepping
    wrong = dataclasses.replace(weights, **{key: -getattr(weights, key)})
    with pytest.raises(UserError, match=f"stepping weight \\({key}\\)"):
        check_body(altered(creature, corrections={"stepping": wrong}))


def test_an_old_champion_starts_without_the_newer_genes(biped: Creature, tmp_path: Path):
    """Its file lacks `begin` and `turn`: no fade-in, and no turning at the hips."""
    genes = {"begin": 0.7, "turn": 0.2, "hold": 0.3}
    champion = pose_champion(biped, np.stack([biped.joints.stand] * 2), genes)
    file = tmp_path / "champion.json"
    write_champion(champion, biped, file)
    document = json.loads(file.read_text(encoding="utf-8"))
    del document["genome"]["tuning"]["begin"], document["genome"]["tuning"]["turn"]
    file.write_text(json.dumps(document), encoding="utf-8")
    read = read_champion(file, biped).genome["tuning"]
    found = dict(zip(gene_names(steps=True), read, strict=True))
    assert (found["begin"], found["turn"], found["hold"]) == (0.0, 0.0, 0.3)


def as_examined(creature: Creature, moment: Sensed) -> State:
    feet, foot_of = creature.feet, creature.feet.foot_of
    low, pos = np.asarray(moment.geom_low), np.asarray(moment.geom_pos, float)
    places = [np.flatnonzero(foot_of == f) for f in range(len(feet.names))]
    return State(
        start=start_frame(creature),
        ground=None,
        time=np.zeros(1),
        joint_pos=np.asarray(moment.joint_pos)[None],
        velocity=np.zeros((1, creature.model.nv)),
        trunk_pos=np.asarray(moment.trunk_pos, float)[None],
        trunk_rot=np.asarray(moment.trunk_rot, float)[None],
        trunk_vel=np.asarray(moment.trunk_vel, float)[None],
        trunk_angvel=np.asarray(moment.trunk_angvel, float)[None],
        foot_height=np.array([[low[place].min() for place in places]]),
        foot_pos=np.array([[pos[place].mean(0) for place in places]]),
        mass_matrix=np.zeros((1, 0, 0)),
        bias=np.zeros((1, 0)),
        constraint_force=np.zeros((1, 0)),
    )


def test_a_stepping_weight_needs_a_joint_that_moves_a_foot(tmp_path: Path):
    folder = tmp_path / "duck"
    folder.mkdir()
    shipped = Path(__file__).parents[3] / "envs" / "duck"
    for file in ("creature.xml", "creature.toml"):
        (folder / file).write_text((shipped / file).read_text(encoding="utf-8"), encoding="utf-8")
    toml = folder / "creature.toml"
    toml.write_text(
        toml.read_text(encoding="utf-8") + "\n[stepping]\nahead = { neck_pitch = 1.0 }\n",
        encoding="utf-8",
    )
    with pytest.raises(UserError, match='"neck_pitch" moves 0 feet'):
        load_creature(folder)
