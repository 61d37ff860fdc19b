"""Departure of a walk from its original cycle, in numbers and in words.

Letters: `N` samples of a cycle, `J` joints, `F` feet.
"""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.animation.keys.cycle import interpolated
from mjxgait.animation.keys.refine import Original, read_original
from mjxgait.creature import Creature
from mjxgait.rendering.cast import LOOP_SECONDS, champion_of
from mjxgait.rendering.walk import Walk
from mjxgait.training.folder import open_run

WORTH_TELLING = 0.01
"""m; smaller changes of a foot are not reported."""
MOST_LINES = 5
TILTED, OUT_OF_TIME = np.radians(1.0), 0.015


@dataclasses.dataclass(frozen=True, eq=False)
class Departure:
    """Departure of a champion's walk from the original cycle.

    poses: deg, root mean square difference of the key poses from the original ones. moved: the
    same for the joints as they moved against the drawn cycle, without their delay; period: share of
    the drawn one; both None where there is no steady stride. by_joint: deg, of the key poses.
    words: one sentence for each change.
    """

    poses: float
    moved: float | None
    period: float | None
    by_joint: dict[str, float]
    words: list[str]


def departure_of(folder: Path) -> Departure:
    """Departure of the champion of a run made by `mjxgait refine`.

    Raises:
      UserError: the run was made otherwise, or has no champion.
    """
    original = read_original(folder, open_run(folder)[0])
    return departure(original, champion_of(folder, LOOP_SECONDS).walk)


def departure(original: Original, walk: Walk) -> Departure:
    """Departure of a champion's walk from the cycle of its run."""
    creature, champion, count = walk.creature, walk.champion, len(original.angles)
    poses = np.asarray(champion.genome["key_poses"], float)
    apart = np.degrees(poses - np.reshape(champion.settings.around, poses.shape))
    by_joint = np.sqrt(np.mean(apart**2, axis=0))
    moved, period, words = None, None, []
    if (found := walk.steady_strides(1)) is not None:
        drawn = np.roll(original.angles, -round(original.starts * count), axis=0)
        done = _over_stride(walk, *found, count)
        shifts = [np.roll(done, -s, axis=0) for s in range(count)]
        nearest = min(shifts, key=lambda angles: float(np.mean((angles - drawn) ** 2)))
        moved = float(np.degrees(np.sqrt(np.mean((nearest - drawn) ** 2))))
        period = (found[1] - found[0]) * walk.time_step / original.period
        pitch = float(np.mean(walk.recording.pitch[slice(*found)]))
        words = _feet_in_words(creature, drawn, nearest) + _in_words(pitch, period)
    named = {n: float(a) for n, a in zip(creature.joints.names, by_joint, strict=True)}
    return Departure(float(np.sqrt(np.mean(apart**2))), moved, period, named, words)


def _in_words(pitch: float, period: float) -> list[str]:
    """Sentences on the trunk's mean pitch in rad, nose down, and the share of the drawn period."""
    told = []
    if abs(pitch) > TILTED:
        way = "down" if pitch > 0 else "up"
        told.append(f"the trunk is tilted nose {way} by {np.degrees(abs(pitch)):.0f} degrees")
    if abs(period - 1.0) > OUT_OF_TIME:
        way = "longer" if period > 1.0 else "shorter"
        told.append(f"a cycle takes {abs(period - 1.0):.0%} {way}")
    return told


def _over_stride(walk: Walk, first: int, last: int, count: int) -> np.ndarray:
    """Recorded joint angles [N, J] over one stride."""
    angles = walk.qpos[:, walk.creature.joints.qpos_adr]
    at, frames = np.linspace(first, last, count, endpoint=False), np.arange(len(angles))
    return interpolated(at, frames, angles)


def _feet_in_words(creature: Creature, drawn: np.ndarray, done: np.ndarray) -> list[str]:
    """Sentences on the feet's changes, seen from the trunk; the largest first."""
    before, after = _feet(creature, drawn), _feet(creature, done)
    told = []
    for foot, name in enumerate(creature.feet.names):
        was, now = before[:, foot], after[:, foot]
        outward = np.sign(was[:, 1].mean()) or 1.0
        for change, more, less in (
            (now[:, 0].max() - was[:, 0].max(), "reaches {} further forward", "less far forward"),
            (was[:, 0].min() - now[:, 0].min(), "reaches {} further back", "less far back"),
            (outward * (now[:, 1] - was[:, 1]).mean(), "is {} further out", "further in"),
            (np.ptp(now[:, 2]) - np.ptp(was[:, 2]), "lifts {} higher", "less high"),
        ):
            verb = more.split()[0]
            how = more if change > 0 else f"{verb} {{}} {less}"
            told.append((abs(change), f"{name} " + how.format(f"{100 * abs(change):.0f} cm")))
    told = sorted((t for t in told if t[0] > WORTH_TELLING), reverse=True)
    return [sentence for _, sentence in told[:MOST_LINES]]


def _feet(creature: Creature, angles: np.ndarray) -> np.ndarray:
    """Places [N, F, 3] in m of the feet forward, left and up of the trunk."""
    data, frame = mujoco.MjData(creature.model), creature.frame
    axes = np.stack([frame.forward, frame.left, frame.up])
    geoms, foot_of = np.array(creature.feet.stepping), creature.feet.foot_of
    firsts = [int(geoms[np.argmax(foot_of == f)]) for f in range(len(creature.feet.names))]
    places = []
    for row in angles:
        data.qpos[:] = creature.stand_qpos
        data.qpos[creature.joints.qpos_adr] = row
        mujoco.mj_kinematics(creature.model, data)
        turned = data.xmat[creature.trunk].reshape(3, 3)
        places.append((data.geom_xpos[firsts] - data.xpos[creature.trunk]) @ turned @ axes.T)
    return np.array(places)
