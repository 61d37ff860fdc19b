"""How a walk of a repertoire begins and ends: from standing into its stride, and out of it.

Both are simulated in C MuJoCo, undisturbed, and move their root as the body moved. Letters: `S` ways
to stop, `T` frames, `J` actuated joints.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.animation import WalkLoop, falls_of_first_foot, resampled, standing_still
from mjxgait.certify.simulate import simulate
from mjxgait.certify.starts import nominal_starts
from mjxgait.certify.twins.halting import HaltingTwin
from mjxgait.repertoire.found import Found
from mjxgait.viewing.cast import LOOP_SECONDS, champion_of
from mjxgait.viewing.walk import WARMUP, Walk

IDLE = "idle"
BEGINS_BY = 4.0
"""s by which a walk is in its stride."""
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

    loop: the motion; None where no way was found. gap: rad by which the joints are off those of the
    clip that follows, root mean square. way: m ahead.
    """

    begins: str
    ends: str
    loop: WalkLoop | None = None
    gap: float = 0.0
    way: float = 0.0

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
        if self.loop is None:
            return ends | {"found": False}
        return ends | {
            "found": True,
            "duration": round(float(self.loop.times[-1]), 6),
            "frames_per_s": self.loop.rate,
            "way": round(self.way, 4),
            "gap": round(self.gap, 4),
        }


def transitions(
    folder: Path, found: Sequence[Found], loops: dict[str, WalkLoop]
) -> list[Transition]:
    """A start and a stop for each certified walk straight on."""
    names = [one.cell.name for one in found if one.certified and not one.cell.turn]
    made = []
    for name in names:
        walk = champion_of(folder / name, LOOP_SECONDS).walk
        made += [start_of(walk, name, loops), stop_of(walk, name, loops)]
    return made


def start_of(walk: Walk, name: str, loops: dict[str, WalkLoop]) -> Transition:
    """From standing to that footfall of the first seconds in which it is most like the clip's begin."""
    falls = falls_of_first_foot(walk)
    falls = falls[falls * walk.time_step <= BEGINS_BY]
    if not len(falls):
        return Transition(IDLE, name)
    gaps = [_apart(walk, walk.qpos[fall], loops[name].qpos[0]) for fall in falls]
    end = int(falls[int(np.argmin(gaps))])
    loop, way = _motion(walk, walk.qpos[: end + 1], loops[name])
    return Transition(IDLE, name, loop, min(gaps), way)


def stop_of(walk: Walk, name: str, loops: dict[str, WalkLoop]) -> Transition:
    """From the clip's begin to standing still, in the way that is soonest over of those that end up."""
    falls = falls_of_first_foot(walk)
    settled = falls[falls * walk.time_step >= WARMUP]
    if len(settled) < 2:
        return Transition(name, IDLE)
    begin, stride = int(settled[0]), float(np.diff(settled).mean()) * walk.time_step
    motions = halted(walk, begin * walk.time_step + stride * np.arange(PLACES) / PLACES)
    ends = [(frames, row) for row, frames in enumerate(map(len, motions)) if frames]
    if not ends:
        return Transition(name, IDLE)
    chosen = motions[min(ends)[1]][begin:]
    loop, way = _motion(walk, chosen, loops[name])
    return Transition(name, IDLE, loop, _apart(walk, chosen[-1], walk.creature.stand_qpos), way)


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
    root = int(creature.model.jnt_dofadr[creature.model.body_jntadr[creature.trunk]])
    fastest = STILL * np.sqrt(creature.gravity * creature.frame.hip_height)
    motions = []
    for row, up in enumerate(outcome.stayed_up):
        moves = np.linalg.norm(film.qvel[row, :, root : root + 3], axis=1) >= fastest
        rest = int(np.flatnonzero(moves)[-1]) + 1 + round(RESTS / step)
        motions.append(film.qpos[row, : rest if up and rest < len(moves) else 0])
    return motions


def _motion(walk: Walk, qpos: np.ndarray, like: WalkLoop) -> tuple[WalkLoop, float]:
    """Poses [T, nq] as a clip that begins above the origin, and how far ahead it leads in m."""
    model, trunk = walk.creature.model, walk.creature.trunk
    count = max(round((len(qpos) - 1) * walk.time_step * like.rate), 1)
    frames = resampled(model, qpos, np.linspace(0.0, len(qpos) - 1.0, count + 1))
    place = int(model.jnt_qposadr[model.body_jntadr[trunk]])
    frames[:, place : place + 2] -= frames[0, place : place + 2].copy()
    way = float(frames[-1, place : place + 2] @ walk.forward)
    still = standing_still(like)
    return dataclasses.replace(still, qpos=frames), way


def _apart(walk: Walk, one: np.ndarray, other: np.ndarray) -> float:
    """rad between the actuated joints of two poses [nq], root mean square."""
    joints = walk.creature.joints.qpos_adr
    return float(np.sqrt(np.mean((one[joints] - other[joints]) ** 2)))
