"""How far a walk departs from the cycle that it was made of, in numbers and in words.

Letters: `N` samples of a cycle, `J` joints, `F` feet.
"""

import dataclasses

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.keys.cycle import mirror_image
from mjxgait.keys.refine import Original
from mjxgait.settings.control import TUNING
from mjxgait.viewing.walk import Walk

WORTH_TELLING = 0.01
"""m; a foot that moves less far elsewhere is where it was."""
MOST_LINES = 5
TILTED = np.radians(1.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Departure:
    """poses: deg, root mean square of what the targets differ. moved: the same of the joints as they
    moved, without the delay with which they follow; None where the walk has no steady stride.
    period: of the original's. by_joint: deg, of the targets. words: what changed, a sentence each.
    """

    poses: float
    moved: float | None
    period: float
    by_joint: dict[str, float]
    words: list[str]


def departure(original: Original, walk: Walk) -> Departure:
    """Of a champion's walk from the cycle of its run."""
    creature, count = walk.creature, len(original.angles)
    drawn = np.roll(original.angles, -round(original.starts * count), axis=0)
    apart = np.degrees(np.sqrt(np.mean((_targets(walk, count) - drawn) ** 2, axis=0)))
    period = float(walk.champion.genome["tuning"][TUNING.index("period")]) / original.period
    moved, words = None, []
    if (found := walk.steady_strides(1)) is not None:
        done = _over_stride(walk, *found, count)
        shifts = [np.roll(done, -s, axis=0) for s in range(count)]
        nearest = min(shifts, key=lambda angles: float(np.mean((angles - drawn) ** 2)))
        moved = float(np.degrees(np.sqrt(np.mean((nearest - drawn) ** 2))))
        words = _feet_in_words(creature, drawn, nearest)
        pitch = float(np.mean(walk.recording.pitch[slice(*found)]))
        if abs(pitch) > TILTED:
            way = "down" if pitch > 0 else "up"
            words.append(f"the trunk is tilted nose {way} by {np.degrees(abs(pitch)):.0f} degrees")
    if abs(period - 1.0) > 0.01:
        way = "longer" if period > 1.0 else "shorter"
        words.append(f"a cycle takes {abs(period - 1.0):.0%} {way}")
    whole = float(np.sqrt(np.mean(apart**2)))
    by_joint = {n: float(a) for n, a in zip(creature.joints.names, apart, strict=True)}
    return Departure(whole, moved, period, by_joint, words)


def _targets(walk: Walk, count: int) -> np.ndarray:
    """[N, J] of the champion's key poses over the cycle, without its reflexes."""
    poses = np.asarray(walk.champion.genome["key_poses"], float)
    mirrored = walk.creature.mirror.symmetric and walk.champion.settings.mirror
    whole = np.concatenate([poses, mirror_image(walk.creature, poses)]) if mirrored else poses
    return _evenly(np.concatenate([whole, whole[:1]]), np.arange(count) / count * len(whole))


def _over_stride(walk: Walk, first: int, last: int, count: int) -> np.ndarray:
    """[N, J] of the joints as they moved over one stride."""
    angles = walk.qpos[:, walk.creature.joints.qpos_adr]
    return _evenly(angles, np.linspace(first, last, count, endpoint=False))


def _evenly(rows: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Rows [n, J] at fractional places."""
    return np.stack([np.interp(at, np.arange(len(rows)), column) for column in rows.T], 1)


def _feet_in_words(creature: Creature, drawn: np.ndarray, done: np.ndarray) -> list[str]:
    """What the feet do otherwise, seen from the trunk; the largest changes first."""
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
    """[N, F, 3] m of the feet forward, left and up of the trunk."""
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
