"""Read the animation of a GLB file: nodes, their rest, and the keys of their rotations."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]
from scipy.spatial.transform import Rotation, Slerp

from mjxgait.animation.clips.clip import (
    NOTE,
    Clip,
    check_numbers,
    check_size,
    check_times,
)
from mjxgait.animation.clips.glb import (
    DAMAGED,
    name_of,
    open_glb,
    placed,
    shares,
    tree,
    values,
)
from mjxgait.errors import UserError

RATE = 60
"""Frames/s for an animation with keys at different times for different bones."""


def read_glb(path: Path) -> Clip:
    """Return the first animation of a file, with all nodes.

    Raises:
      UserError: it is no GLB, is damaged, or has no animation that turns anything.
    """
    document = open_glb(path)
    nodes = document.nodes
    try:
        parents, order = tree(path, nodes)
        rest = np.array([_turn(node) for node in nodes])
        keys = _keys(path, document)
        names = tuple(name_of(nodes, i) for i in range(len(nodes)))
        note = _note(nodes)
    except DAMAGED as error:
        raise UserError(f"{path}: its content is damaged ({error!r})") from None
    if not keys:
        raise UserError(f"{path}: has no animation that turns a bone; export with animations")
    times = _common_times(path, keys)
    check_size(path, len(nodes), len(times))
    local = np.tile(rest, (len(times), 1, 1, 1))
    for node, (at, quats) in keys.items():
        local[:, node] = _sampled(at, quats, times)
    world, still = np.empty_like(local), np.empty_like(rest)
    for node in order:
        above = parents[node]
        world[:, node] = local[:, node] if above < 0 else world[:, above] @ local[:, node]
        still[node] = rest[node] if above < 0 else still[above] @ rest[node]
    turned = world @ still.transpose(0, 2, 1)
    return Clip(names, tuple(parents), times - times[0], turned, note)


def _turn(node: gltf.Node) -> np.ndarray:
    """Rotation [3, 3] of a node at rest."""
    columns = placed(node)[:3, :3]
    return Rotation.from_matrix(columns / np.linalg.norm(columns, axis=0)).as_matrix()


def _note(nodes: Sequence[gltf.Node]) -> str:
    """The note of an exported walk, found on one of its nodes; else empty."""
    notes = (node.extras.get(NOTE) for node in nodes if isinstance(node.extras, dict))
    return next((note for note in notes if isinstance(note, str)), "")


def _keys(path: Path, document: gltf.GLTF2) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Times [n] s and quaternions [n, 4] (x, y, z, w) of each node that turns."""
    found: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for animation in document.animations[:1]:
        for channel in animation.channels:
            target = channel.target
            if target.path != "rotation" or target.node is None:
                continue
            sampler = animation.samplers[channel.sampler]
            check_size(path, 1, max(document.accessors[sampler.input].count, 2))
            times = shares(values(document, sampler.input))[:, 0]
            quats = shares(values(document, sampler.output))
            if sampler.interpolation == "CUBICSPLINE":
                quats = quats.reshape(len(times), 3, 4)[:, 1]  # between tangents
            name = name_of(document.nodes, target.node)
            check_numbers(path, f'the rotation of "{name}"', quats)
            if len(quats) != len(times) or quats.shape[1] != 4 or not quats.any(1).all():
                raise ValueError("keys and times do not fit")
            check_times(path, times)
            found[target.node] = times, quats
    return found


def _common_times(path: Path, keys: dict[int, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Times [F] of the keys if all bones share them, else evenly spaced over all."""
    every = [times for times, _ in keys.values()]
    longest = max(every, key=len)
    if all(np.array_equal(times, longest) or len(times) == 1 for times in every):
        return longest
    first, last = min(times[0] for times in every), max(times[-1] for times in every)
    count = round((last - first) * RATE) + 1
    check_size(path, 1, count)
    return np.linspace(first, last, count)


def _sampled(at: np.ndarray, quats: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Rotations [F, 3, 3] at other times, on the shortest path between keys."""
    turns = Rotation.from_quat(quats)
    if len(at) == 1:
        return np.tile(turns.as_matrix()[0], (len(times), 1, 1))
    return Slerp(at, turns)(np.clip(times, at[0], at[-1])).as_matrix()
