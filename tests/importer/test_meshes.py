"""Meshes that MuJoCo cannot read, and parts without any shape."""

import functools
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from importer.models import BIPED, bring
from trimesh.exchange.dae import export_collada

from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.importer import Imported
from mjxgait.importer.meshes import convert, converted
from mjxgait.reference.measure import dimensions

BLOCK = trimesh.creation.box(
    (0.06, 0.08, 0.2), trimesh.transformations.translation_matrix((0, 0, -0.12))
)
MILLIMETRES = b'<asset><unit name="millimeter" meter="0.001"/>'


pytestmark = pytest.mark.usefixtures("a_short_search")
bring_urdf = functools.partial(bring, kind="urdf")


def written(kind: str, mesh: trimesh.Trimesh = BLOCK) -> bytes:
    data = export_collada(mesh) if kind == "dae" else mesh.export(file_type=kind)
    assert isinstance(data, bytes)
    return data


def size_of(data: bytes) -> np.ndarray:
    corners = [line.split()[1:4] for line in data.decode().splitlines() if line.startswith("v ")]
    return np.ptp(np.array(corners, float), axis=0)


@pytest.mark.parametrize("kind", ["dae", "ply", "glb"])
def test_a_mesh_keeps_its_size(kind: str):
    np.testing.assert_allclose(
        size_of(converted(written(kind), f".{kind}")), BLOCK.extents, rtol=1e-5
    )


def test_a_mesh_has_the_unit_that_its_file_states():
    data = written("dae").replace(b"<asset>", MILLIMETRES)
    np.testing.assert_allclose(size_of(converted(data, ".dae")), BLOCK.extents / 1000, rtol=1e-5)


@pytest.mark.parametrize(
    ("key", "data"),
    [
        ("asset0.dae.obj", b"<COLLADA/>"),
        ("asset0.glb.obj", written("glb")[:200]),
        ("asset0.ply.obj", b"ply\nformat ascii 1.0\nelement vertex 1000000000000\nend_header\n"),
        ("asset0.dae.obj", b""),
    ],
)
def test_a_damaged_mesh_is_reported(key: str, data: bytes):
    assets, failed = {key: data, "asset1.stl": b"as it is"}, []
    convert(assets, lambda *told: failed.append(told))
    assert assets == {key: b"", "asset1.stl": b"as it is"}
    assert [told[0] for told in failed] == [key]


NAMES = re.findall(r"package://biped/meshes/(\w+)\.dae", BIPED)


def bring_meshes(tmp_path: Path, data: bytes) -> tuple[Creature, Imported]:
    """A biped with this mesh for each link, and no other shapes."""
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    for name in NAMES:
        (meshes / f"{name}.dae").write_bytes(data)
    text = re.sub(r"<collision>.*?</collision>", "", BIPED).replace("package://biped/", "")
    return bring_urdf(tmp_path, text)


@pytest.mark.parametrize("turned", [False, True])
def test_the_up_axis_of_a_collada_file_counts_where_links_fit_for_it(tmp_path: Path, turned: bool):
    """Viewers disagree about it, so there are files of both kinds."""
    mesh = BLOCK.copy()
    if turned:
        mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    data = written("dae", mesh).replace(b"<asset>", b"<asset><up_axis>Y_UP</up_axis>")
    creature, imported = bring_meshes(tmp_path, data)
    model = creature.model
    assert ("turned so that their y is up" in imported.notes.text()) == turned
    shin = next(g for g in range(model.ngeom) if "shin" in model.body(model.geom_bodyid[g]).name)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[shin])
    half = np.abs(rotation.reshape(3, 3)) @ model.geom_aabb[shin][3:]
    np.testing.assert_allclose(half, BLOCK.extents / 2, rtol=1e-3)


def test_feet_get_the_soles_of_their_collada_meshes(tmp_path: Path):
    creature, imported = bring_meshes(tmp_path, written("dae"))
    for words in ("mesh and its shapes dropped", "capsules for", "sphere added"):
        assert words not in imported.notes.text(), words
    hulls = creature.model.geom_dataid[creature.model.geom_dataid >= 0]
    assert len(hulls) == len(NAMES)
    assert imported.stands
    assert all(len(names) > 0 for names in creature.feet.names)


def test_a_mesh_that_cannot_be_read_is_named_as_in_the_model(tmp_path: Path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "trunk.dae").write_bytes(b"<COLLADA/>")
    _, imported = bring_urdf(tmp_path, BIPED.replace("package://biped/", ""))
    assert 'shapes dropped "meshes/trunk.dae"' in imported.notes.text()


@pytest.mark.parametrize(
    ("model", "reference"),
    [("urdf", "package://biped/meshes/"), ("urdf", "../meshes/"), ("deep/down", "../../meshes/")],
)
def test_meshes_beside_a_package_s_models_are_found(tmp_path: Path, model: str, reference: str):
    """The layout of ROS packages: my_robot/urdf, my_robot/meshes, my_robot/package.xml."""
    (tmp_path / model).mkdir(parents=True)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "trunk.dae").write_bytes(written("dae"))
    if model != "urdf":
        (tmp_path / "package.xml").touch()
    text = BIPED.replace("package://biped/meshes/", reference)
    _, imported = bring_urdf(tmp_path / model, text)
    assert "trunk.dae" not in imported.notes.text()


def test_a_mesh_outside_of_the_package_is_not_read(tmp_path: Path):
    (tmp_path / "robot" / "mine").mkdir(parents=True)
    (tmp_path / "robot" / "trunk.dae").write_bytes(written("dae"))
    text = BIPED.replace("package://biped/meshes/", "../")
    _, imported = bring_urdf(tmp_path / "robot" / "mine", text)
    assert 'mesh "../trunk.dae" dropped' in imported.notes.text()


def test_a_trunk_without_mass_gets_the_capsule_of_the_link_fixed_to_it(tmp_path: Path):
    """Many files begin with a link without mass and fix the real trunk to it."""
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", BIPED)
    name = re.search(r'<link name="(\w+)">', text)
    assert name
    first = (
        '<link name="nothing"/><joint name="fixed" type="fixed"><parent link="nothing"/>'
        f'<child link="{name[1]}"/><origin xyz="0 0 0.1" rpy="0 0 0.5"/></joint>'
    )
    plain, _ = bring_urdf(tmp_path, text)
    creature, imported = bring_urdf(tmp_path, re.sub(r"(<robot[^>]*>)", rf"\1{first}", text))
    assert "capsules for nothing" in imported.notes.text()
    sizes = [c.model.geom_size[c.model.geom_bodyid == 1] for c in (plain, creature)]
    np.testing.assert_allclose(*sizes, rtol=1e-3)


def test_parts_without_a_shape_get_capsules_along_their_bones(tmp_path: Path):
    """A body that nobody can see is in no picture, and none of its parts stands in another."""
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", BIPED)
    creature, imported = bring_urdf(tmp_path, text)
    assert "capsules for" in imported.notes.text()
    model = creature.model
    seen = {model.body(model.geom_bodyid[g]).name for g in np.flatnonzero(model.geom_group < 3)}
    parts = {model.body(b).name for b in model.jnt_bodyid}
    assert parts - seen == {"left_hip", "right_hip"}, "the crosses between trunk and thighs"
    assert 0 < dimensions(creature).shapeless < 0.1
    assert np.flatnonzero(model.geom_conaffinity).size == model.ngeom - len(seen) + 1


def test_a_trunk_on_one_joint_gets_a_capsule_through_its_weight(tmp_path: Path):
    """Some humanoids carry arms and head on a trunk that turns on one waist."""
    legs = "".join(
        f'<body name="{side}_thigh" pos="0 {y} 0"><joint name="{side}_hip" axis="0 1 0" range="-60 60"/>'
        f'<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".04"/><body name="{side}_shin" pos="0 0 -.2">'
        f'<joint name="{side}_knee" axis="0 1 0" range="0 90"/><geom type="capsule" fromto="0 0 0 0 0 -.2" '
        'size=".03"/><geom type="box" pos=".03 0 -.22" size=".09 .04 .02"/></body></body>'
        for side, y in (("left", 0.1), ("right", -0.1))
    )
    text = (
        '<mujoco><compiler angle="degree"/><worldbody><body name="trunk" pos="0 0 .6"><freejoint/>'
        '<inertial pos="0 0 .2" mass="12" diaginertia=".2 .2 .1"/><body name="waist">'
        '<joint name="waist" axis="0 0 1" range="-40 40"/><geom type="sphere" size=".08"/>'
        f"{legs}</body></body></worldbody></mujoco>"
    )
    creature, imported = bring(tmp_path, text)
    assert "capsules for trunk" in imported.notes.text()
    assert dimensions(creature).shapeless == 0
    model = creature.model
    (bone,) = np.flatnonzero(model.geom_bodyid == creature.trunk)
    np.testing.assert_allclose(model.geom_pos[bone], [0, 0, 0.2], atol=1e-6)
    assert model.geom_size[bone, 1] == pytest.approx(0.2)


def test_a_mass_that_only_an_unreadable_mesh_tells_is_refused(tmp_path: Path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "trunk.dae").write_bytes(b"<COLLADA/>")
    weightless = re.sub(r"<inertial>.*?</inertial>", "", BIPED, count=1)
    text = re.sub(
        r"<collision>.*?</collision>",
        '<collision><geometry><mesh filename="meshes/trunk.dae"/></geometry></collision>',
        weightless,
        count=1,
    )
    with pytest.raises(UserError, match="a mass that only its mesh states"):
        bring_urdf(tmp_path, text)
