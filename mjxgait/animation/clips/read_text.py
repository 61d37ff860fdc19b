"""Read motion from text files: joint angles from CSV or JSON, and BVH.

CSV: a line of names, then numbers; `time` in s, each other column a joint in rad, or in degrees if
its name ends with `_deg`. Columns of `mjxgait.walk` (`pos_NAME`) are accepted. JSON: `{"time":
[...], "unit": "deg", "joints": {"NAME": [...]}}`.
"""

import csv
import dataclasses
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait import files
from mjxgait.animation.clips.clip import (
    AngleTrack,
    Clip,
    Rig,
    check_numbers,
    check_size,
    check_times,
    read_text,
)
from mjxgait.errors import UserError

DEGREES, OURS = "_deg", "pos_"


def read_csv(path: Path) -> AngleTrack:
    """Return the angles in a CSV file.

    Raises:
      UserError: names the line that cannot be read.
    """
    reader = csv.reader(read_text(path).splitlines())
    try:
        lines = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise UserError(f"{path}: line {reader.line_num}: {error}") from None
    names = [name.strip() for name in lines[0][1]] if lines else []
    if "time" not in names:
        raise UserError(f'{path}: its first line must name the columns, one of them "time"')
    check_size(path, len(names), len(lines) - 1)
    rows = []
    for number, row in lines[1:]:
        try:
            rows.append([float(value) for value in row])
        except ValueError:
            raise UserError(f"{path}: line {number} has something that is no number") from None
        if len(row) != len(names):
            raise UserError(f"{path}: line {number} has {len(row)} values, not {len(names)}")
    table = dict(zip(names, np.array(rows).T, strict=True))
    times = table.pop("time")
    if any(name.startswith(OURS) for name in table):
        table = {n.removeprefix(OURS): v for n, v in table.items() if n.startswith(OURS)}
    named = {
        name.removesuffix(DEGREES): np.radians(values) if name.endswith(DEGREES) else values
        for name, values in table.items()
    }
    return _track(path, times, named)


def read_json(path: Path) -> AngleTrack:
    """Return the angles in a JSON file.

    Raises:
      UserError: says what it must hold.
    """
    try:
        document = files.read_json(path)
        unit = document.get("unit", "rad")
        times = np.array(document["time"], float)
        named = {str(n): np.array(v, float) for n, v in document["joints"].items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise UserError(
            f'{path}: must hold {{"time": [...], "joints": {{"NAME": [...]}}}} with numbers'
        ) from None
    if unit not in ("rad", "deg"):
        raise UserError(f'{path}: unit = {unit!r}: must be "rad" or "deg"')
    if times.ndim != 1 or any(values.shape != times.shape for values in named.values()):
        raise UserError(f"{path}: each joint needs as many angles as there are times")
    factor = np.radians(1.0) if unit == "deg" else 1.0
    return _track(path, times, {name: factor * values for name, values in named.items()})


def _track(path: Path, times: np.ndarray, named: dict[str, np.ndarray]) -> AngleTrack:
    if not named:
        raise UserError(f"{path}: has no joint's angles")
    check_size(path, len(named), len(times))
    angles = np.stack(list(named.values()), 1)
    check_numbers(path, "an angle", angles)
    return AngleTrack(tuple(named), check_times(path, times), angles)


POSITION, ROTATION = (
    ("Xposition", "Yposition", "Zposition"),
    ("Xrotation", "Yrotation", "Zrotation"),
)
MOST_CHANNELS = 6


CUT_OFF = "is cut off or damaged: a number or a word is missing"


@dataclasses.dataclass
class BvhBones:
    """Bones in the order of the file, in its units.

    For each bone its name, parent (-1 for none), channels, offset [3] from its parent, and the
    offsets of its ends. above: bones that are still open.
    """

    names: list[str] = dataclasses.field(default_factory=list)
    parents: list[int] = dataclasses.field(default_factory=list)
    channels: list[list[str]] = dataclasses.field(default_factory=list)
    offsets: list[list[float]] = dataclasses.field(default_factory=list)
    ends: list[list[list[float]]] = dataclasses.field(default_factory=list)
    above: list[int] = dataclasses.field(default_factory=list)

    def add(self, name: str) -> None:
        """Add a bone as a child of the open one."""
        self.names.append(name)
        self.parents.append(self.above[-1] if self.above else -1)
        self.channels.append([])
        self.offsets.append([0.0, 0.0, 0.0])
        self.ends.append([])


def read_bvh(path: Path) -> Clip:
    """Return the clip in a file; its bones rest with all angles at zero.

    Raises:
      UserError: it is no BVH file, or cut off; says where.
    """
    words = _words(path)
    try:
        bones, at = _hierarchy(path, words)
        step, values = _motion(path, words, at, sum(map(len, bones.channels)))
    except (IndexError, ValueError):
        raise UserError(f"{path}: {CUT_OFF}") from None
    check_size(path, len(bones.names), len(values))
    check_numbers(path, "a value", values)
    times = step * np.arange(len(values))
    parents = tuple(bones.parents)
    return Clip(tuple(bones.names), parents, times, _turned(parents, bones.channels, values))


def rig_of_bvh(path: Path) -> Rig:
    """Return the skeleton in a file, all angles at zero; the motion is optional.

    Raises:
      UserError: it is no BVH file, or cut off.
    """
    try:
        bones, _ = _hierarchy(path, _words(path))
    except (IndexError, ValueError):
        raise UserError(f"{path}: {CUT_OFF}") from None
    check_size(path, len(bones.names), 2)
    places = np.array(bones.offsets).reshape(-1, 3)
    for bone, parent in enumerate(bones.parents):
        places[bone] += places[parent] if parent >= 0 else 0.0
    ends = (
        place + np.array(offsets).reshape(-1, 3)
        for place, offsets in zip(places, bones.ends, strict=True)
    )
    bare = (np.zeros((0, 3)),) * len(places)
    return Rig(tuple(bones.names), tuple(bones.parents), places, tuple(ends), bare)


def _words(path: Path) -> list[str]:
    words = read_text(path).split()
    if not words or words[0].upper() != "HIERARCHY":
        raise UserError(f"{path}: not a BVH file (it does not begin with HIERARCHY)")
    return words


def _hierarchy(path: Path, words: list[str]) -> tuple[BvhBones, int]:
    """The bones, and the place of the word MOTION."""
    bones, opened, ending, at = BvhBones(), -1, False, 1
    while words[at].upper() != "MOTION":
        word = words[at].upper()
        if word in ("ROOT", "JOINT"):
            opened = len(bones.names)
            bones.add(words[at + 1])
            at += 2
        elif word == "END":
            opened, ending = bones.above[-1], True
            at += 2
        elif word == "{":
            bones.above.append(opened)
            at += 1
        elif word == "}":
            bones.above.pop()
            ending = False
            at += 1
        elif word == "OFFSET":
            offset = [float(number) for number in words[at + 1 : at + 4]]
            if ending:
                bones.ends[bones.above[-1]].append(offset)
            else:
                bones.offsets[bones.above[-1]] = offset
            at += 4
        elif word == "CHANNELS":
            at += 2 + _channels(path, words, at, bones)
        else:
            raise UserError(f'{path}: "{words[at][:40]}" is not a word of a BVH skeleton')
    return bones, at


def _channels(path: Path, words: list[str], at: int, bones: BvhBones) -> int:
    """Store the channels of the open bone, and return their number."""
    count = int(words[at + 1])
    named = words[at + 2 : at + 2 + count]
    if not 0 <= count <= MOST_CHANNELS or set(named) - {*POSITION, *ROTATION}:
        name = bones.names[bones.above[-1]]
        raise UserError(f'{path}: "{name}" has channels that BVH does not know')
    bones.channels[bones.above[-1]] = named
    return count


def _motion(path: Path, words: list[str], at: int, width: int) -> tuple[float, np.ndarray]:
    """Time of a frame in s, and all values [F, channels]."""
    if words[at + 1].upper() != "FRAMES:" or words[at + 3].upper() != "FRAME":
        raise UserError(f"{path}: MOTION does not state Frames and Frame Time")
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
    """Rotations [F, B, 3, 3] from angles in degrees, in the order of each bone's channels."""
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
