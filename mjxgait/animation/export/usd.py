"""A walk as a USD file: a skeleton with its skin and its motion, in UsdSkel.

Y is up, forward +Z, lengths are m. Needs the extra `[usd]`.
"""

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mjxgait.animation.export.loop import WalkLoop, animation_of
from mjxgait.animation.export.skeleton import (
    Skeleton,
    gltf_axes,
    moved,
    resting,
    skeleton_of,
    world_poses,
)
from mjxgait.animation.export.surface import Piece, along_limbs, linear, pieces_of
from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.files import replaced

if TYPE_CHECKING:
    from pxr import Sdf, Usd


def export_usd(loop: WalkLoop, path: Path, travelling: bool = False) -> None:
    """Write the loop: a text file if the name ends with .usda, otherwise a binary one.

    travelling: as for a GLB.

    Raises:
      UserError: the extra is not installed, or the file cannot be written.
    """
    try:
        from pxr import Tf, Usd, UsdGeom, UsdSkel
    except ImportError:
        raise UserError(f"{path}: USD needs an extra: {install_command('usd')}") from None
    creature = loop.walk.creature
    model, rest, axes = creature.model, resting(loop), gltf_axes(loop.walk.forward)
    skeleton = along_limbs(model, skeleton_of(model, creature.trunk), rest, axes)
    with replaced(path) as beside:
        try:
            stage = Usd.Stage.CreateNew(str(beside))
        except Tf.ErrorException:
            raise UserError(f"{path}: cannot be written") from None
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(loop.rate)
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(len(loop.qpos) - 1)
        root = UsdSkel.Root.Define(stage, f"/{_word(creature.name)}")
        stage.SetDefaultPrim(root.GetPrim())
        joints = _add_skeleton(stage, root.GetPath(), loop, skeleton, travelling)
        for number, piece in enumerate(pieces_of(loop.walk.dressed, skeleton, axes, rest)):
            # Several pieces may have one name, and one may be called as the skeleton is.
            place = root.GetPath().AppendChild(f"piece_{number}_{_word(piece.name)}")
            _add_piece(stage, place, piece, joints)
        stage.GetRootLayer().Save()


def _add_skeleton(
    stage: "Usd.Stage", root: "Sdf.Path", loop: WalkLoop, skeleton: Skeleton, travelling: bool
) -> "Sdf.Path":
    """Add the joints with their rest and their motion; return the skeleton's path."""
    from pxr import UsdSkel, Vt

    model, axes = loop.walk.creature.model, gltf_axes(loop.walk.forward)
    paths: list[str] = []
    for name, parent in zip(skeleton.names, skeleton.parent, strict=True):
        paths.append(f"{paths[parent]}/{_word(name)}" if parent >= 0 else _word(name))
    bones = UsdSkel.Skeleton.Define(stage, root.AppendChild("skeleton"))
    rest_pos, rest_rot = world_poses(model, skeleton, resting(loop)[None], axes)
    bind = _matrices(rest_pos[0], rest_rot[0])
    above = [bind[p] if p >= 0 else np.eye(4) for p in skeleton.parent]
    bones.CreateJointsAttr(paths)
    bones.CreateBindTransformsAttr(Vt.Matrix4dArray.FromNumpy(bind))
    local = bind @ np.linalg.inv(above)
    bones.CreateRestTransformsAttr(Vt.Matrix4dArray.FromNumpy(local))
    motion = UsdSkel.Animation.Define(stage, root.AppendChild(_word(animation_of("walk", loop))))
    motion.CreateJointsAttr(paths)
    motion.CreateScalesAttr(Vt.Vec3hArray(len(paths), (1, 1, 1)))
    places, turns = motion.CreateTranslationsAttr(), motion.CreateRotationsAttr()
    pos, quat = moved(loop, skeleton, axes, travelling)
    for frame in range(len(pos)):
        places.Set(Vt.Vec3fArray.FromNumpy(pos[frame].astype(np.float32)), frame)
        turns.Set(Vt.QuatfArray.FromNumpy(quat[frame].astype(np.float32)), frame)
    binding = UsdSkel.BindingAPI.Apply(bones.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([motion.GetPath()])
    return bones.GetPath()


def _add_piece(stage: "Usd.Stage", place: "Sdf.Path", piece: Piece, skeleton: "Sdf.Path") -> None:
    """Add a mesh of one colour at a place of its own, bound to the skeleton."""
    from pxr import UsdGeom, UsdSkel, Vt

    mesh = UsdGeom.Mesh.Define(stage, place)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(piece.points.astype(np.float32)))
    mesh.CreateFaceVertexIndicesAttr(piece.faces.ravel().tolist())
    mesh.CreateFaceVertexCountsAttr([3] * len(piece.faces))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(piece.normals.astype(np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDisplayColorAttr([tuple(map(float, linear(piece.colour[:3])))])
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton])
    binding.CreateJointIndicesPrimvar(False, 1).Set(piece.joints.tolist())
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * len(piece.joints))


def _matrices(pos: np.ndarray, rot: np.ndarray) -> np.ndarray:
    """Transforms [B, 4, 4] in USD's convention of row vectors."""
    whole = np.tile(np.eye(4), (len(pos), 1, 1))
    whole[:, :3, :3], whole[:, 3, :3] = rot.transpose(0, 2, 1), pos
    return whole


def _word(name: str) -> str:
    """A name in a form that USD allows."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return plain if plain and not plain[0].isdigit() else f"_{plain}"
