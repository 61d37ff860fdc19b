"""A run that stays near a keyed cycle: a normal run with special settings."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.animation.keys.bring import Brought
from mjxgait.config.schema import Config
from mjxgait.config.tables import build, merge
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.files import read_json, write_text
from mjxgait.plugins import resolve_config
from mjxgait.tasks.walk.textbook_start import ORDERED
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import create_run

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
    others: Mapping[str, Any] | None = None,
) -> Config:
    """The settings of a training with key poses, before the cycle is known.

    config, seed, population, generations: as requested. others: tables as in a config file.

    Raises:
      UserError: they are wrong, or for another controller.
    """
    ordered = merge(creature.settings.train, {"evolution": ORDERED})
    resolved = resolve_config(ordered, creature.name, config)
    short = {"population": population, "generations": generations}
    evolution = {key: value for key, value in short.items() if value is not None}
    table = merge(dataclasses.asdict(resolved), {"seed": seed, "evolution": evolution})
    chosen = build(type(resolved), merge(table, others or {}), "the options")
    if chosen.use.controller != "poses":
        raise UserError("refine is for the controller of key poses; leave use.controller out")
    return chosen


def refining(config: Config, brought: Brought, keep: float) -> Config:
    """The settings of a run near a cycle; a clock leads it in the cycle's own time.

    keep: with 1 only the reflexes (steering, balance) evolve; with 0 every joint, by `FARTHEST`.

    Raises:
      UserError: `keep` is no share.
    """
    if not 0.0 <= keep <= 1.0:
        raise UserError(f"--keep {keep:g}: must lie between 0 and 1")
    poses, period = brought.fit.key_poses, brought.cycle.period
    slack = SLOWER * (1.0 - keep)
    near: dict[str, Any] = {
        "key_poses": len(poses),
        "mirror": brought.cycle.mirrored,
        "advance": "clock",
        "around": [round(float(angle), 6) for angle in poses.ravel()],
        "within": FARTHEST * (1.0 - keep),
        "tuning": {"period": [period * (1.0 - slack), period * (1.0 + slack)]},
    }
    spread = config.evolution.initial_spread
    if own := brought.own:
        ranges = dataclasses.asdict(config)["controller"]["tuning"]
        near["advance"] = own.advance
        near["tuning"] = {n: _near(own.tuning[n], ranges[n], 1.0 - keep) for n in own.tuning}
        spread = min(spread, OWN_SPREAD)
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
        raise UserError(f"{folder}: was not made by `mjxgait refine` (it has no {KEYS})")
    try:
        document = read_json(path)
        angles = np.array([document["joints"][name] for name in creature.joints.names], float).T
        known = {key: float(document[key]) for key in ("period", "starts")}
        return Original(str(document["source"]), angles, **known)
    except (ValueError, LookupError, TypeError, ArithmeticError):
        raise UserError(f"{path}: damaged; it must hold the cycle's angles by joint") from None
