"""Damaged or unsuitable files: one sentence each, and nothing is written."""

import contextlib
import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from animation.keys.made import bvh, columns, glb, swings, table
from importer.rigs import stated_longer

from mjxgait.animation.keys import bring
from mjxgait.creature import Creature
from mjxgait.errors import UserError


def packed(document: dict, blob: bytes) -> bytes:
    """A GLB of a document and its binary chunk."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + len(blob)
    head = struct.pack("<III", 0x46546C67, 2, size) + struct.pack("<II", len(text), 0x4E4F534A)
    return head + text + struct.pack("<II", len(blob), 0x004E4942) + blob


def parts(data: bytes) -> tuple[dict, bytes]:
    """The document and the binary chunk of a GLB."""
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def altered(data: bytes, change: Callable[[dict], object]) -> bytes:
    """A GLB whose document was changed."""
    document, blob = parts(data)
    change(document)
    return packed(document, blob)


def nan_keys(data: bytes) -> bytes:
    document, blob = parts(data)
    sampler = document["animations"][0]["samplers"][-1]
    view = document["bufferViews"][document["accessors"][sampler["output"]]["bufferView"]]
    at = view["byteOffset"]
    return packed(document, blob[:at] + struct.pack("<f", float("nan")) + blob[at + 4 :])


def bomb(document: dict) -> None:
    for accessor in document["accessors"]:
        accessor["count"] = 10**12


def long(data: bytes) -> bytes:
    """A thousand bones with ten thousand keys each."""
    document, blob = parts(data)
    document["nodes"] += [{"name": f"b{i}"} for i in range(900)]
    count = 10_000
    times = np.arange(count, dtype=np.float32).tobytes()
    quats = np.tile(np.float32([0, 0, 0, 1]), count).tobytes()
    views = len(document["bufferViews"])
    document["bufferViews"] += [
        {"buffer": 0, "byteOffset": len(blob), "byteLength": len(times)},
        {"buffer": 0, "byteOffset": len(blob) + len(times), "byteLength": len(quats)},
    ]
    accessors = len(document["accessors"])
    kind = {"componentType": 5126, "count": count}
    document["accessors"] += [
        {"bufferView": views, "type": "SCALAR", **kind},
        {"bufferView": views + 1, "type": "VEC4", **kind},
    ]
    for sampler in document["animations"][0]["samplers"]:
        sampler.update(input=accessors, output=accessors + 1)
    return packed(document, blob + times + quats)


def rename(document: dict) -> None:
    for i, node in enumerate(document["nodes"]):
        node["name"] = f"Zq{i}"


def circle(document: dict) -> None:
    document["nodes"][3]["children"] = [1]
    document["nodes"][1]["children"] = [3]


GLB = {
    "empty": (lambda d: b"", "is empty"),
    "text": (lambda d: b"solid cube " * 9, "not a GLB file"),
    "cut off": (lambda d: d[: len(d) // 2], "is cut off"),
    "longer than it is": (stated_longer, "is cut off"),
    "shorter than it is": (lambda d: d[:8] + struct.pack("<I", 16) + d[12:], "damaged"),
    "parts without end": (
        lambda d: altered(d, lambda x: x.update(accessors=x["accessors"] * 25_000)),
        "export one creature",
    ),
    "no animation": (lambda d: altered(d, lambda x: x.pop("animations")), "no animation"),
    "wrong names": (lambda d: altered(d, rename), "none of its bones is like a part"),
    "10,000 bones": (
        lambda d: altered(d, lambda x: x["nodes"].extend({"name": "b"} for _ in range(10_000))),
        "bones; more than",
    ),
    "a bomb": (lambda d: altered(d, bomb), "frames; export one cycle"),
    "many bones of many frames": (long, "export one cycle only"),
    "keys that are no numbers": (nan_keys, "is not a finite number"),
    "a circle of bones": (lambda d: altered(d, circle), "its nodes are no tree"),
    "deep": (lambda d: packed({}, b"").replace(b"{}", b"[" * 2), "damaged"),
    "another file": (
        lambda d: altered(d, lambda x: x["buffers"][0].update(uri="../secret")),
        "refers to another file",
    ),
    "accessor beyond the end": (
        lambda d: altered(d, lambda x: x["bufferViews"][-1].update(byteOffset=10**9)),
        "its content is damaged",
    ),
}
TEXT = {
    "no bvh": ("bvh", lambda t: "o hello", "does not begin with HIERARCHY"),
    "a skeleton alone": ("bvh", lambda t: t[: t.index("MOTION")], "is cut off or damaged"),
    "half the motion": ("bvh", lambda t: t[: len(t) * 3 // 4].rsplit(" ", 1)[0], "is it cut off?"),
    "nan": ("bvh", lambda t: t.rsplit(" ", 1)[0] + " nan", "is not a finite number"),
    "no time": ("bvh", lambda t: t.replace("Frame Time: 0.0", "Frame Time: -0.0"), "Frame Time"),
    "too many frames": ("bvh", lambda t: t.replace("Frames: ", "Frames: 99999"), "frames; export"),
    "strange channel": ("bvh", lambda t: t.replace("Zrotation", "Zscale"), "channels that BVH"),
    "columns without time": ("csv", lambda t: t.replace("time", "when"), 'one of them "time"'),
    "words": ("csv", lambda t: t + "\na,b", "has something that is no number"),
    "words after empty lines": (
        "csv",
        lambda t: "\n\n".join([*t.splitlines()[:2], "a,b"]),
        "line 5 has something",
    ),
    "short row": ("csv", lambda t: t + "\n99", "has 1 values"),
    "time stands": ("csv", lambda t: t + "\n" + t.splitlines()[-1], "is not after the one before"),
    "nan in a column": ("csv", lambda t: t.replace(t.split(",")[-1], "nan"), "not a finite number"),
    "one frame": ("csv", lambda t: "\n".join(t.splitlines()[:2]), "at least two frames"),
    "a list": ("json", lambda t: "[1, 2]", "must hold"),
    "cut": ("json", lambda t: t[:-5], "damaged"),
    "turns": ("json", lambda t: t.replace('"deg"', '"turn"'), 'must be "rad" or "deg"'),
    "too few": ("json", lambda t: t.replace('"time": [0.0, ', '"time": ['), "as many angles as"),
    "others": ("json", lambda t: t.replace("hip", "q").replace("_", "w"), "none of its columns"),
    "nothing moves": (
        "csv",
        lambda t: "\n".join(
            [t.splitlines()[0], *(f"{i}" + ",0" * t.splitlines()[0].count(",") for i in range(9))]
        ),
        "nothing moves",
    ),
}


def refused(creature: Creature, file: Path) -> str:
    """The one sentence of the error; the folder is unchanged."""
    before = {f: f.read_bytes() for f in file.parent.iterdir()}
    with pytest.raises(UserError) as raised:
        bring(creature, file)
    assert {f: f.read_bytes() for f in file.parent.iterdir()} == before
    told = str(raised.value)
    assert "\n" not in told
    assert str(file) in told
    return told


@pytest.mark.parametrize("name", GLB)
def test_a_bad_glb_is_one_sentence(stool: Creature, tmp_path: Path, name: str):
    change, words = GLB[name]
    file = tmp_path / "walk.glb"
    file.write_bytes(change(glb(stool, swings(stool))))
    assert words in refused(stool, file)


@pytest.mark.parametrize("name", TEXT)
def test_a_bad_text_is_one_sentence(stool: Creature, tmp_path: Path, name: str):
    kind, change, words = TEXT[name]
    make = {"bvh": bvh, "csv": columns, "json": table}[kind]
    file = tmp_path / f"walk.{kind}"
    file.write_text(change(make(stool, swings(stool))))
    assert words in refused(stool, file)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("walk.blend", "glTF binary"),
        ("walk.gltf", ".glb"),
        ("walk.obj", "this reads"),
        ("no.glb", "no such"),
    ],
)
def test_an_unreadable_file_is_refused_with_a_way_out(
    stool: Creature, tmp_path: Path, name: str, words: str
):
    if name.startswith("walk"):
        (tmp_path / name).write_text("x")
    with pytest.raises(UserError, match=words):
        bring(stool, tmp_path / name)


@pytest.mark.parametrize("kind", ["glb", "bvh", "csv", "json"])
def test_a_corrupted_file_gives_no_traceback(stool, tmp_path, kind):
    """Cut off anywhere, or with changed bytes: a sentence or a cycle."""
    make = {"glb": glb, "bvh": bvh, "csv": columns, "json": table}[kind]
    whole = make(stool, swings(stool))
    whole = whole if isinstance(whole, bytes) else whole.encode()
    rng, file = np.random.default_rng(5), tmp_path / f"walk.{kind}"
    sentences = []
    for case in range(30):
        data = bytearray(whole[: rng.integers(1, len(whole))] if case % 2 else whole)
        for place in rng.integers(0, len(data), 1 + case % 7):
            data[place] = rng.integers(0, 256)
        file.write_bytes(bytes(data))
        with contextlib.suppress(UserError):
            try:
                bring(stool, file, tolerance=np.radians(60.0))
            except UserError as error:
                sentences.append(str(error))
                raise
    assert len(sentences) > 10
    assert not any("\n" in sentence for sentence in sentences)
