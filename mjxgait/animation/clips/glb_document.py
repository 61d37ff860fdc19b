"""The description of a GLB file, and its binary part.

The package that writes our files, pygltflib, takes a minute to read a game's character with 70
animations, because it checks each of 44,000 parts. JSON alone takes a tenth of a second.
"""

import json
import struct
from pathlib import Path
from typing import Any

from mjxgait.animation.clips.clip import check_size, read_bytes
from mjxgait.errors import UserError

MAGIC, HEADER, CHUNK = b"glTF", struct.Struct("<4sII"), struct.Struct("<I4s")
"""First bytes; header: those bytes, version, length; before each chunk: its length and kind."""
DESCRIPTION, BINARY = b"JSON", b"BIN\0"
MOST_PARTS = 200_000
"""Largest number of accessors, channels and the like."""
VERSION = 2
COMPRESSED = ("KHR_draco_mesh_compression", "KHR_meshopt_compression", "EXT_meshopt_compression")
"""Extensions without which the numbers of a mesh cannot be read."""
LISTS = ("nodes", "skins", "meshes", "accessors", "bufferViews", "buffers", "animations")
DAMAGED = (
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
    struct.error,
)
"""Errors raised while reading content that does not follow its format."""


def damaged(path: Path) -> UserError:
    """Return the error of a file that is read but makes no sense."""
    return UserError(f"{path}: its content is damaged; export it again")


class Part:
    """Object of a description. Its keys are attributes; an absent key is None."""

    def __init__(self, keys: dict[str, Any]) -> None:
        self.__dict__.update(keys)

    def __getattr__(self, key: str) -> Any:
        if key.startswith("__"):
            raise AttributeError(key)
        return None


class Document(Part):
    """Description of a file; `LISTS` are lists, empty if absent. blob: its binary part."""

    blob: bytes


def open_glb(path: Path) -> Document:
    """Return a file's description with its binary part.

    Raises:
      UserError: it is no GLB, is cut off, damaged, or has more bones than one creature.
    """
    data = read_bytes(path)
    if len(data) < HEADER.size + CHUNK.size or data[:4] != MAGIC:
        raise UserError(f"{path}: not a GLB file; export as glTF binary (.glb)")
    _, version, stated = HEADER.unpack_from(data)
    if version != VERSION:
        raise UserError(f"{path}: of version {version} of glTF; export as glTF {VERSION}.0")
    if stated > len(data):
        raise UserError(f"{path}: is cut off: it states more bytes than it has")
    try:
        chunks = read_chunks(data[:stated])
        if chunks[DESCRIPTION].count(b"{") > MOST_PARTS:
            raise UserError(f"{path}: of more than {MOST_PARTS} parts; export one creature")
        whole = vars(json.loads(chunks[DESCRIPTION], object_hook=Part))
    except DAMAGED:
        raise UserError(f"{path}: its description is damaged") from None
    for key in LISTS:
        if not isinstance(whole.setdefault(key, []), list):
            raise UserError(f"{path}: its list of {key} is damaged")
    if any(getattr(buffer, "uri", None) for buffer in whole["buffers"]):
        raise UserError(f"{path}: refers to another file; export as one GLB")
    check_size(path, len(whole["nodes"]), 2)
    document = Document(whole | {"blob": chunks.get(BINARY, b"")})
    try:
        _check_references(path, document)
    except DAMAGED as error:
        raise damaged(path) from error
    return document


def _check_references(path: Path, document: Document) -> None:
    """Refuse compressed meshes, and nodes and skins that name what is not there."""
    for name in document.extensionsRequired or []:
        if name in COMPRESSED:
            raise UserError(f"{path}: its meshes are compressed ({name}); export without that")
    count = len(document.nodes)
    groups = {"node": (node.children or [] for node in document.nodes)}
    groups["skin"] = (skin.joints for skin in document.skins)
    for kind, members in groups.items():
        for number, named in enumerate(members):
            lost = [one for one in named if type(one) is not int or not 0 <= one < count]
            if lost:
                raise UserError(
                    f"{path}: {kind} {number} names node {lost[0]!r}, which is not there; "
                    "export it again"
                )
    if any(not skin.joints for skin in document.skins):
        raise UserError(f"{path}: has a skin without bones; export the armature with its mesh")


def read_chunks(data: bytes) -> dict[bytes, bytes]:
    """Content of a file's chunks by kind.

    Raises:
      ValueError: a chunk ends after the file.
    """
    found, at = {}, HEADER.size
    while at + CHUNK.size <= len(data):
        length, kind = CHUNK.unpack_from(data, at)
        at += CHUNK.size
        if at + length > len(data):
            raise ValueError("a chunk ends after the file")
        found[kind] = data[at : at + length]
        at += length
    return found
