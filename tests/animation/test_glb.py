"""The exported glTF: the same motion as MuJoCo's, without a seam, valid for every reader."""

import json
import shutil
import subprocess
from typing import get_args

import mujoco
import numpy as np
import pygltflib as gltf
import pytest
from rendering.made_up import treading

from mjxgait.animation import Rate
from mjxgait.animation.export import build_glb, walk_loop
from mjxgait.animation.export.skeleton import gltf_axes, resting
from mjxgait.animation.export.surface import ALONG, geom_surface
from mjxgait.cli import main
from mjxgait.config.layers import find_creature
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.rendering.walk import record_walk

MILLIMETRE = 1e-3
WIDTH = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
KIND = {
    gltf.FLOAT: np.float32,
    gltf.UNSIGNED_BYTE: np.uint8,
    gltf.UNSIGNED_SHORT: np.uint16,
    gltf.UNSIGNED_INT: np.uint32,
}


ALWAYS = ("crab", "luxo")
"""One with many legs, and one with a single leg and its own shapes."""
OTHERS = ("alien", "duck", "short_quadruped", "tall_quadruped")


@pytest.fixture(
    scope="module",
    params=[*ALWAYS, *(pytest.param(n, marks=pytest.mark.thorough("a body more")) for n in OTHERS)],
)
def loop(request):
    creature = load_creature(find_creature(request.param))
    return walk_loop(record_walk(creature, treading(creature, degrees=8.0), 2.5), 30)


def read(document, accessor):
    """An accessor's values [n, width]."""
    a = document.accessors[accessor]
    view = document.bufferViews[a.bufferView]
    values = np.frombuffer(
        document.binary_blob(), KIND[a.componentType], a.count * WIDTH[a.type], view.byteOffset
    )
    return values.reshape(a.count, WIDTH[a.type])


def matrix(translation, quat):
    x, y, z, w = quat
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, np.array([w, x, y, z], float))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turned.reshape(3, 3), translation
    return pose


def node_poses(document, frame=None):
    """World matrix of each skin joint by name, at a key frame or at rest, from the file alone."""
    local = [
        (np.array(n.translation or [0, 0, 0]), np.array(n.rotation or [0, 0, 0, 1]))
        for n in document.nodes
    ]
    if frame is not None:
        animation = document.animations[0]
        for channel in animation.channels:
            value = read(document, animation.samplers[channel.sampler].output)[frame]
            place = ("translation", "rotation").index(channel.target.path)
            local[channel.target.node] = tuple(
                value if i == place else old for i, old in enumerate(local[channel.target.node])
            )
    poses = {}

    def visit(node, above):
        poses[node] = above @ matrix(*local[node])
        for child in document.nodes[node].children or []:
            visit(child, poses[node])

    visit(document.skins[0].joints[0], np.eye(4))
    return {document.nodes[node].name: pose for node, pose in poses.items()}


def body_axes(loop, document):
    """Rotation [3, 3] from each body's axes in MuJoCo to its bone's, by name."""
    model, axes = loop.walk.creature.model, gltf_axes(loop.walk.forward)
    data, poses = mujoco.MjData(model), node_poses(document)
    data.qpos[:] = resting(loop)
    mujoco.mj_kinematics(model, data)
    bodies = {
        model.body(b).name: axes @ data.xmat[b].reshape(3, 3) @ axes.T for b in range(model.nbody)
    }
    return {n: poses[n][:3, :3].T @ turned for n, turned in bodies.items() if n in poses}


@pytest.mark.parametrize("travelling", [False, True])
def test_joints_are_where_mujoco_has_them_at_every_frame(loop, travelling):
    creature = loop.walk.creature
    document = gltf.GLTF2.load_from_bytes(build_glb(loop, travelling))
    axes, data = gltf_axes(loop.walk.forward), mujoco.MjData(creature.model)
    own = body_axes(loop, document)
    worst = 0.0
    for frame, qpos in enumerate(loop.qpos):
        data.qpos[:] = qpos
        mujoco.mj_forward(creature.model, data)
        moved = [0, 0, loop.advance * frame / (len(loop.qpos) - 1)] if travelling else [0, 0, 0]
        poses = node_poses(document, frame)
        for joint in range(creature.model.njnt):
            body = creature.model.jnt_bodyid[joint]
            pose = poses[creature.model.body(body).name]
            turned = pose[:3, :3] @ own[creature.model.body(body).name]
            anchor = pose[:3, 3] + turned @ (axes @ creature.model.jnt_pos[joint])
            expected = data.xanchor[joint] if creature.model.jnt_type[joint] else data.xpos[body]
            worst = max(worst, np.abs(anchor - (axes @ expected + moved)).max())
            assert np.abs(turned - axes @ data.xmat[body].reshape(3, 3) @ axes.T).max() < 1e-4
    assert worst < MILLIMETRE


def test_the_loop_is_the_recorded_walk(loop):
    """Closing the seam moves no joint far: the strides were steady."""
    walk = loop.walk
    starts = walk.steady_strides(loop.strides)
    recorded = walk.qpos[starts[0] : starts[1], walk.creature.joints.qpos_adr]
    looped = loop.qpos[:, walk.creature.joints.qpos_adr]
    nearest = np.abs(looped[:, None] - recorded[None]).max(2).min(1)
    assert nearest.max() < np.radians(3.0)


def test_the_loop_has_no_seam(loop):
    assert (loop.qpos[0] == loop.qpos[-1]).all()
    # Speed changes no more across the seam than elsewhere.
    turn = np.abs((loop.qpos[1] - loop.qpos[0]) - (loop.qpos[-1] - loop.qpos[-2])).max()
    turns = np.abs(np.diff(loop.qpos, 2, axis=0)).max()
    assert turn < 1.5 * turns + 1e-6


def test_in_place_stays_at_the_origin_and_travelling_leads_forward(stool):
    loop = walk_loop(record_walk(stool, treading(stool, degrees=15.0), 4.0), 30)
    still, moving = (
        gltf.GLTF2.load_from_bytes(build_glb(loop, travelling)) for travelling in (False, True)
    )
    for frame in range(len(loop.qpos)):
        assert np.abs(node_poses(still, frame)["trunk"][[0, 2], 3]).max() < 0.1
    last = node_poses(moving, len(loop.qpos) - 1)["trunk"] - node_poses(moving, 0)["trunk"]
    np.testing.assert_allclose(last[:3, 3], [0, 0, loop.advance], atol=1e-5)


@pytest.mark.parametrize("rate", get_args(Rate))
def test_frames_follow_the_rate_and_the_duration_is_kept(stool, rate):
    loop = walk_loop(record_walk(stool, treading(stool, period=0.53), 6.0), rate)
    document = gltf.GLTF2.load_from_bytes(build_glb(loop))
    times = read(document, document.animations[0].samplers[0].input)[:, 0]
    np.testing.assert_allclose(times, np.arange(len(times)) / rate, atol=1e-6)
    assert loop.stretched == pytest.approx(1.0, abs=0.02)


def test_up_is_y_and_forward_is_z():
    axes = gltf_axes(np.array([0.6, 0.8]))
    np.testing.assert_allclose(axes @ [0, 0, 1], [0, 1, 0])
    np.testing.assert_allclose(axes @ [0.6, 0.8, 0], [0, 0, 1], atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_the_only_skin_rests_in_the_standing_pose(loop):
    document = gltf.GLTF2.load_from_bytes(build_glb(loop))
    assert len(document.skins) == len(document.animations) == len(document.meshes) == 1
    inverse = (
        read(document, document.skins[0].inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    )
    for joint, bind in zip(document.skins[0].joints, inverse, strict=True):
        np.testing.assert_allclose(
            node_poses(document)[document.nodes[joint].name] @ bind, np.eye(4), atol=1e-5
        )
    points = np.concatenate(
        [read(document, p.attributes.POSITION) for p in document.meshes[0].primitives]
    )
    assert abs(points[:, 1].min()) < 0.02 * loop.walk.creature.frame.stand_height + 0.005


def test_bones_lie_along_the_limbs_and_turn_about_their_hinges(loop):
    """Programs draw a bone along its Y axis; a turn about X turns the part's last hinge."""
    document, model = gltf.GLTF2.load_from_bytes(build_glb(loop)), loop.walk.creature.model
    nodes, poses = document.nodes, node_poses(document)
    data, axes = mujoco.MjData(model), gltf_axes(loop.walk.forward)
    data.qpos[:] = resting(loop)
    mujoco.mj_kinematics(model, data)
    alone = [n for n in nodes if len(n.children or []) == 1 and n.name != "root"]
    assert alone
    for bone in alone:
        x, y, _, start = poses[bone.name][:3].T
        way = poses[nodes[bone.children[0]].name][:3, 3] - start
        assert y @ way == pytest.approx(np.linalg.norm(way))
        part = model.body(bone.name)
        axis = axes @ data.xaxis[int(part.jntadr[0] + part.jntnum[0]) - 1]
        if abs(axis @ y) < ALONG:
            assert abs(x @ axis) == pytest.approx(np.linalg.norm(axis - (axis @ y) * y), abs=1e-5)


def test_limbs_end_in_a_joint_where_the_part_ends(loop):
    document, creature = gltf.GLTF2.load_from_bytes(build_glb(loop)), loop.walk.creature
    poses = node_poses(document)
    model = creature.model
    feet = {int(model.geom_bodyid[geom]) for geom in creature.feet.stepping} - {creature.trunk}
    for foot in (model.body(body).name for body in feet):
        height = poses[f"{foot}_tip"][1, 3]
        assert abs(height) < 0.1 * creature.frame.stand_height


def test_materials_have_the_names_of_the_model_or_of_a_part(loop):
    model = loop.walk.creature.model
    known = {model.mat(m).name for m in range(model.nmat)} | {
        model.body(b).name for b in range(model.nbody)
    }
    names = [m.name for m in gltf.GLTF2.load_from_bytes(build_glb(loop)).materials]
    assert set(names) <= known
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        ('type="sphere" size="0.2"', 4 / 3 * np.pi * 0.2**3),
        ('type="capsule" size="0.1 0.2"', 4 / 3 * np.pi * 0.1**3 + np.pi * 0.1**2 * 0.4),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
        ('type="cylinder" size="0.1 0.2"', np.pi * 0.1**2 * 0.4),
        ('type="box" size="0.1 0.2 0.3"', 8 * 0.1 * 0.2 * 0.3),
        ('type="mesh" mesh="m"', 0.4**3 / 6),
    ],
)
def test_surfaces_are_closed_and_face_outwards(shape, volume):
    """By the divergence theorem an outward, closed surface has the volume of its solid."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><mesh name="m" vertex="0 0 0 0.4 0 0 0 0.4 0 0 0 0.4"/></asset>'
        f"<worldbody><body><geom {shape}/></body></worldbody></mujoco>"
    )
    points, normals, faces = geom_surface(model, 0)
    corners = points[faces]
    inside = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert inside == pytest.approx(volume, rel=0.08)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fi,fi->f", facing, normals[faces].mean(1)) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)


def test_a_champion_without_a_steady_stride_is_refused(stool):
    with pytest.raises(UserError, match="no steady stride"):
        walk_loop(record_walk(stool, treading(stool), 0.4))


def test_the_command_writes_the_file(stool_run, tmp_path, capsys):
    for name, code in (("walk.glb", 0), ("walk.gltf", 2), ("missing/walk.glb", 2)):
        with pytest.raises(SystemExit) as ended:
            main(
                [
                    "export",
                    str(stool_run),
                    "--out",
                    str(tmp_path / name),
                    "--rate",
                    "24",
                    "--travelling",
                ]
            )
        assert ended.value.code == code
    assert "24 frames/s" in capsys.readouterr().out
    assert (tmp_path / "walk.glb").read_bytes()[:4] == b"glTF"


def test_the_file_states_when_the_feet_are_down(stool_run, tmp_path):
    with pytest.raises(SystemExit):
        main(["export", str(stool_run), "--out", str(tmp_path / "walk.glb")])
    document = gltf.GLTF2.load_from_bytes((tmp_path / "walk.glb").read_bytes())
    (animation,) = document.animations
    end = read(document, animation.samplers[0].input).max()
    for fall in animation.extras["contacts"]:
        assert fall["foot"] in {node.name for node in document.nodes}
        assert 0 <= fall["down"] < end
        assert fall["down"] < fall["up"] < 2 * end
    assert len({fall["foot"] for fall in animation.extras["contacts"]}) == 4


VALIDATE = """
require("gltf-validator").validateBytes(new Uint8Array(require("fs").readFileSync(process.argv[1])))
  .then(report => console.log(JSON.stringify(report.issues)))
"""


@pytest.fixture(scope="module")
def validate():
    """The Khronos validator on a file; needs Node and `npm install --global gltf-validator`."""
    if not (shutil.which("node") and shutil.which("npm")):
        pytest.skip("needs Node.js (apt: nodejs, npm)")
    where = subprocess.run(
        ["npm", "root", "--global"], capture_output=True, text=True, check=True
    ).stdout.strip()

    def run(path):
        done = subprocess.run(
            ["node", "-e", VALIDATE, str(path)],
            env={"NODE_PATH": where},
            capture_output=True,
            text=True,
        )
        if "Cannot find module" in done.stderr:
            pytest.skip("needs the validator: npm install --global gltf-validator")
        return json.loads(done.stdout)

    return run


@pytest.mark.parametrize("travelling", [False, True])
def test_the_validator_finds_nothing(loop, validate, tmp_path, travelling):
    (tmp_path / "walk.glb").write_bytes(build_glb(loop, travelling))
    issues = validate(tmp_path / "walk.glb")
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]
