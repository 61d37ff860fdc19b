"""Content of an animation file in any format: motions, and skeletons at rest.

Letters: `F` frames, `B` bones, `J` joints of the creature.
"""

import dataclasses
from pathlib import Path

import numpy as np

from mjxgait import files
from mjxgait.errors import UserError
from mjxgait.files import UNSHOWN

NOTE = "mjxgait"
"""Name of the node property that holds an exported walk's note on its origin."""
ELSEWHERE = {
    ".gltf": "export as glTF binary (.glb), which is one file",
    ".blend": "export as glTF binary (.glb)",
}
"""Formats that are not read, and the workaround."""
MOST_BYTES, MOST_TEXT = 200_000_000, 30_000_000
MOST_BONES = 1000
MOST_FRAMES = 100_000
MOST_TURNS = 1_000_000
"""Largest number of bones times frames."""


MOST_NAME = 200
"""Characters of a bone's name that a creature folder keeps."""


def written(name: str) -> str:
    """Return a bone's name as creature folders write it, because any text may be in a file."""
    return UNSHOWN.sub("?", name)[:MOST_NAME]


@dataclasses.dataclass(frozen=True, eq=False)
class Clip:
    """Bone rotations over time.

    names: [B]. parents: [B] place of the parent, -1 for none. times: [F] s, from 0 on.
    turned: [F, B, 3, 3] rotation from rest, in the file's world. note: an exported walk's note;
    else empty.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    times: np.ndarray
    turned: np.ndarray
    note: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class AngleTrack:
    """Angles of the joints named in a file. times: [F] s. angles: [F, J] rad."""

    names: tuple[str, ...]
    times: np.ndarray
    angles: np.ndarray


def read_bytes(path: Path, most: int = MOST_BYTES) -> bytes:
    """Return the content of a file.

    Raises:
      UserError: it is missing, empty, too large or cannot be read.
    """
    data = files.read_bytes(path, most)
    if not data:
        raise UserError(f"{path}: the file is empty")
    return data


def read_text(path: Path) -> str:
    """Return the content of a text file; see `read_bytes`."""
    text = files.read_text(path, MOST_TEXT)
    if not text:
        raise UserError(f"{path}: the file is empty")
    return text


def check_size(path: Path, bones: int, frames: int) -> None:
    """Refuse sizes that no animator makes.

    Raises:
      UserError: too many bones or frames, or fewer than two frames.
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
    """Refuse values that are not finite.

    Raises:
      UserError: names the first bad frame.
    """
    bad = ~np.isfinite(values.reshape(len(values), -1)).all(1)
    if bad.any():
        raise UserError(f"{path}: {what} of frame {int(np.argmax(bad)) + 1} is not a finite number")


def check_times(path: Path, times: np.ndarray) -> np.ndarray:
    """Return the times [F] shifted to begin at 0.

    Raises:
      UserError: they do not grow.
    """
    check_numbers(path, "the time", times)
    if (np.diff(times) <= 0).any():
        frame = int(np.argmax(np.diff(times) <= 0)) + 2
        raise UserError(f"{path}: the time of frame {frame} is not after the one before it")
    return times - times[0]


@dataclasses.dataclass(frozen=True, eq=False)
class Rig:
    """Bones, parents first, in the file's axes.

    names: [B]. parents: [B] place of the parent, -1 for none. places: [B, 3] start of each bone.
    ends: per bone [n, 3] its ends without a further bone. skins: per bone [V, 3] the vertices that
    follow it most. metres: per unit of length, None where the format does not say.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    places: np.ndarray
    ends: tuple[np.ndarray, ...]
    skins: tuple[np.ndarray, ...]
    metres: float | None = None

    def children(self, bone: int) -> list[int]:
        """Children of a bone."""
        return [i for i, parent in enumerate(self.parents) if parent == bone]

    def subtree(self, bone: int) -> list[int]:
        """A bone and all bones below it, in order."""
        below = {bone}
        for other, parent in enumerate(self.parents):
            if parent in below:
                below.add(other)
        return sorted(below)

    def taken(self, bones: list[int]) -> "Rig":
        """Return some of the bones, in this order; the nearest ancestor taken becomes parent."""

        def above(bone: int) -> int:
            parent = self.parents[bone]
            while parent >= 0 and parent not in bones:
                parent = self.parents[parent]
            return bones.index(parent) if parent >= 0 else -1

        return dataclasses.replace(
            self,
            names=tuple(self.names[b] for b in bones),
            parents=tuple(above(b) for b in bones),
            places=self.places[bones],
            ends=tuple(self.ends[b] for b in bones),
            skins=tuple(self.skins[b] for b in bones),
        )

    def scaled(self, factor: float) -> "Rig":
        """Return the skeleton in other units."""
        return dataclasses.replace(
            self,
            places=factor * self.places,
            ends=tuple(factor * ends for ends in self.ends),
            skins=tuple(factor * skin for skin in self.skins),
        )
