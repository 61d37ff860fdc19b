"""Skinned files with something wrong or odd about them: the dog of `rigs.py`, changed."""

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from importer.rigs import glb

from mjxgait.animation.clips.glb_document import BINARY, DESCRIPTION, read_chunks
from mjxgait.animation.export.gltf import joined

Document = dict[str, Any]
Change = Callable[[Document, bytearray], object]


def opened(data: bytes) -> tuple[Document, bytearray]:
    """The description of a GLB file, and its numbers."""
    chunks = read_chunks(data)
    return json.loads(chunks[DESCRIPTION]), bytearray(chunks[BINARY])


def changed(change: Change) -> bytes:
    """The dog's file after a change."""
    document, numbers = opened(glb())
    change(document, numbers)
    return joined({DESCRIPTION: json.dumps(document).encode(), BINARY: bytes(numbers)})


def node(document: Document, name: str) -> Document:
    return next(one for one in document["nodes"] if one["name"] == name)


def values(document: Document, numbers: bytearray, what: str) -> np.ndarray:
    """The numbers of an attribute, or the inverse bind matrices: a view that can be written."""
    parts = document["meshes"][0]["primitives"][0]["attributes"]
    at = document["skins"][0]["inverseBindMatrices"] if what == "inverse" else parts[what]
    accessor = document["accessors"][at]
    view = document["bufferViews"][accessor["bufferView"]]
    kind = {5121: np.uint8, 5126: np.float32}[accessor["componentType"]]
    width = {"VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
    start, count = view.get("byteOffset", 0), accessor["count"] * width
    return np.frombuffer(numbers, kind, count, start).reshape(-1, width)


def fill(what: str, number: float) -> Change:
    return lambda document, numbers: values(document, numbers, what).fill(number)


def put(path: str, value: object) -> Change:
    """Set one place of the description, such as `nodes.0.translation`; None removes it."""

    def change(document: Document, numbers: bytearray) -> None:
        *way, last = [int(word) if word.isdigit() else word for word in path.split(".")]
        inner: Any = document
        for word in way:
            inner = inner[word]
        if value is None:
            del inner[last]
        else:
            inner[last] = value

    return change


def rename(given: Callable[[int, str], str]) -> Change:
    def change(document: Document, numbers: bytearray) -> None:
        for i, one in enumerate(document["nodes"]):
            one["name"] = given(i, one["name"])

    return change


def bone(name: str, **values: object) -> Change:
    return lambda document, numbers: node(document, name).update(values)


def loop(document: Document, numbers: bytearray) -> None:
    """The head is the parent of all that is above it."""
    names = [one["name"] for one in document["nodes"]]
    node(document, "Head")["children"] = [names.index("Armature")]


def two_parents(document: Document, numbers: bytearray) -> None:
    names = [one["name"] for one in document["nodes"]]
    node(document, "Tail")["children"] = [names.index("Head")]


def scaled(factor: float) -> Change:
    """The armature is scaled; the skin follows its bones."""

    def change(document: Document, numbers: bytearray) -> None:
        node(document, "Armature")["scale"] = [0.01 * factor] * 3

    return change


def deep(document: Document, numbers: bytearray) -> None:
    """A chain of 3,000 nodes above the armature."""
    nodes, top = document["nodes"], len(document["nodes"]) - 2
    for i in range(3000):
        nodes.append({"name": f"above{i}", "children": [len(nodes) - 1 if i else top]})
    document["scenes"][0]["nodes"][0] = len(nodes) - 1


def many(document: Document, numbers: bytearray) -> None:
    """5,000 bones that lie in the hips."""
    nodes = document["nodes"]
    first = len(nodes)
    nodes += [{"name": f"more{i}"} for i in range(5000)]
    node(document, "Hips")["children"] += list(range(first, len(nodes)))


REFUSED: Mapping[str, tuple[Change, str]] = {
    "no nodes": (put("nodes", None), "skin 0 names node 0, which is not there"),
    "nodes that are a word": (put("nodes", "bones"), "list of nodes is damaged"),
    "no meshes": (put("meshes", None), "damaged"),
    "no accessors": (put("accessors", None), "damaged"),
    "a buffer in another file": (put("buffers.0.uri", "dog.bin"), "export as one GLB"),
    "compressed meshes": (
        put("extensionsRequired", ["KHR_draco_mesh_compression"]),
        "KHR_draco_mesh_compression",
    ),
    "a skin of no bones": (put("skins.0.joints", []), "a skin without bones"),
    "a skin of bones that are not there": (put("skins.0.joints", [900]), "names node 900"),
    "a skin that is a word": (put("skins.0", "fur"), "damaged"),
    "a child that is not there": (put("nodes.0.children", [4000]), "node 0 names node 4000"),
    "a child that is a word": (put("nodes.0.children", ["Spine"]), "names node 'Spine'"),
    "bones in a circle": (loop, "are no tree"),
    "a place of two numbers": (bone("Hips", translation=[0.0, 1.0]), "damaged"),
    "a place of words": (bone("Hips", translation=["a", "b", "c"]), "damaged"),
    "a turn of no length": (bone("Hips", rotation=[0.0, 0.0, 0.0, 0.0]), "damaged"),
    "a turn of nan": (bone("Hips", rotation=[np.nan, 0.0, 0.0, 1.0]), "damaged"),
    "a place beyond all numbers": (bone("Hips", translation=[1e308] * 3), "not a finite number"),
    "an armature without size": (scaled(0.0), "in one place"),
    "an armature as small as an atom": (scaled(1e-9), "in one place"),
    "vertices that are nan": (fill("POSITION", np.nan), "not a finite number"),
    "vertices of a bone that is not there": (fill("JOINTS_0", 250), "damaged"),
    "inverse matrices of nan": (fill("inverse", np.nan), "not a finite number"),
    "5,000 bones": (many, "5024 bones; more than 1000"),
    "a deep hierarchy": (deep, "3024 bones; more than 1000"),
    "an accessor past the end": (put("accessors.0.count", 10**9), "damaged"),
    "a negative count": (put("accessors.0.count", -5), "damaged"),
    "an unknown number format": (put("accessors.0.componentType", 4242), "damaged"),
    "a view past the end": (put("bufferViews.0.byteOffset", 10**9), "damaged"),
}
"""Files that are refused, and words of the refusal."""

ODD: Mapping[str, Change] = {
    "numbers for names": rename(lambda i, name: str(i)),
    "Japanese names": rename(lambda i, name: f"骨{i}"),
    "names of Mixamo": rename(lambda i, name: f"mixamorig:{name}"),
    "names with spaces, quotes and newlines": rename(lambda i, name: f'{name} "{i}"\n<b>'),
    "names of 300 letters": rename(lambda i, name: name + "x" * 300),
    "the same name for all": rename(lambda i, name: "Bone"),
    "no names": rename(lambda i, name: ""),
    "names of MuJoCo's own": rename(
        lambda i, name: ["world", "trunk", "floor"][i % 3] + str(i // 3)
    ),
    "names that are paths": rename(lambda i, name: f"../../{name}"),
    "a root that is turned": bone("Armature", rotation=[0.0, 0.6, 0.0, 0.8]),
    "a root on its side": bone("Armature", rotation=[0.7071068, 0.0, 0.0, 0.7071068]),
    "a root far away": bone("Armature", translation=[500.0, 20.0, -300.0]),
    "an armature in millimetres": scaled(0.1),
    "an armature in decimetres": scaled(10.0),
    "a bone of two parents": two_parents,
    "weights of nothing": fill("WEIGHTS_0", 0),
    "no list of buffers": put("buffers", None),
    "a name that is a number": put("nodes.3.name", 7),
}
"""Files with the same skeleton as the dog's, odd as they are."""
