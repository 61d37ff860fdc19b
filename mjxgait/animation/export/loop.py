"""Whole strides of a walk, closed to a loop that begins at a given phase.

Letters: `F` key frames, `nq nv` as in MuJoCo.
"""

import dataclasses

import mujoco
import numpy as np

from mjxgait.animation.export.recurrence import most_alike
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.reference.measure import falls_of_feet
from mjxgait.rendering.walk import Walk

LOOP = "-loop"
"""End of an animation's name, by which Godot plays it in a loop."""
MOST_STRIDES = 4
TOLERANCE = 0.01
"""Relative change of speed, from the fit to whole frames, above which another stride is added."""


@dataclasses.dataclass(frozen=True, eq=False)
class WalkLoop:
    """Key frames in place: the creature stays above the origin of the world.

    walk: source of the frames. qpos: [F, nq], in a loop the last equal to the first. rate:
    frames/s. strides: in the loop; 0 if it is none. advance: m forward in one loop; the travelling
    walk adds it evenly. stretched: duration over the recorded one. frames: first and last recorded
    frame. turned: rad to the left in one loop, added likewise; in place the creature always looks
    ahead. path: [F, 2] m in the world, if the root moves unevenly; used in place, too. begins:
    share of the recorded frames, from the first on, at which the key frames begin. climb: m up in
    one loop, of a swimmer.
    """

    walk: Walk
    qpos: np.ndarray
    rate: int
    strides: int
    advance: float
    stretched: float
    frames: tuple[int, int]
    turned: float = 0.0
    path: np.ndarray | None = None
    begins: float = 0.0
    climb: float = 0.0
    certificate: str = ""

    @property
    def times(self) -> np.ndarray:
        """Times [F] in s."""
        return np.arange(len(self.qpos)) / self.rate

    @property
    def speed(self) -> float:
        """Mean speed in m/s."""
        ahead = np.hypot(self.advance, self.climb) if self.climb else self.advance
        return float(ahead / self.times[-1])

    @property
    def way(self) -> float:
        """Way ahead in m, from the first frame to the last."""
        return self.advance if self.path is None else float(self.path[-1] @ self.walk.forward)


def animation_of(name: str, loop: WalkLoop) -> str:
    """Return the name of a clip's animation in a file: a loop's ends with `LOOP`."""
    return f"{name}{LOOP}" if loop.strides else name


def walk_loop(walk: Walk, rate: int = 30, most: int = MOST_STRIDES) -> WalkLoop:
    """The steadiest strides of a walk as a loop of whole frames; of a contest the whole of it.

    most: largest number of strides; with one, frames may be off the recorded times by half a frame.

    Raises:
      UserError: the walk has no steady stride.
    """
    if walk.creature.settings.creature.beside:
        return _contest(walk, rate)
    chosen = _alike(walk, rate) if walk.grown else _fitting_strides(walk, rate, most)
    if chosen is None:
        why = (
            f"it fell after {walk.fell:.2f} s"
            if np.isfinite(walk.fell)
            else f"none was completed in {walk.seconds:g} s"
        )
        raise UserError(
            f"{walk.creature.name}: the champion has no steady stride to make a loop of ({why}); "
            "train it for longer"
        )
    first, last, strides, count = chosen
    share = np.linspace(0.0, 1.0, count + 1)
    model = walk.creature.model
    qpos = resampled(model, walk.qpos, first + share * (last - first))
    seconds = (last - first) * walk.time_step
    rate_of_turn = np.radians(walk.champion.wish.get("turn", 0.0))
    if rate_of_turn:
        qpos = _straightened(walk, qpos, first * walk.time_step + share * seconds, rate_of_turn)
    gap = _difference(model, qpos[-1], qpos[0])
    root = walk.creature.root_dof
    advance = float(-gap[root : root + 2] @ walk.forward)
    # The gap between end and beginning is spread over the loop.
    qpos = np.array([_integrate(model, q, s * gap) for q, s in zip(qpos, share, strict=True)])
    qpos[-1] = qpos[0]
    place = walk.creature.root_qpos
    # The loop is shown on a viewer's own flat floor or on none, so uneven ground is replaced by its
    # mean height.
    below = walk.ground_heights(walk.qpos[first:last, place : place + 2])
    qpos[:, place + 2] -= below.mean() - 0.5 * (below[-1] - below[0])
    climb = float(-gap[root + 2]) if walk.afloat else 0.0
    level = 3 if walk.afloat else 2
    qpos[:, place : place + level] -= qpos[:-1, place : place + level].mean(0)
    stretched, turned = count / rate / seconds, float(rate_of_turn * seconds)
    return WalkLoop(
        walk, qpos, rate, strides, advance, stretched, (first, last), turned, climb=climb
    )


def _contest(walk: Walk, rate: int) -> WalkLoop:
    """A contest as recorded, about the place of the cube at the start."""
    model, cube = walk.creature.model, walk.creature.settings.creature.beside[1]
    qpos = _whole(walk, rate)
    middle = walk.qpos[0, model.joint(cube).qposadr[0] :][:2]
    for place in model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]:
        qpos[:, place : place + 2] -= middle
    return WalkLoop(walk, qpos, rate, 0, 0.0, 1.0, (0, len(walk.qpos) - 1))


def walk_take(walk: Walk, rate: int = 30) -> WalkLoop:
    """The whole walk as recorded, also one that falls, in place and with a seam."""
    place, qpos = walk.creature.root_qpos, _whole(walk, rate)
    advance = float((qpos[-1, place : place + 2] - qpos[0, place : place + 2]) @ walk.forward)
    share = np.linspace(0.0, 1.0, len(qpos))[:, None]
    qpos[:, place + 2] -= walk.ground_heights(qpos[:, place : place + 2])
    qpos[:, place : place + 2] -= (1 - share) * qpos[0, place : place + 2] + share * qpos[
        -1, place : place + 2
    ]
    return WalkLoop(walk, qpos, rate, 0, advance, 1.0, (0, len(walk.qpos) - 1))


def _whole(walk: Walk, rate: int) -> np.ndarray:
    """Poses [F, nq] of a whole walk."""
    count = max(int(walk.seconds * rate), 2)
    return resampled(walk.creature.model, walk.qpos, np.arange(count) / rate / walk.time_step)


def resampled(model: mujoco.MjModel, qpos: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Poses [F, nq] at fractional frames [F] of poses [T, nq]."""
    return np.array([_between(model, qpos, at) for at in frames])


def _straightened(walk: Walk, qpos: np.ndarray, times: np.ndarray, rate: float) -> np.ndarray:
    """The poses [F, nq] of an even turn, straightened to lead ahead.

    times: [F] s since the start. rate: rad/s to the left. Each step is turned back by its own
    heading, and the whole way is then turned to lead forward.
    """
    place, straight = walk.creature.root_qpos, qpos.copy()
    headings, steps = rate * times, np.diff(qpos[:, place : place + 2], axis=0)
    middles = (headings[1:] + headings[:-1]) / 2
    way = np.cumsum(np.array([_turned(s, -a) for s, a in zip(steps, middles, strict=True)]), axis=0)
    along = np.arctan2(way[-1] @ _turned(walk.forward, np.pi / 2), way[-1] @ walk.forward)
    ahead = np.array([_turned(step, -along) for step in way])
    straight[1:, place : place + 2] = straight[0, place : place + 2] + ahead
    for row, heading in zip(straight, headings + along, strict=True):
        about = np.array([np.cos(heading / 2), 0.0, 0.0, -np.sin(heading / 2)])
        mujoco.mju_mulQuat(row[place + 3 : place + 7], about, row[place + 3 : place + 7].copy())
    return straight


def _turned(vector: np.ndarray, angle: float) -> np.ndarray:
    """A vector [2] turned to the left by rad."""
    c, s = np.cos(angle), np.sin(angle)
    turned: np.ndarray = np.array([[c, -s], [s, c]]) @ vector
    return turned


def _fitting_strides(walk: Walk, rate: int, most: int) -> tuple[int, int, int, int] | None:
    """First and last recorded frame, number of strides, and number of key frames less one.

    The fewest strides that fit the frames well.
    """
    found = []
    for strides in range(1, most + 1):
        if (ends := walk.steady_strides(strides)) is None:
            break
        seconds = (ends[1] - ends[0]) * walk.time_step
        count = max(round(seconds * rate), 2)
        error = abs(count / rate / seconds - 1)
        found.append((error, (*ends, strides, count)))
        if error < TOLERANCE:
            break
    return min(found)[1] if found else None


def _alike(walk: Walk, rate: int) -> tuple[int, int, int, int] | None:
    """Return first and last recorded frame, 1, and key frames less one, for a body that grew.

    Its brain has no cycle, so the loop is the span whose ends are most alike.
    """
    upright = walk.body_poses()[1][:, walk.creature.trunk].reshape(len(walk.qpos), 9)
    found = most_alike(walk.qpos[:, walk.creature.root_qpos + 7 :], upright, walk.time_step)
    return found and (*found, 1, max(round((found[1] - found[0]) * walk.time_step * rate), 2))


def _between(model: mujoco.MjModel, qpos: np.ndarray, at: float) -> np.ndarray:
    """The pose [nq] at a fractional frame of poses [T, nq]."""
    low = min(int(at), len(qpos) - 2)
    return _integrate(model, qpos[low], (at - low) * _difference(model, qpos[low], qpos[low + 1]))


def _difference(model: mujoco.MjModel, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Change [nv] from one pose to another."""
    change = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, change, 1.0, start, end)
    return change


def _integrate(model: mujoco.MjModel, qpos: np.ndarray, change: np.ndarray) -> np.ndarray:
    moved = qpos.copy()
    mujoco.mj_integratePos(model, moved, change, 1.0)
    return moved


def stride_in_phase(walk: Walk, rate: int) -> WalkLoop:
    """One stride of a walk as a loop that begins when the creature's first foot comes down.

    If that foot never leaves the floor, the loop begins with the controller's cycle.

    Raises:
      UserError: the walk has no steady stride.
    """
    loop = walk_loop(walk, rate, most=1)
    first, last = loop.frames
    falls, count = falls_of_first_foot(walk), len(loop.qpos) - 1
    within = falls[(falls >= first) & (falls < last)]
    if not len(within):
        return loop
    at = round((within[0] - first) / (last - first) * count)
    turned = np.roll(loop.qpos[:-1], -at, axis=0)
    return dataclasses.replace(
        loop, qpos=np.concatenate([turned, turned[:1]]), begins=at % count / count
    )


def falls_of_first_foot(walk: Walk) -> np.ndarray:
    """Recorded frames at which the creature's first foot comes down."""
    return falls_of_feet(walk.recording)[0]


def standing_still(like: WalkLoop) -> WalkLoop:
    """One second of the standing pose; it is not simulated, so it has no recorded frames."""
    creature: Creature = like.walk.creature
    stand = creature.stand_qpos.copy()
    place = creature.root_qpos
    stand[place : place + 2] = 0.0
    qpos = np.tile(stand, (like.rate + 1, 1))
    return WalkLoop(like.walk, qpos, like.rate, 0, 0.0, 1.0, (0, 0))
