"""Reads a BVH file: a skeleton and the angles of its joints, frame by frame."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait.errors import UserError
from mjxgait.keys.clip import Clip, check_numbers, check_size, read_text

POSITION, ROTATION = (
    ("Xposition", "Yposition", "Zposition"),
    ("Xrotation", "Yrotation", "Zrotation"),
)
MOST_CHANNELS = 6


def read_bvh(path: Path) -> Clip:
    """The clip in a file; its bones rest with all angles at zero.

    Raises:
      UserError: it is no BVH file, or cut off; says where.
    """
    words = read_text(path).split()
    if not words or words[0].upper() != "HIERARCHY":
        raise UserError(f"{path}: not a BVH file (it does not begin with HIERARCHY)")
    try:
        names, parents, channels, at = _hierarchy(path, words)
        step, values = _motion(path, words, at, sum(map(len, channels)))
    except (IndexError, ValueError):
        raise UserError(f"{path}: is cut off or damaged: a number or a word is missing") from None
    check_size(path, len(names), len(values))
    check_numbers(path, "a value", values)
    times = step * np.arange(len(values))
    return Clip(names, parents, times, _turned(parents, channels, values))


def _hierarchy(
    path: Path, words: list[str]
) -> tuple[tuple[str, ...], tuple[int, ...], list[list[str]], int]:
    """Names, parents and channels of the bones, and the place of the word MOTION."""
    names: list[str] = []
    parents: list[int] = []
    channels: list[list[str]] = []
    above: list[int] = []
    opened, at = -1, 1
    while words[at].upper() != "MOTION":
        word = words[at].upper()
        if word in ("ROOT", "JOINT"):
            opened = len(names)
            names.append(words[at + 1])
            parents.append(above[-1] if above else -1)
            channels.append([])
            at += 2
        elif word == "END":
            opened = above[-1]
            at += 2
        elif word == "{":
            above.append(opened)
            at += 1
        elif word == "}":
            above.pop()
            at += 1
        elif word == "OFFSET":
            at += 4
        elif word == "CHANNELS":
            count = int(words[at + 1])
            named = words[at + 2 : at + 2 + count]
            if not 0 <= count <= MOST_CHANNELS or set(named) - {*POSITION, *ROTATION}:
                raise UserError(f'{path}: "{names[above[-1]]}" has channels that BVH does not know')
            channels[above[-1]] = named
            at += 2 + count
        else:
            raise UserError(f'{path}: "{words[at][:40]}" is not a word of a BVH skeleton')
    return tuple(names), tuple(parents), channels, at


def _motion(path: Path, words: list[str], at: int, width: int) -> tuple[float, np.ndarray]:
    """Time of a frame in s, and all values [F, channels]."""
    if words[at + 1].upper() != "FRAMES:" or words[at + 3].upper() != "FRAME":
        raise UserError(f"{path}: MOTION does not tell Frames and Frame Time")
    frames, step = int(words[at + 2]), float(words[at + 5])
    check_size(path, 1, frames)
    if not 0 < step < 10:
        raise UserError(f"{path}: Frame Time: {step:g}: must be the seconds of one frame")
    rest = words[at + 6 :]
    if not width or len(rest) != frames * width:
        raise UserError(
            f"{path}: states {frames} frames of {width} numbers and has {len(rest)} numbers; is it "
            "cut off?"
        )
    return step, np.array(rest, float).reshape(frames, width)


def _turned(parents: tuple[int, ...], channels: list[list[str]], values: np.ndarray) -> np.ndarray:
    """[F, B, 3, 3] of angles in degrees, in the order in which a bone's channels are named."""
    world = np.zeros((len(values), len(parents), 3, 3))
    first = 0
    for bone, (parent, named) in enumerate(zip(parents, channels, strict=True)):
        own = values[:, first : first + len(named)]
        first += len(named)
        world[:, bone] = np.eye(3) if parent < 0 else world[:, parent]
        for name, angle in zip(named, own.T, strict=True):
            if name in ROTATION:
                turn = Rotation.from_euler(name[0].lower(), angle[:, None], degrees=True)
                world[:, bone] = world[:, bone] @ turn.as_matrix()
    return world
