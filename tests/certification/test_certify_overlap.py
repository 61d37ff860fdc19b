"""Overlap of parts: which pairs count, and how deep they are."""

import dataclasses

import mujoco
import numpy as np
import pytest
from certify_made_up import LEGS, TOML, XML, make_champion
from scipy.optimize import minimize

from mjxgait.certification import (
    CertificateConfig,
    criteria,
    nominal_check,
    record,
)
from mjxgait.certification.describe import worst_overlap
from mjxgait.config.tables import build
from mjxgait.creature import load_creature
from mjxgait.creature.overlap import find_crossings
from mjxgait.errors import UserError
from mjxgait.reference.overlap import colliding_with_itself, neighbours, overlaps

SHORT = build(CertificateConfig, {"seconds": 2.0, "warmup": 0.5}, "test")


def loaded(folder, xml, toml=TOML):
    (folder / "creature.xml").write_text(xml)
    (folder / "creature.toml").write_text(toml)
    return load_creature(folder)


def standing(creature, count=1, **angles):
    """Standing poses [count, nq]; angles: of joints by name, in the last frame."""
    qpos = np.tile(creature.stand_qpos, (count, 1))
    for name, angle in angles.items():
        qpos[-1, creature.joints.qpos_adr[creature.joints.names.index(name)]] = angle
    return qpos


def near_behind(xml):
    """Move the hind legs closer to the front legs."""
    for side in ("", "-"):
        xml = xml.replace(f'pos="-0.2 {side}0.11 0"', f'pos="0.06 {side}0.11 0"')
    return xml


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """The tiny quadruped with its legs so close that they meet when they swing."""
    return loaded(tmp_path_factory.mktemp("short"), near_behind(XML))


def test_crossing_legs_overlap_by_their_thickness(short):
    # Both thighs swing by asin(0.5) towards each other: their middles are in one place.
    angle = np.arcsin(0.5)
    qpos = standing(short, 3, front_left_hip=angle, hind_left_hip=-angle)
    found = overlaps(short, qpos)
    thighs = found.pairs.index(("front_left_upper", "hind_left_upper"))
    assert found.depth[:2].max() == 0
    assert found.depth[2, thighs] == pytest.approx(2 * 0.02, abs=1e-6)
    assert not any("right" in name for pair in found.pairs for name in pair)


def test_cylinders_that_barely_touch_have_a_small_depth(tmp_path):
    """MuJoCo 3.17 may report a contact as deep as a radius in single frames.

    One cylinder is on the trunk, about the hip's axis. The other turns with the leg and is 2.59 mm
    deep in its end.
    """
    ahead, aside = np.sqrt([0.5, 0.5]), [-0.0022, -0.0359, 0.1135]
    upright, place, turned = np.array([ahead[0], -ahead[1], 0, 0]), np.zeros(3), np.zeros(4)
    mujoco.mju_rotVecQuat(place, np.array(aside), upright)
    place[2] += 0.14
    mujoco.mju_mulQuat(turned, upright, np.array([-0.44833, 0.55145, 0.44344, 0.54613]))
    placed = [" ".join(map(str, values)) for values in (upright, place, turned)]
    still = '<geom type="cylinder" size="0.05 0.05" pos="0.2 0.11 0" quat="{}" mass="0.01"/>'
    turns = '<geom type="cylinder" size="0.066 0.06" pos="{}" quat="{}" mass="0.01"/>'
    leg = '<joint name="front_left_knee"'
    xml = XML.replace("<freejoint/>", "<freejoint/>" + still.format(placed[0]))
    creature = loaded(tmp_path, xml.replace(leg, turns.format(*placed[1:]) + leg))
    hips = np.linspace(-0.15, 0.15, 121)
    qpos = np.concatenate([standing(creature, front_left_hip=angle) for angle in hips])
    found = overlaps(creature, qpos, excused=False)
    both = found.depth[:, found.pairs.index(("trunk", "front_left_lower"))]
    np.testing.assert_allclose(both, 0.00259, atol=1e-4)


def least_way_out(box, disc, place, axes):
    """Least distance in m that moves a disc out of a box, in the frame of the box.

    Two convex shapes are apart along a direction if one ends before the other begins.
    place: [3] m, centre of the disc. axes: [3, 3], axes of the disc as columns, its normal last.
    """

    def shared(way):
        way = way / np.linalg.norm(way)
        along = axes.T @ way
        reach = np.hypot(*along[:2]) * disc[0] + abs(along[2]) * disc[1]
        return np.abs(way) @ box - place @ way + reach

    ways = np.vstack([np.random.default_rng(0).normal(size=(2000, 3)), np.eye(3), axes.T])
    ways = np.concatenate([ways, -ways])
    best = sorted(ways, key=shared)[:3]
    return min(minimize(shared, way, method="Nelder-Mead").fun for way in best)


def test_the_depth_of_a_disc_in_a_box_is_near_the_least_way_out(tmp_path):
    """A motor's disc turns in a trunk, and the depth of MuJoCo's contacts varies from 3 to 28 mm.

    A robot was refused for 25 mm more than in its standing pose.
    """
    box, disc = np.array([0.3235, 0.15, 0.075]), (0.05, 0.01)
    beside = np.array([0.3455, -0.1455, 0.0142])
    tilted = np.array([[0.8241, 0.5664, 0], [-0.1076, 0.1566, -0.9818], [-0.5561, 0.8091, 0.19]])
    tilted, _ = np.linalg.qr(tilted)
    tilted[:, 2] *= np.sign(np.linalg.det(tilted))
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, tilted.ravel())
    # On the lower leg, half a metre to the left of it, where nothing else is.
    aside, knee = np.array([0.0, 0.5, 0.0]), np.array([0.2, 0.11, -0.14])
    middle = knee + aside - beside
    at, by, turned = (" ".join(map(str, values)) for values in (middle, aside, quat))
    shape = f'<geom type="box" size="0.3235 0.15 0.075" pos="{at}" mass="0.01"/>'
    wheel = f'<geom type="cylinder" size="0.05 0.01" pos="{by}" quat="{turned}" mass="0.01"/>'
    leg = '<joint name="front_left_knee"'
    xml = XML.replace("<freejoint/>", "<freejoint/>" + shape).replace(leg, wheel + leg)
    creature = loaded(tmp_path, xml)
    swings = np.linspace(-0.15, 0.15, 31)
    qpos = np.concatenate([standing(creature, front_left_hip=angle) for angle in swings])
    found = overlaps(creature, qpos, excused=False)
    both = found.depth[:, found.pairs.index(("trunk", "front_left_lower"))]
    model, data, deep = creature.model, mujoco.MjData(creature.model), []
    trunk = model.body("trunk").id
    for pose in qpos:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        wheel_geom = next(g for g in range(model.ngeom) if tuple(model.geom_size[g, :2]) == disc)
        base, turn = data.xpos[trunk], data.xmat[trunk].reshape(3, 3)
        place = turn.T @ (data.geom_xpos[wheel_geom] - base) - middle
        axes = turn.T @ data.geom_xmat[wheel_geom].reshape(3, 3)
        deep.append(least_way_out(box, disc, place, axes))
    assert min(deep) > 0.005
    assert (both > 0.9 * np.array(deep)).all()
    assert (both < 2 * np.array(deep)).all()


def test_every_shape_counts_except_the_floor(short):
    model = colliding_with_itself(short)
    assert (model.geom_contype[model.geom_bodyid > 0] == 1).all()
    assert model.geom("floor").contype == model.geom("floor").conaffinity == 0
    sunk = standing(short)
    sunk[:, 2] -= 0.2
    assert overlaps(short, sunk).pairs == ()


def test_a_folded_knee_causes_no_overlap(short):
    assert overlaps(short, standing(short, 2, front_left_knee=-1.2)).pairs == ()


def test_a_welded_body_is_one_with_its_parent(tmp_path):
    """No joint separates the two."""
    plate = '<body name="plate"><geom size="0.03" pos="0.2 0 0" mass="0.01"/></body>'
    creature = loaded(tmp_path, XML.replace("<freejoint/>", "<freejoint/>" + plate))
    names = creature.model.body
    pairs = {(names(a).name, names(b).name) for a, b in neighbours(creature.model, creature)}
    assert {("trunk", "plate"), ("plate", "front_left_upper")} <= pairs
    assert ("plate", "front_left_lower") not in pairs


YOKE = (
    '<body name="front_left_yoke" pos="0.2 {y} 0"><joint name="front_left_yaw" axis="0 0 1"/>'
    '<geom type="sphere" size="0.001" mass="0.01" contype="0" conaffinity="0"/>'
    '<body name="front_left_upper" pos="0 {offset} 0">'
)
"""A second joint between trunk and thigh, on a body of its own."""


@pytest.mark.parametrize(("offset", "one_joint"), [(0.0, True), (0.05, False)])
def test_joints_at_one_place_make_the_parts_between_neighbours(tmp_path, offset, one_joint):
    begin = XML.index('<body name="front_left_upper"')
    end = XML.index('<body name="front_right_upper"')
    yoke = YOKE.format(y=0.11 - offset, offset=offset)
    leg = XML[begin:end].replace('<body name="front_left_upper" pos="0.2 0.11 0">', yoke)
    xml = XML[:begin] + leg + "</body>" + XML[end:]
    toml = TOML + "\n[mirror]\nsymmetric = false\n"
    creature = loaded(tmp_path, xml.replace("0 " * 8, "0 " * 9), toml)
    model = creature.model
    pairs = {(model.body(a).name, model.body(b).name) for a, b in neighbours(model, creature)}
    assert {("trunk", "front_left_yoke"), ("front_left_yoke", "front_left_upper")} <= pairs
    assert (("trunk", "front_left_upper") in pairs) == one_joint
    assert ("trunk", "front_left_lower") not in pairs


@pytest.mark.parametrize("planar", [True, False])
def test_legs_of_a_planar_body_pass_each_other(tmp_path, planar):
    """Only parts of two limbs pass, in evolution and in the examination."""
    toml = TOML.replace("[creature]", f"[creature]\nplanar = {str(planar).lower()}", 1)
    creature = loaded(tmp_path, near_behind(XML), toml)
    model = creature.model
    pairs = {(model.body(a).name, model.body(b).name) for a, b in neighbours(model, creature)}
    assert (("front_left_lower", "hind_left_lower") in pairs) == planar
    assert (("front_left_upper", "hind_left_lower") in pairs) == planar
    assert ("trunk", "front_left_lower") not in pairs
    found = find_crossings(creature)
    body = model.body("front_left_lower").id, model.body("hind_left_lower").id
    watched = {*zip(found.body[found.first], found.body[found.second], strict=True)}
    assert (body in watched) != planar
    assert any(model.body("trunk").id in pair for pair in watched)


def test_the_examination_checks_that_hinges_are_parallel(tmp_path):
    """It does not rely on the shared loader: legs with another axis could avoid each other."""
    knee = 'name="front_left_knee" axis="'
    xml = near_behind(XML).replace(knee + "0 1 0", knee + "0.2 1 0")
    creature = loaded(tmp_path, xml, TOML + "\n[mirror]\nsymmetric = false\n")
    stated = dataclasses.replace(creature.settings.creature, planar=True)
    settings = dataclasses.replace(creature.settings, creature=stated)
    planar, names = dataclasses.replace(creature, settings=settings), creature.model.body
    pairs = {(names(a).name, names(b).name) for a, b in neighbours(planar.model, planar)}
    assert ("front_left_lower", "hind_left_lower") not in pairs
    assert ("front_right_lower", "hind_right_lower") in pairs


def test_a_planar_body_needs_parallel_hinges(tmp_path):
    knee = 'name="hind_left_knee" axis="'
    toml = TOML.replace("[creature]", "[creature]\nplanar = true", 1)
    toml += "\n[mirror]\nsymmetric = false\n"
    with pytest.raises(UserError, match='planar: joint "hind_left_knee" turns about another axis'):
        loaded(tmp_path, XML.replace(knee + "0 1 0", knee + "0.2 1 0"), toml)


def test_overlap_counts_beyond_that_of_the_standing_pose(tmp_path):
    """A shin that stands 5 mm deep in a fender of the trunk, and deeper when the knee stretches."""
    fender = (
        '<geom name="fender" type="box" size="0.01 0.02 0.03" pos="0.22 0.11 -0.2" mass="0"'
        ' contype="0" conaffinity="0"/>'
    )
    creature = loaded(tmp_path, XML.replace("<freejoint/>", "<freejoint/>" + fender))
    found = overlaps(creature, standing(creature, 2, front_left_knee=-0.05))
    assert found.pairs == (("trunk", "front_left_lower"),)
    # The fender's lower edge is 90 mm below the knee.
    assert found.depth[:, 0] == pytest.approx([0.0, 0.09 * np.sin(0.05)], abs=5e-4)


def test_frames_that_are_not_finite_have_no_depth(short):
    qpos = standing(short, 3, front_left_hip=0.5, hind_left_hip=-0.5)
    qpos[1] = np.nan
    assert np.isnan(overlaps(short, qpos).depth[1]).all()


def test_crossing_legs_fail_criterion_9_and_are_named(short):
    column = {name: i for i, name in enumerate(short.joints.names)}
    poses = np.zeros((2, 8))
    for leg in LEGS:
        poses[:, column[f"{leg}_hip"]] = 0.5 if leg.startswith("front") else -0.5
    crossed = make_champion(short, poses)
    evaluation = {c.number: c for c in nominal_check(short, crossed, SHORT).criteria}
    assert not evaluation[9].passed
    worst = worst_overlap(record(short, crossed, 2.0).window(0.5))
    assert {part.split("_")[0] for part in worst["parts"]} == {"front", "hind"}
    assert worst["depth"] > 0.02 * short.frame.hip_height
    assert worst["share"] > 0.5


def test_a_body_without_overlap_passes_criterion_9(short):
    window = record(short, make_champion(short), 2.0).window(0.5)
    assert criteria.parts(window, SHORT.parts).margin == 1.0
    assert worst_overlap(window) is None


def test_criterion_9_measures_overlap_in_hip_heights(short):
    window = record(short, make_champion(short), 2.0)
    deep = dataclasses.replace(window, overlap=np.array([[0.0, 0.003], [0.001, 0.0]]))
    assert criteria.parts(deep, SHORT.parts).measures[0].value == 0.003 / short.frame.hip_height
