"""Cycles from a formula, as files of each readable kind."""

import json
from pathlib import Path

import mujoco
import numpy as np
from rendering.made_up import treading
from scipy.spatial.transform import Rotation

from mjxgait.animation.export import WalkLoop, build_glb
from mjxgait.animation.export.skeleton import gltf_axes
from mjxgait.creature import Creature
from mjxgait.rendering.walk import Walk

RATE, PERIOD = 30, 0.8


def swings(creature: Creature, cycles: float = 1.0, mirrored: bool = False) -> np.ndarray:
    """Angles [F, J] rad: each joint swings within its range, out of phase with the others."""
    joints = creature.joints
    room = np.minimum(joints.pose_high - joints.stand, joints.stand - joints.pose_low)
    phase = np.arange(len(room)) * 0.7
    signs = np.ones(len(room))
    if mirrored:
        for j, partner in enumerate(creature.mirror.partner):
            if partner > j:
                phase[partner] = phase[j] + np.pi
                signs[partner] = creature.mirror.sign[j]
    time = np.arange(round(cycles * PERIOD * RATE) + 1) / RATE
    angle = 2 * np.pi * time[:, None] / PERIOD + phase
    return joints.stand + 0.7 * signs * np.clip(room, 0.0, 0.6) * np.sin(angle)


def poses(creature: Creature, angles: np.ndarray) -> np.ndarray:
    """Positions [F, nq] with these angles and the standing trunk."""
    qpos = np.tile(creature.stand_qpos, (len(angles), 1))
    qpos[:, creature.joints.qpos_adr] = angles
    return qpos


def glb(creature: Creature, angles: np.ndarray) -> bytes:
    """As `mjxgait export` writes it."""
    walk = Walk(creature, treading(creature), None, np.inf)
    frames = (0, len(angles) - 1)
    return build_glb(WalkLoop(walk, poses(creature, angles), RATE, 1, 0.0, 1.0, frames))


def bvh(creature: Creature, angles: np.ndarray, order: str = "ZXY") -> str:
    """A skeleton that rests in the stand, with a joint for each part."""
    model, data = creature.model, mujoco.MjData(creature.model)
    axes = gltf_axes(creature.frame.start_axes[0][:2])
    worlds = []
    for qpos in poses(creature, np.concatenate([creature.joints.stand[None], angles])):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        worlds.append(axes @ data.xmat.reshape(-1, 3, 3).copy() @ axes.T)
    turned = np.array([w @ worlds[0].transpose(0, 2, 1) for w in worlds[1:]])
    order_of: list[int] = []

    def branch(body: int) -> str:
        order_of.append(body)
        kind = "ROOT" if body == creature.trunk else "JOINT"
        channels = " ".join(f"{axis}rotation" for axis in order)
        inner = "".join(branch(b) for b in range(1, model.nbody) if model.body_parentid[b] == body)
        return (
            f"{kind} {model.body(body).name}\n{{\nOFFSET 0 0 0\nCHANNELS 3 {channels}\n"
            f"{inner or 'End Site { OFFSET 0 1 0 }'}\n}}\n"
        )

    text = f"HIERARCHY\n{branch(creature.trunk)}MOTION\nFrames: {len(turned)}\n"
    rows = [f"Frame Time: {1 / RATE:.8f}"]
    for frame in turned:
        row = []
        for body in order_of:
            above = int(model.body_parentid[body])
            parent = np.eye(3) if body == creature.trunk else frame[above]
            local = Rotation.from_matrix(parent.T @ frame[body])
            row += list(local.as_euler(order, degrees=True))
        rows.append(" ".join(f"{value:.6f}" for value in row))
    return text + "\n".join(rows)


def columns(creature: Creature, angles: np.ndarray, degrees: bool = False) -> str:
    """A CSV file."""
    names = [f"{name}_deg" if degrees else name for name in creature.joints.names]
    values = np.degrees(angles) if degrees else angles
    rows = [f"{i / RATE:.6f}," + ",".join(f"{v:.9g}" for v in row) for i, row in enumerate(values)]
    return "\n".join([",".join(["time", *names]), *rows])


def table(creature: Creature, angles: np.ndarray) -> str:
    """A JSON file in degrees."""
    named = dict(zip(creature.joints.names, np.degrees(angles).T.tolist(), strict=True))
    time = (np.arange(len(angles)) / RATE).tolist()
    return json.dumps({"time": time, "unit": "deg", "joints": named})


def write(folder: Path, kind: str, creature: Creature, angles: np.ndarray) -> Path:
    """A file of a kind, named by its ending."""
    file = folder / f"walk.{kind}"
    match kind:
        case "glb":
            file.write_bytes(glb(creature, angles))
        case "bvh":
            file.write_text(bvh(creature, angles))
        case "csv":
            file.write_text(columns(creature, angles))
        case "json":
            file.write_text(table(creature, angles))
    return file
