"""Starts and stops of a repertoire's walks: from standing into the stride, and out of it.

Both are simulated in C MuJoCo, undisturbed, and move their root as the body moved.
Letters: `S` ways to stop, `T` frames, `J` actuated joints.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from mjxgait.animation.export import (
    WalkLoop,
    falls_of_first_foot,
    resampled,
    standing_still,
)
from mjxgait.certification.simulate import simulate
from mjxgait.experiments.repertoire.found import Found
from mjxgait.reference.controllers.halting import HaltingTwin
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.walk import WARMUP, Walk

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
    def entry(self) -> dict[str, Any]:
        """Entry of the table."""
        ends = {"name": self.name, "from": self.begins, "to": self.ends}
        if self.loop is None or self.loop.path is None:
            return ends | {"found": False}
        return ends | {
            "found": True,
            "duration": round(float(self.loop.times[-1]), 6),
            "frames_per_s": self.loop.rate,
            "way": round(float(self.loop.path[-1] @ self.loop.walk.forward), 4),
            "gaps": [round(gap, 4) for gap in self.gaps],
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
    chosen = walk.qpos[: int(near[0] if near else _likest(walk, falls, after)) + 1]
    gaps = (_apart(walk, chosen[0], stand), _apart(walk, chosen[-1], after))
    places = np.zeros(2), after[_place(walk)]
    return Transition(IDLE, name, _motion(walk, chosen, loops[name], places), gaps)


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
    ends = [(frames, row) for row, frames in enumerate(map(len, motions)) if frames]
    if not ends:
        return Transition(name, IDLE)
    chosen = motions[min(ends)[1]][begin:]
    gaps = (_apart(walk, chosen[0], before), _apart(walk, chosen[-1], stand))
    places = before[_place(walk)], np.zeros(2)
    return Transition(name, IDLE, _motion(walk, chosen, loops[name], places), gaps)


def halted(walk: Walk, moments: np.ndarray) -> list[np.ndarray]:
    """Return the poses [T, nq] of each way to stop, until still for `RESTS`.

    There are none after a fall or without coming to rest. moments: [PLACES] s of the command.
    """
    creature, step = walk.creature, walk.time_step
    halts, fades = (each.ravel() for each in np.meshgrid(moments, FADES))
    twin = HaltingTwin(creature, walk.champion, step, halts, fades)
    starts, seconds = nominal_starts(creature, len(halts)), float(moments[-1]) + SETTLES
    outcome = simulate(
        creature, walk.champion, starts, seconds, record=len(halts), threads=1, twin=twin
    )
    film = outcome.trajectory
    root = creature.root_dof
    fastest = STILL * np.sqrt(creature.gravity * creature.frame.hip_height)
    motions = []
    for row, up in enumerate(outcome.stayed_up):
        moves = np.linalg.norm(film.qvel[row, :, root : root + 3], axis=1) >= fastest
        rest = int(np.flatnonzero(moves)[-1]) + 1 + round(RESTS / step)
        motions.append(film.qpos[row, : rest if up and rest < len(moves) else 0])
    return motions


def _motion(
    walk: Walk, qpos: np.ndarray, like: WalkLoop, places: tuple[np.ndarray, np.ndarray]
) -> WalkLoop:
    """Return poses [T, nq] as a clip; its root moves as the body moved.

    places: [2] m, the trunk's place over the root at the clip's begin and end, as in the clips
    before and after.
    """
    count = max(round((len(qpos) - 1) * walk.time_step * like.rate), 1)
    share = np.linspace(0.0, 1.0, count + 1)[:, None]
    frames = resampled(walk.creature.model, qpos, share[:, 0] * (len(qpos) - 1))
    place = _place(walk)
    frames[:, place.stop] -= walk.ground_heights(frames[:, place])
    moved, above = frames[:, place] - frames[0, place], (1 - share) * places[0] + share * places[1]
    frames[:, place] = above
    path, spent = moved - (above - places[0]), (0, len(qpos) - 1)
    return dataclasses.replace(standing_still(like), qpos=frames, path=path, frames=spent)


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
