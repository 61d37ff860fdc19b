"""Certified walks of a repertoire as clips with starts and stops, and a page that drives them.

Starts and stops are simulated in C MuJoCo, undisturbed, and move their root as the body moved.
Letters: `S` ways to stop, `T` frames, `J` actuated joints.
"""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mjxgait.animation.export import (
    Character,
    WalkLoop,
    animation_of,
    build_clips,
    build_onto,
    contacts,
    falls_of_first_foot,
    resampled,
    standing_still,
    stride_in_phase,
)
from mjxgait.animation.export.facts import UNEXAMINED, certified
from mjxgait.certification.trials import simulate
from mjxgait.errors import UserError
from mjxgait.experiments.repertoire.found import Found, found_in
from mjxgait.experiments.repertoire.grid import Grid
from mjxgait.experiments.repertoire.neighbours import Blend, Change
from mjxgait.experiments.repertoire.table import facts_in, make_theirs, table_of
from mjxgait.files import read_json, write_bytes, write_text
from mjxgait.reference.changing import HaltingReference
from mjxgait.reference.outcome import Trajectory
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.video import LOOP_SECONDS, champion_of
from mjxgait.rendering.walk import WARMUP, Walk
from mjxgait.training.disk import disk_errors
from mjxgait.web.page import driven_page, save_page

IDLE = "idle"
BEGINS_BY, NEAR = 4.0, 0.03
"""Time by which a walk is in its stride, s, and RMS joint error that is then allowed, rad."""
PLACES, FADES = 8, (0.2, 0.5, 1.0)
"""Ways to stop: number of moments in a stride at which the stop is commanded, and times in which
the poses become the standing pose, s."""
SETTLES, STILL = 3.0, 0.02
"""Time after the last of these moments by which the body must be still, s; trunk speed below which
it is still, m/s per sqrt(g * hip height)."""
RESTS = 0.3
"""Time at rest that the clip shows, s."""


@dataclasses.dataclass(frozen=True, eq=False)
class Transition:
    """Transition from one clip into another.

    loop: the motion; None if no way was found. gaps: RMS joint differences (rad) from the clip
    before and the clip after, where they meet.
    """

    begins: str
    ends: str
    loop: WalkLoop | None = None
    gaps: tuple[float, float] = (0.0, 0.0)

    @property
    def name(self) -> str:
        """Name of its clip."""
        return f"{self.ends}_start" if self.begins == IDLE else f"{self.begins}_stop"

    def __bool__(self) -> bool:
        """Return whether a motion was found."""
        return self.loop is not None

    @property
    def entry(self) -> dict[str, object]:
        """Entry of the table."""
        ends = {"name": self.name, "from": self.begins, "to": self.ends}
        if self.loop is None or self.loop.path is None:
            return ends | {"found": False}
        return ends | {
            "found": True,
            "duration": round(float(self.loop.times[-1]), 6),
            "frames_per_s": self.loop.rate,
            "way": round(self.loop.way, 4),
            "gaps": [round(gap, 4) for gap in self.gaps],
            "contacts": contacts(self.loop, self.loop.walk.creature.feet.names),
        }


def transitions(found: Sequence[Found], loops: dict[str, WalkLoop]) -> list[Transition]:
    """Return a start and a stop per certified straight walk, made from its clip's walk."""
    names = [one.cell.name for one in found if one.certified and not one.cell.turn]
    return [of(loops[name].walk, name, loops) for name in names for of in (start_of, stop_of)]


def start_of(walk: Walk, name: str, loops: dict[str, WalkLoop]) -> Transition:
    """Return the start: from standing to the first footfall near the clip's first pose.

    If none is near enough: to the nearest footfall of the first seconds.
    """
    falls = falls_of_first_foot(walk)
    falls = falls[falls * walk.time_step <= BEGINS_BY]
    if not len(falls):
        return Transition(IDLE, name)
    stand, after = walk.creature.stand_qpos, loops[name].qpos[0]
    near = [fall for fall in falls if _apart(walk, walk.qpos[fall], after) <= NEAR]
    last = int(near[0] if near else _likest(walk, falls, after))
    gaps = (_apart(walk, walk.qpos[0], stand), _apart(walk, walk.qpos[last], after))
    places = np.zeros(2), after[_place(walk)]
    return Transition(IDLE, name, _motion(walk, (0, last), loops[name], places), gaps)


def stop_of(walk: Walk, name: str, loops: dict[str, WalkLoop]) -> Transition:
    """Return the stop: from the footfall most like the clip's first pose to standing still.

    The shortest of the ways that end upright is taken.
    """
    falls = falls_of_first_foot(walk)
    settled = falls[falls * walk.time_step >= WARMUP]
    if len(settled) < 2:
        return Transition(name, IDLE)
    before, stand = loops[name].qpos[0], walk.creature.stand_qpos
    begin = _likest(walk, settled, before)
    stride = float(np.diff(settled).mean()) * walk.time_step
    motions = halted(walk, begin * walk.time_step + stride * np.arange(PLACES) / PLACES)
    ends = [(len(motion.qpos), row) for row, motion in enumerate(motions) if len(motion.qpos)]
    if not ends:
        return Transition(name, IDLE)
    halting = motions[min(ends)[1]]
    frames = begin, len(halting.qpos) - 1
    gaps = (_apart(walk, halting.qpos[begin], before), _apart(walk, halting.qpos[-1], stand))
    places = before[_place(walk)], np.zeros(2)
    return Transition(name, IDLE, _motion(halting, frames, loops[name], places), gaps)


def halted(walk: Walk, moments: np.ndarray) -> list[Walk]:
    """Return each way to stop as a walk that ends when it has been still for `RESTS`.

    It has no frames after a fall or without coming to rest. moments: [PLACES] s of the command.
    """
    creature, step = walk.creature, walk.time_step
    halts, fades = (each.ravel() for each in np.meshgrid(moments, FADES))
    reference = HaltingReference(creature, walk.champion, step, halts, fades)
    starts, seconds = nominal_starts(creature, len(halts)), float(moments[-1]) + SETTLES
    outcome = simulate(
        creature, walk.champion, starts, seconds, record=len(halts), threads=1, reference=reference
    )
    film = outcome.trajectory
    root = creature.root_dof
    fastest = STILL * creature.unit_speed
    motions = []
    for row, up in enumerate(outcome.stayed_up):
        moves = np.linalg.norm(film.qvel[row, :, root : root + 3], axis=1) >= fastest
        rest = int(np.flatnonzero(moves)[-1]) + 1 + round(RESTS / step)
        frames = slice(rest if up and rest < len(moves) else 0)
        motions.append(dataclasses.replace(walk, trajectory=_part(film, row, frames)))
    return motions


def _part(film: Trajectory, row: int, frames: slice) -> Trajectory:
    """Return some frames of one of several simulations."""
    arrays = film.qpos, film.qvel, film.torque, film.target, film.phase
    return Trajectory(film.time_step, *(array[row : row + 1, frames] for array in arrays))


def _motion(
    walk: Walk, ends: tuple[int, int], like: WalkLoop, places: tuple[np.ndarray, np.ndarray]
) -> WalkLoop:
    """Return the frames of a walk from one to another as a clip; its root moves as the body moved.

    places: [2] m, the trunk's place over the root at the clip's begin and end, as in the clips
    before and after.
    """
    first, last = ends
    count = max(round((last - first) * walk.time_step * like.rate), 1)
    share = np.linspace(0.0, 1.0, count + 1)[:, None]
    frames = resampled(walk.creature.model, walk.qpos, first + share[:, 0] * (last - first))
    place = _place(walk)
    frames[:, place.stop] -= walk.ground_heights(frames[:, place])
    moved, above = frames[:, place] - frames[0, place], (1 - share) * places[0] + share * places[1]
    frames[:, place] = above
    path = moved - (above - places[0])
    return WalkLoop(walk, frames, like.rate, 0, 0.0, 1.0, ends, path=path, certificate=UNEXAMINED)


def _place(walk: Walk) -> slice:
    """Return the slice of a pose with the trunk's horizontal position; the height follows."""
    first = walk.creature.root_qpos
    return slice(first, first + 2)


def _likest(walk: Walk, frames: np.ndarray, pose: np.ndarray) -> int:
    """Return the frame, of some, at which the walk is nearest to a pose [nq]."""
    return int(min(frames, key=lambda frame: _apart(walk, walk.qpos[frame], pose)))


def _apart(walk: Walk, one: np.ndarray, other: np.ndarray) -> float:
    """Return the RMS difference of two poses' [nq] actuated joints, rad."""
    joints = walk.creature.joints.qpos_adr
    return float(np.sqrt(np.mean((one[joints] - other[joints]) ** 2)))


CLIPS, TABLE = "repertoire.glb", "repertoire.json"


def clips_of(folder: Path, found: Sequence[Found], rate: int) -> dict[str, WalkLoop]:
    """Return a stride of each certified walk by name, all in phase, and the standing pose."""
    loops = {
        one.cell.name: dataclasses.replace(
            stride_in_phase(champion_of(folder / one.cell.name, LOOP_SECONDS).walk, rate),
            certificate=certified(one.margin or 0.0),
        )
        for one in found
        if one.certified
    }
    return loops and {IDLE: standing_still(next(iter(loops.values()))), **loops}


def write_clips(
    file: Path,
    table: Path,
    loops: dict[str, WalkLoop],
    found: Sequence[Found],
    between: Sequence[Blend],
    changed: Sequence[Change],
    ways: Sequence[Transition],
    travelling: bool,
    character: Character | None = None,
) -> None:
    """Write the GLB and the JSON beside it.

    character: gets the clips, instead of the creature's body.

    Raises:
      UserError: the character has not the creature's skeleton, or a file cannot be written.
    """
    document = table_of(file.name, loops, found, travelling)
    document["blends"] = [blend.entry for blend in between]
    document["changes"] = [change.entry for change in changed]
    document["transitions"] = [way.entry for way in ways]
    clips = {animation_of(name, loop): loop for name, loop in loops.items()}
    clips |= {way.name: way.loop for way in ways if way.loop is not None}
    if character is None:
        data = build_clips(clips, travelling)
    else:
        names, data = build_onto(clips, character, travelling)
        make_theirs(document, names, facts_in(data, names.values()))
    with disk_errors(file.parent):
        write_bytes(file, data)
        write_text(table, json.dumps(document, indent=2) + "\n")


RATE = 60


def write_driven(folder: Path, out: Path) -> None:
    """Write the page of a repertoire's certified walks.

    Raises:
      UserError: no repertoire, none of its walks is certified, or the file cannot be written.
    """
    found = found_in(folder, Grid.read(folder))
    loops = clips_of(folder, found, RATE)
    if not loops:
        raise UserError(
            f"{folder}: none of its walks is certified, so there is nothing to drive; "
            f"`mjxgait inspect {folder}` says why"
        )
    clips = table_of("", loops, found, travelling=False)["clips"]
    save_page(out, driven_page(loops, clips, len(found), _blends(folder)))


def _blends(folder: Path) -> str:
    """Return a line with the number of blends tried as physics, and of those that walked."""
    try:
        tried = read_json(folder / TABLE)["blends"]
        walking = sum(bool(blend["walks"]) for blend in tried)
    except (UserError, ValueError, LookupError, TypeError):
        tried, walking = [], 0
    if not tried:
        return "no blend of them has been tried as physics"
    return f"half way between neighbours {walking} of {len(tried)} walk as physics too"
