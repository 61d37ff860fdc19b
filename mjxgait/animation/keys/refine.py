"""Runs that stay near a keyed cycle, and their departure from it.

Letters: `N` samples of a cycle, `J` joints, `F` feet.
"""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.animation.keys.bring import Brought
from mjxgait.animation.keys.cycle import interpolated
from mjxgait.certification import criteria_of, read_certificate, verdict_of
from mjxgait.config.schema import Config
from mjxgait.config.tables import Table, build, merge, not_none
from mjxgait.controllers.key_poses.config import STEPPING, TUNING, PoseConfig, smooth
from mjxgait.controllers.key_poses.serialize import MOST_POSES
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.files import read_json, write_text
from mjxgait.plugins import resolve_config
from mjxgait.rendering.curves import figure, save
from mjxgait.rendering.filmstrip import Kept, draw_front, front_shape
from mjxgait.rendering.video import LOOP_SECONDS, champion_of
from mjxgait.rendering.walk import Walk
from mjxgait.tasks.walk.textbook_start import ORDERED
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import CERTIFICATE, check_free, create_run, open_run

KEYS = "keys.json"
"""File in the run folder with the cycle that the run stays near."""
FARTHEST = 30.0
"""deg; largest departure of each joint of each key pose when nothing is kept."""
SLOWER = 0.3
"""Share by which the period may change when nothing is kept."""
OWN_SPREAD = 0.2
"""Share of its range in which each gene begins, if the file states the walk's genes."""


def _near(value: float, ends: Sequence[float], share: float) -> list[float]:
    """The part of a range that lies within a share of its width about a value."""
    low, high = min(ends[0], value), max(ends[1], value)
    return [max(low, value - share * (high - low)), min(high, value + share * (high - low))]


@dataclasses.dataclass(frozen=True, eq=False)
class Original:
    """The cycle that a run stays near.

    source: name of the file. angles: [N, J] rad over one cycle; the key poses begin at the share
    `starts` of it. period: s.
    """

    source: str
    angles: np.ndarray
    period: float
    starts: float


def base_settings(
    creature: Creature,
    config: Path | None,
    seed: int,
    population: int | None = None,
    generations: int | None = None,
    others: Table | None = None,
) -> Config:
    """The settings of a training with key poses, before the cycle is known.

    config, seed, population, generations: as requested. others: tables as in a config file.

    Raises:
      UserError: they are wrong, or for another controller.
    """
    ordered = merge(creature.settings.train, {"evolution": ORDERED})
    resolved = resolve_config(ordered, creature.name, config)
    evolution = not_none(population=population, generations=generations)
    table = merge(dataclasses.asdict(resolved), {"seed": seed, "evolution": evolution})
    chosen = build(type(resolved), merge(table, others or {}), "the options")
    if chosen.use.controller != "poses":
        raise UserError("refine is for the controller of key poses; leave use.controller out")
    return chosen


def refining(creature: Creature, config: Config, brought: Brought, keep: float) -> Config:
    """The settings of a run near a cycle; a clock leads it in the cycle's own time.

    keep: with 1 only the reflexes (steering, balance) evolve; with 0 every joint, by `FARTHEST`.

    Raises:
      UserError: `keep` is no share.
    """
    if not 0.0 <= keep <= 1.0:
        raise UserError(f"--keep {keep:g}: must lie between 0 and 1")
    poses, period = brought.fit.key_poses, brought.cycle.period
    slack = SLOWER * (1.0 - keep)
    tuning = {"period": [period * (1.0 - slack), period * (1.0 + slack)]}
    near: dict[str, object] = {
        "key_poses": len(poses),
        "mirror": brought.cycle.mirrored,
        "advance": "clock",
        "around": [round(float(angle), 6) for angle in poses.ravel()],
        "within": FARTHEST * (1.0 - keep),
    }
    spread = config.evolution.initial_spread
    if own := brought.own:
        ranges, note = dataclasses.asdict(config)["controller"], own.tuning
        near["advance"] = own.advance
        tuning, steps = (
            {n: _near(note[n], ranges[table][n], 1.0 - keep) for n in genes if n in note}
            for table, genes in (("tuning", TUNING), ("stepping", STEPPING))
        )
        near |= {"stepping": steps} if steps else {}
        spread = min(spread, OWN_SPREAD)
    if near["advance"] == "clock":
        whole = len(poses) * (1 + brought.cycle.mirrored)
        step = float(creature.model.opt.timestep)
        near["interpolation"] = smooth(tuning["period"][1], whole, step)
    near["tuning"] = tuning
    changes = {"controller": near, "evolution": {"initial_spread": spread}}
    return build(type(config), merge(dataclasses.asdict(config), changes), "the settings of refine")


def begin(
    out: Path | None, creature: Creature, config: Config, source: Path, brought: Brought
) -> Path:
    """Create a run folder, and store the cycle in it; see `create_run`."""
    folder = create_run(out, creature, config)
    joints = dict(zip(creature.joints.names, brought.cycle.angles.T.tolist(), strict=True))
    document = {
        "source": source.name,
        "period": brought.cycle.period,
        "starts": float(brought.fit.starts),
        "joints": joints,
    }
    with disk_errors(folder):
        write_text(folder / KEYS, json.dumps(document) + "\n")
    return folder


def read_original(folder: Path, creature: Creature) -> Original:
    """The cycle that a run stays near.

    Raises:
      UserError: the run was not made by `refine`, or the file is damaged.
    """
    path = folder / KEYS
    if not path.exists():
        raise UserError(
            f"{folder}: was not made by `mjxgait refine` (it has no {KEYS}); name a run that this "
            "command made, or begin one with it"
        )
    try:
        document = read_json(path)
        angles = np.array([document["joints"][name] for name in creature.joints.names], float).T
        known = {key: float(document[key]) for key in ("period", "starts")}
        if not (angles.ndim == 2 and 0 < len(angles) <= MOST_POSES and np.isfinite(angles).all()):
            raise ValueError
        if not (known["period"] > 0 and np.isfinite(list(known.values())).all()):
            raise ValueError
        return Original(str(document["source"]), angles, **known)
    except (ValueError, LookupError, TypeError, ArithmeticError):
        raise UserError(f"{path}: damaged; it must hold the cycle's angles by joint") from None


WORTH_TELLING = 0.01
"""m; smaller changes of a foot are not reported."""
MOST_LINES = 5
TILTED, OUT_OF_TIME = np.radians(1.0), 0.015


@dataclasses.dataclass(frozen=True, eq=False)
class Departure:
    """Departure of a champion's walk from the original cycle.

    poses: deg, root mean square difference of the key poses from the original ones. moved: the
    same for the joints as they moved against the drawn cycle, without their delay; period: share of
    the drawn one; both None where there is no steady stride. words: one sentence for each change.
    """

    poses: float
    moved: float | None
    period: float | None
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
    return Departure(float(np.sqrt(np.mean(apart**2))), moved, period, words)


def _in_words(pitch: float, period: float) -> list[str]:
    """Sentences on the trunk's mean pitch in rad, nose down, and the share of the drawn period."""
    sentences = []
    if abs(pitch) > TILTED:
        way = "down" if pitch > 0 else "up"
        sentences.append(f"the trunk is tilted nose {way} by {np.degrees(abs(pitch)):.0f} degrees")
    if abs(period - 1.0) > OUT_OF_TIME:
        way = "longer" if period > 1.0 else "shorter"
        sentences.append(f"a cycle takes {abs(period - 1.0):.0%} {way}")
    return sentences


def _over_stride(walk: Walk, first: int, last: int, count: int) -> np.ndarray:
    """Recorded joint angles [N, J] over one stride."""
    angles = walk.qpos[:, walk.creature.joints.qpos_adr]
    at, frames = np.linspace(first, last, count, endpoint=False), np.arange(len(angles))
    return interpolated(at, frames, angles)


def _feet_in_words(creature: Creature, drawn: np.ndarray, done: np.ndarray) -> list[str]:
    """Sentences on the feet's changes, seen from the trunk; the largest first."""
    before, after = _feet(creature, drawn), _feet(creature, done)
    changes = []
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
            changes.append((abs(change), f"{name} " + how.format(f"{100 * abs(change):.0f} cm")))
    changes = sorted((one for one in changes if one[0] > WORTH_TELLING), reverse=True)
    return [sentence for _, sentence in changes[:MOST_LINES]]


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


PICTURE = "front"
STARTS = 4
"""Number of the criterion on disturbed starts that stay up."""


def folder_of(out: Path, keep: float) -> Path:
    """Folder of the run that keeps this share."""
    return out / f"keep-{keep:g}"


def runs_in(out: Path) -> list[Path]:
    """The runs of a front, the most faithful first; empty if the folder is no front."""
    found = [run for run in out.glob("keep-*") if (run / KEYS).is_file()]
    return sorted(found, key=kept_by, reverse=True)


def kept_by(run: Path) -> float:
    """The share of the original that a run keeps."""
    settings = open_run(run)[1].controller
    if not isinstance(settings, PoseConfig):
        raise UserError(f"{run}: was not made by `mjxgait refine`: its controller has no key poses")
    return round(1.0 - settings.within / FARTHEST, 6)


def check_front(out: Path, keeps: Sequence[float]) -> None:
    """Refuse to begin in a folder that is in use.

    Raises:
      UserError: the folder is not empty, or a share is there twice.
    """
    check_free(out, "mjxgait refine --resume")
    if len(set(keeps)) < len(keeps):
        raise UserError("--keep: name each share once")


def finished(run: Path) -> bool:
    """True if the run's champion has a certificate."""
    return (run / CERTIFICATE).is_file()


def look(run: Path) -> Kept:
    """The result of a finished run."""
    document = read_certificate(run / CERTIFICATE)
    if document is None:
        raise UserError(f"{run}: has no certificate yet; mjxgait refine --resume {run}")
    found = {c.number: c for c in criteria_of(document)}
    if STARTS not in found:
        raise UserError(f"{run / CERTIFICATE}: has no criterion {STARTS}; mjxgait certify {run}")
    walk = champion_of(run, LOOP_SECONDS).walk
    return Kept(
        kept_by(run),
        departure(read_original(run, walk.creature), walk).poses,
        float(np.nan_to_num(found[STARTS].measures[0].value)),
        verdict_of(document).certified,
        walk,
    )


def draw(out: Path) -> Path:
    """Draw a front of finished runs, and return the path of the picture.

    Raises:
      UserError: a run has no certificate yet, or the picture cannot be written.
    """
    kept = [look(run) for run in runs_in(out)]
    with disk_errors(out), figure(front_shape(kept)) as drawing:
        draw_front(drawing, kept)
        return save(drawing, out / PICTURE, ("png",))[0]
