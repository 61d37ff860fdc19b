"""The exported USD: posed by its own library, it matches MuJoCo."""

import sys

import mujoco
import numpy as np
import pytest
from rendering.made_up import treading

from mjxgait.animation.export import walk_loop
from mjxgait.animation.export.skeleton import gltf_axes, skeleton_of
from mjxgait.animation.export.surface import pieces_of
from mjxgait.animation.export.usd import export_usd
from mjxgait.errors import UserError
from mjxgait.rendering.walk import record_walk


@pytest.fixture(scope="module")
def loop(stool):
    return walk_loop(record_walk(stool, treading(stool), 4.0), 30)


@pytest.fixture(scope="module")
def usd():
    return pytest.importorskip("pxr.UsdSkel", reason='needs pip install "mjxgait[usd]"')


@pytest.fixture
def opened(loop, usd, tmp_path):
    """The stage, its skeleton and its skin."""
    from pxr import Usd

    export_usd(loop, tmp_path / "walk.usda")
    stage = Usd.Stage.Open(str(tmp_path / "walk.usda"))
    root, cache = usd.Root(stage.GetDefaultPrim()), usd.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    return stage, cache.GetSkelQuery(binding.GetSkeleton()), binding.GetSkinningTargets()


def mujoco_places(loop, qpos):
    """Position [3] of each body, m, in the file's axes."""
    model = loop.walk.creature.model
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    axes = gltf_axes(loop.walk.forward)
    return {model.body(b).name: axes @ data.xpos[b] for b in range(1, model.nbody)}


def test_joints_are_where_mujoco_has_them_at_every_frame(loop, opened):
    stage, skeleton, _ = opened
    names = [path.split("/")[-1] for path in skeleton.GetJointOrder()]
    assert (stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (len(loop.qpos) - 1, 30)
    for frame, qpos in enumerate(loop.qpos):
        found = dict(zip(names, skeleton.ComputeJointSkelTransforms(frame), strict=True))
        for name, place in mujoco_places(loop, qpos).items():
            assert np.array(found[name].ExtractTranslation()) == pytest.approx(place, abs=1e-4)


@pytest.mark.parametrize("frame", [0, 7])
def test_the_skin_is_where_the_shapes_are(loop, opened, frame):
    from pxr import Vt

    _, skeleton, pieces = opened
    creature, axes = loop.walk.creature, gltf_axes(loop.walk.forward)
    plain = skeleton_of(creature.model, creature.trunk)
    expected = pieces_of(creature.model, plain, axes, loop.qpos[frame])
    for piece, there in zip(pieces, expected, strict=True):
        points = Vt.Vec3fArray(piece.GetPrim().GetAttribute("points").Get())
        assert np.abs(np.array(points) - there.points).max() > 0.01
        assert piece.ComputeSkinnedPoints(skeleton.ComputeSkinningTransforms(frame), points, frame)
        assert np.array(points) == pytest.approx(there.points, abs=1e-4)


def test_a_missing_extra_is_named(loop, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(UserError, match=r"\[usd\]"):
        export_usd(loop, tmp_path / "walk.usda")
    assert not (tmp_path / "walk.usda").exists()
