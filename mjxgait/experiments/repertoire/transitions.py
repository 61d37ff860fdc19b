"""How a walk of a repertoire begins and ends: from standing into its stride, and out of it.

Both are simulated in C MuJoCo, undisturbed, and move their root as the body moved. Letters: `S` ways
to stop, `T` frames, `J` actuated joints.
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
"""s by which a walk is in its stride, and rad by which its joints may be off where it is, root mean
square.
"""
PLACES, FADES = 8, (0.2, 0.5, 1.0)
"""Ways to stop: moments of a stride at which it is told to, and s that its poses have to become the
standing one."""
SETTLES, STILL = 3.0, 0.02
"""s from the last of these moments on until it must be still; m/s per sqrt(g * hip height) of the
trunk that are still."""
RESTS = 0.3
"""s that it is seen to be still."""


@dataclasses.dataclass(frozen=True, eq=False)
class Transition:
    """From one clip into another.

    loop: the motion; None where no way was found. gaps: rad by which the joints are off those of the
    clip before and the clip after, where these meet, root mean square.
    """

    begins: str
    ends: str
    loop: WalkLoop | None = None
    gaps: tuple[float, float] = (0.0, 0.0)

    @property
    def name(self) -> str:
        """Of its clip."""
        return f"{self.ends}_start" if self.begins == IDLE else f"{self.begins}_stop"

    def __bool__(self) -> bool:
        """Whether it was found."""
        return self.loop is not None

    @property
    def entry(self) -> dict[str, Any]:
        """For the table."""
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
    """A start and a stop for each certified walk straight on, made of the walk that its clip is of."""
    names = [one.cell.name for one in found if one.certified and not one.cell.turn]
    return [of(loops[name].walk, name, loops) for name in names for of in (start_of, stop_of)]


def start_of(walk: Walk, name: str, loops: dict[str, WalkLoop]) -> Transition:
    """From standing to the first footfall at which it is near to the clip's begin; to the nearest of
    the first seconds where none is.
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
    """From that footfall which is most like the clip's begin to standing still, in the way that is
    soonest over of those that end up.
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
    """Poses [T, nq] until it has been still for a while, for each way to stop; none where it falls or
    does not come to rest.

    moments: [PLACES] s at which it is told to.
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
    """Poses [T, nq] as a clip whose root moves as the body moved.

    places: [2] m, where the trunk is above the root as the clip begins and as it ends: where the
    clips before and after have it.
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
    """Of the trunk in the world, among the numbers of a pose; its height comes after."""
    first = walk.creature.root_qpos
    return slice(first, first + 2)


def _likest(walk: Walk, frames: np.ndarray, pose: np.ndarray) -> int:
    """Of some frames that in which the walk is nearest to a pose [nq]."""
    return int(min(frames, key=lambda frame: _apart(walk, walk.qpos[frame], pose)))


def _apart(walk: Walk, one: np.ndarray, other: np.ndarray) -> float:
    """rad between the actuated joints of two poses [nq], root mean square."""
    joints = walk.creature.joints.qpos_adr
    return float(np.sqrt(np.mean((one[joints] - other[joints]) ** 2)))
