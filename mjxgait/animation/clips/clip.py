"""What is read of a file with an animation, whatever its format.

Letters: `F` frames, `B` bones, `J` joints of the creature.
"""

import dataclasses
from pathlib import Path

import numpy as np

from mjxgait import files
from mjxgait.errors import UserError

NOTE = "mjxgait"
"""Name of the property of a node in which an exported walk says what made it."""
ELSEWHERE = {
    ".gltf": "export as glTF binary (.glb), which is one file",
    ".fbx": "open it in Blender and export as glTF binary (.glb)",
    ".blend": "export as glTF binary (.glb)",
}
"""What is not read, and the way round."""
MOST_BYTES, MOST_TEXT = 200_000_000, 30_000_000
MOST_BONES = 1000
MOST_FRAMES = 100_000
MOST_TURNS = 1_000_000
"""Bones times frames."""


@dataclasses.dataclass(frozen=True, eq=False)
class Clip:
    """Bones that turn.

    names: [B]. parents: [B] place of the parent, -1 for none. times: [F] s, from 0 on.
    turned: [F, B, 3, 3] how far each is turned from where it rests, in the file's world.
    note: what an exported walk says of itself; else empty.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    times: np.ndarray
    turned: np.ndarray
    note: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class AngleTrack:
    """Angles of joints that the file names. times: [F] s. angles: [F, J] rad."""

    names: tuple[str, ...]
    times: np.ndarray
    angles: np.ndarray


def read_bytes(path: Path, most: int = MOST_BYTES) -> bytes:
    """The content of a file.

    Raises:
      UserError: it is missing, empty, too large or cannot be read.
    """
    data = files.read_bytes(path, most)
    if not data:
        raise UserError(f"{path}: the file is empty")
    return data


def read_text(path: Path) -> str:
    """The content of a text file; see `read_bytes`."""
    text = files.read_text(path, MOST_TEXT)
    if not text:
        raise UserError(f"{path}: the file is empty")
    return text


def check_size(path: Path, bones: int, frames: int) -> None:
    """Refuses what no animator makes.

    Raises:
      UserError: too many bones or frames, or less than two frames.
    """
    if bones > MOST_BONES:
        raise UserError(f"{path}: {bones} bones; more than {MOST_BONES} is not one creature")
    if frames > MOST_FRAMES:
        raise UserError(f"{path}: {frames} frames; export one cycle, at most {MOST_FRAMES}")
    if bones * frames > MOST_TURNS:
        raise UserError(f"{path}: {frames} frames of {bones} bones; export one cycle only")
    if frames < 2:
        raise UserError(f"{path}: has no animation: a cycle needs at least two frames")


def check_numbers(path: Path, what: str, values: np.ndarray) -> None:
    """Refuses what is not finite.

    Raises:
      UserError: names the first frame.
    """
    bad = ~np.isfinite(values.reshape(len(values), -1)).all(1)
    if bad.any():
        raise UserError(f"{path}: {what} of frame {int(np.argmax(bad)) + 1} is not a finite number")


def check_times(path: Path, times: np.ndarray) -> np.ndarray:
    """Times [F] from 0 on.

    Raises:
      UserError: they do not grow.
    """
    check_numbers(path, "the time", times)
    if (np.diff(times) <= 0).any():
        frame = int(np.argmax(np.diff(times) <= 0)) + 2
        raise UserError(f"{path}: the time of frame {frame} is not after the one before it")
    return times - times[0]
