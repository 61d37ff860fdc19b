"""Characters as artists make them, and their skins as a viewer shows them, from the file alone."""

import json
import struct
from collections.abc import Callable

import numpy as np
import pygltflib as gltf
from animation.test_glb import read
from rendering.made_up import treading
from scipy.spatial.transform import Rotation

from mjxgait.animation.export import WalkLoop, walk_loop
from mjxgait.creature import Creature
from mjxgait.rendering.walk import record_walk

PICTURE = b"\x89PNG picture of a fur"


def treading_loop(creature: Creature) -> WalkLoop:
    """A loop of a walk on the spot, of 0.5 s."""
    return walk_loop(record_walk(creature, treading(creature, degrees=5.0), 2.5), 30)


def parts(data: bytes) -> tuple[dict, bytes]:
    """Description and binary part of a GLB file."""
    length = struct.unpack_from("<I", data, 12)[0]
    at = 20 + length
    size = struct.unpack_from("<I", data, at)[0]
    return json.loads(data[20:at]), data[at + 8 : at + 8 + size]


def whole(description: dict, blob: bytes) -> bytes:
    """The file of a description and a binary part."""
    text = json.dumps(description).encode()
    text, blob = text + b" " * (-len(text) % 4), blob + bytes(-len(blob) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(blob), len(text), 0x4E4F534A)
    return head + text + struct.pack("<II", len(blob), 0x004E4942) + blob


def transform(place=(0.0, 0.0, 0.0), turn: Rotation | None = None, size: float = 1.0) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = size * (turn or Rotation.identity()).as_matrix()
    made[:3, 3] = place
    return made


def local_of(node: gltf.Node | dict) -> np.ndarray:
    """Transform [4, 4] of a node at rest against its parent."""
    known = node if isinstance(node, dict) else vars(node)
    if known.get("matrix"):
        return np.array(known["matrix"], float).reshape(4, 4).T
    turn = Rotation.from_quat(known.get("rotation") or [0, 0, 0, 1])
    made = transform(known.get("translation") or (0, 0, 0), turn)
    made[:3, :3] *= known.get("scale") or [1, 1, 1]
    return made


def worlds(nodes: list, local: Callable[[int], np.ndarray]) -> dict[int, np.ndarray]:
    """Transforms [4, 4] of nodes in the scene."""
    children = [
        each["children"]
        if isinstance(each, dict) and "children" in each
        else ([] if isinstance(each, dict) else each.children or [])
        for each in nodes
    ]
    found: dict[int, np.ndarray] = {}

    def visit(node: int, above: np.ndarray) -> None:
        found[node] = above @ local(node)
        for child in children[node]:
            visit(child, found[node])

    for top in {*range(len(nodes))} - {child for below in children for child in below}:
        visit(top, np.eye(4))
    return found


def styled(data: bytes, armature: np.ndarray, by_matrix: tuple[str, ...] = ()) -> bytes:
    """The same character at rest, as a program with other habits writes it.

    Every bone has axes of its own, and the armature another transform. The mesh has a texture, and
    a collar that follows the neck without being a bone.

    by_matrix: names of nodes that have a matrix.
    """
    description, blob = parts(data)
    nodes, rng = description["nodes"], np.random.default_rng(5)
    joints = description["skins"][0]["joints"]
    old = worlds(nodes, lambda node: local_of(nodes[node]))
    top = next(i for i, node in enumerate(nodes) if node["name"] == "Armature")
    moved = armature @ np.linalg.inv(old[top])
    new = {
        node: moved
        @ world
        @ (transform(turn=Rotation.random(rng=rng)) if node in joints else np.eye(4))
        for node, world in old.items()
    }
    new |= {node: old[node] for node in old if "mesh" in nodes[node]}
    above = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
    for i, node in enumerate(nodes):
        own = np.linalg.inv(new[above[i]]) @ new[i] if i in above else new[i]
        nodes[i] = {k: node[k] for k in ("name", "children", "mesh", "skin") if k in node}
        nodes[i] |= placed(own, node["name"] in by_matrix)
    accessor = description["accessors"][description["skins"][0]["inverseBindMatrices"]]
    bind = np.stack([np.linalg.inv(new[joint]) @ moved for joint in joints])
    at = description["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    columns = bind.transpose(0, 2, 1).astype(np.float32).tobytes()
    blob = blob[:at] + columns + blob[at + len(columns) :]
    nodes.append({"name": "collar", "translation": [0.0, 1.0, 0.0]})
    neck = next(node for node in nodes if node["name"] == "Neck")
    neck["children"] = [*neck["children"], len(nodes) - 1]
    return painted(description, blob)


def placed(own: np.ndarray, by_matrix: bool) -> dict:
    """Keys of a node with a transform [4, 4]."""
    if by_matrix:
        return {"matrix": own.T.ravel().tolist()}
    size = float(np.cbrt(np.linalg.det(own[:3, :3])))
    quat = Rotation.from_matrix(own[:3, :3] / size).as_quat()
    return {"translation": own[:3, 3].tolist(), "rotation": quat.tolist(), "scale": [size] * 3}


def painted(description: dict, blob: bytes) -> bytes:
    """The file with a picture and an extension that no library knows."""
    view = {"buffer": 0, "byteOffset": len(blob), "byteLength": len(PICTURE)}
    description["bufferViews"].append(view)
    number = len(description["bufferViews"]) - 1
    description["images"] = [{"bufferView": number, "mimeType": "image/png"}]
    description["textures"] = [{"source": 0}]
    description["materials"] = [
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "extras": {"fur": 0.1}}
    ]
    description["extensions"] = {"ACME_whiskers": {"empty": {}, "count": 12}}
    description["extensionsUsed"] = ["ACME_whiskers"]
    blob += PICTURE
    description["buffers"] = [{"byteLength": len(blob)}]
    return whole(description, blob)


def frames_of(document: gltf.GLTF2, name: str) -> list[dict[int, np.ndarray]]:
    """Transforms [4, 4] of all nodes in the scene at each key frame of an animation."""
    animation = next(each for each in document.animations if each.name == name)
    keys = {
        (channel.target.node, channel.target.path): read(
            document, animation.samplers[channel.sampler].output
        )
        for channel in animation.channels
    }
    count = len(next(iter(keys.values())))

    def local(node: int, frame: int) -> np.ndarray:
        known = dict(vars(document.nodes[node]))
        for path in ("translation", "rotation", "scale"):
            if (node, path) in keys:
                assert not known["matrix"]
                known[path] = keys[node, path][frame].tolist()
        return local_of(known)

    return [worlds(document.nodes, lambda node, f=frame: local(node, f)) for frame in range(count)]


def skin_at(document: gltf.GLTF2, poses: dict[int, np.ndarray]) -> np.ndarray:
    """Vertices [V, 3] in the scene, by linear blend skinning."""
    skin, (part,) = document.skins[0], document.meshes[0].primitives
    bind = read(document, skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    moved = np.array([poses[joint] for joint in skin.joints]) @ bind
    points = read(document, part.attributes.POSITION)
    spots = np.concatenate([points, np.ones((len(points), 1))], 1)
    bones = read(document, part.attributes.JOINTS_0).astype(int)
    weights = read(document, part.attributes.WEIGHTS_0) / 255
    blended = np.einsum("vk,vkij->vij", weights, moved[bones])
    return (blended @ spots[..., None])[:, :3, 0]
