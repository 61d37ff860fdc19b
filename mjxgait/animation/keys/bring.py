"""Import of key poses from a file, with a report of each step."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from mjxgait.animation.clips.clip import ELSEWHERE, AngleTrack, Clip, written
from mjxgait.animation.clips.fbx import FBX, read_fbx
from mjxgait.animation.clips.read_glb import read_glb
from mjxgait.animation.clips.read_text import read_bvh, read_csv, read_json
from mjxgait.animation.keys.cycle import (
    Cycle,
    EditedWalk,
    Fit,
    check_ends,
    find_cycle,
    fit_poses,
    own_poses,
)
from mjxgait.animation.keys.retarget import Retargeted, axes_of, matched, movers, retarget
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.output import Tell, silent

READERS: Mapping[str, Callable[[Path], Clip | AngleTrack]] = {
    ".glb": read_glb,
    FBX: read_fbx,
    ".bvh": read_bvh,
    ".csv": read_csv,
    ".json": read_json,
}
Read = Clip | AngleTrack
MOST_FRAMES = 1500
"""Largest number of frames in which a cycle is searched."""


@dataclasses.dataclass(frozen=True, eq=False)
class Brought:
    """A file's cycle on a creature.

    names: in the file, by the creature's part or joint. track: angles over the whole file. own: the
    key poses noted in the file, if it is an exported walk.
    """

    names: Mapping[str, str]
    times: np.ndarray
    track: Retargeted
    cycle: Cycle
    fit: Fit
    own: EditedWalk | None = None


def bring(
    creature: Creature,
    path: Path,
    table: Mapping[str, str] | None = None,
    ends: tuple[float | None, float | None] = (None, None),
    tolerance: float = np.radians(3.0),
    way: str | None = None,
    tell: Tell = silent,
) -> Brought:
    """Read a file and fit key poses to its cycle.

    Args:
      table: names in the file by the creature's part (for CSV and JSON: joint). ends: s, of one
        cycle. tolerance: rad, of the key poses. way: direction in which the file's creature looks,
        see `axes_of`. tell: called with each line of the report.

    Raises:
      UserError: says in one sentence what is wrong with the file.
    """
    try:
        return _bring(creature, path, table, ends, tolerance, way, tell)
    except UserError as error:
        message = str(error)
        raise UserError(message if str(path) in message else f"{path}: {message}") from None


def _bring(
    creature: Creature,
    path: Path,
    table: Mapping[str, str] | None,
    ends: tuple[float | None, float | None],
    tolerance: float,
    way: str | None,
    tell: Callable[[str], object],
) -> Brought:
    kind = path.suffix.lower()
    if kind not in READERS:
        hint = ELSEWHERE.get(kind, f"this reads {', '.join(READERS)}")
        raise UserError(f'{path}: cannot read "{kind}"; {hint}')
    read = READERS[kind](path)
    wanted = list(creature.joints.names) if isinstance(read, AngleTrack) else movers(creature)
    names = matched(wanted, read.names, table, "the table of names")
    for line in name_lines(names, wanted, read.names):
        tell(line)
    read = _cut(read, ends)
    track = (
        _angles(creature, read, names)
        if isinstance(read, AngleTrack)
        else retarget(creature, read, names, axes_of(creature, read, names, way))
    )
    for line in error_lines(track):
        tell(line)
    cycle = find_cycle(creature, read.times, track.angles, *ends)
    own = own_poses(creature, read.note, cycle) if isinstance(read, Clip) and read.note else None
    cycle = own.cycle if own else cycle
    fit = own.fit if own else fit_poses(creature, cycle, tolerance)
    for line in (
        cycle_lines(cycle) + (own_lines(own) if own else fit_lines(fit)) + clipped_lines(fit)
    ):
        tell(line)
    return Brought(names, read.times, track, cycle, fit, own)


def _cut(read: Read, ends: tuple[float | None, float | None]) -> Read:
    """The part between the ends, and one frame more on each side.

    Raises:
      UserError: it is too long to search for a cycle, or the file does not have these seconds.
    """
    check_ends(read.times, *ends)
    first, last = (
        int(np.searchsorted(read.times, end)) if end is not None else other
        for end, other in zip(ends, (0, len(read.times)), strict=True)
    )
    kept = slice(max(first - 1, 0), last + 1)
    if len(read.times[kept]) > MOST_FRAMES:
        raise UserError(
            f"{len(read.times[kept])} frames: more than {MOST_FRAMES} are not looked through for a "
            "cycle; name the seconds of one with --from and --to"
        )
    if isinstance(read, AngleTrack):
        return dataclasses.replace(read, times=read.times[kept], angles=read.angles[kept])
    return dataclasses.replace(read, times=read.times[kept], turned=read.turned[kept])


def _angles(creature: Creature, read: AngleTrack, names: Mapping[str, str]) -> Retargeted:
    """Angles of the joints that a file names, within their ranges; others keep standing angles."""
    if not names:
        known = ", ".join(creature.joints.names)
        raise UserError(f"none of its columns is like a joint of {creature.name}: {known}")
    joints = creature.joints
    angles = np.tile(joints.stand, (len(read.times), 1))
    errors = {}
    for j, name in enumerate(joints.names):
        if name in names:
            given = read.angles[:, read.names.index(names[name])]
            angles[:, j] = np.clip(given, joints.low[j], joints.high[j])
            errors[name] = np.abs(given - angles[:, j])
    return Retargeted(angles, errors)


def name_lines(names: Mapping[str, str], wanted: list[str], found: tuple[str, ...]) -> list[str]:
    """Report lines: the matched names."""
    lines = [f"names: {len(names)} of {len(wanted)} parts have a bone or a column"]
    lines += [f"  {own} <- {written(other)}" for own, other in names.items()]
    if left := [name for name in wanted if name not in names]:
        lines.append(f"  stay as they stand: {', '.join(left)}")
    if unused := len(set(found) - set(names.values())):
        lines.append(f"  not used: {unused} of the file's {len(found)}")
    return lines


def error_lines(track: Retargeted) -> list[str]:
    """Report lines: how well the joints can follow the file."""
    lines = ["what the joints cannot do, in degrees (root mean square, most):"]
    for name, missed in track.errors.items():
        mean, most = np.degrees(np.sqrt(np.mean(missed**2))), np.degrees(missed.max())
        lines.append(f"  {name} {mean:.1f}, {most:.1f}")
    return lines


def cycle_lines(cycle: Cycle) -> list[str]:
    """Report line: the cycle that was found."""
    mirrored = "its second half mirrors the first" if cycle.mirrored else "not mirrored"
    return [
        f"cycle: {cycle.period:.3f} s from {cycle.begins:.3f} s on, {mirrored}; its ends differ by "
        f"{np.degrees(cycle.gap):.1f} degrees"
    ]


def fit_lines(fit: Fit) -> list[str]:
    """Report line: the fit of the cycle."""
    error = np.degrees(fit.error)
    return [f"key poses: {len(fit.key_poses)}, {error:.1f} degrees from it (root mean square)"]


def own_lines(own: EditedWalk) -> list[str]:
    """Report line: the changes to an exported walk."""
    count, changed = len(own.fit.key_poses), np.degrees(own.changed)
    return [
        f"key poses: {count}, those of the walk that was exported, and what was changed since then: "
        f"{changed:.1f} degrees (root mean square)"
    ]


def clipped_lines(fit: Fit) -> list[str]:
    """Report lines: one for each joint with angles cut off at its pose range."""
    return [
        f"  {name}: up to {lost:.0f} degrees beyond its pose range are cut off"
        for name, lost in fit.clipped.items()
    ]
