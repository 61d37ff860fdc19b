"""Changes from one walk to a neighbouring walk while walking, tested in C MuJoCo.

Letters: `S` moments at which the change is commanded, `T` control steps.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.certification import CertificateConfig
from mjxgait.certification.simulate import simulate
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.experiments.repertoire.found import Found
from mjxgait.experiments.repertoire.grid import Cell, Grid
from mjxgait.experiments.repertoire.pairs import Pair, certified_pairs, of_each
from mjxgait.reference.controllers.changing import ChangingTwin
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.walk import WARMUP
from mjxgait.training.folder import open_champion

MOMENTS, SECONDS = 8, 1.0
"""Number of moments within a second at which the change is commanded, and its duration, s."""
SETTLES, WATCHED = 3.0, 5.0
"""Time to settle after the change, and time for which the body must then walk as commanded, s."""


@dataclasses.dataclass(frozen=True)
class Change:
    """Change between certified neighbours. share: of the moments at which it succeeds."""

    begins: Cell
    ends: Cell
    share: float

    @property
    def entry(self) -> dict[str, Any]:
        """Entry of the table."""
        return {
            "from": self.begins.name,
            "to": self.ends.name,
            "seconds": SECONDS,
            "share": round(self.share, 4),
        }


def changes(
    folder: Path,
    creature: Creature,
    grid: Grid,
    found: list[Found],
    tell: Callable[[int, int], object],
) -> list[Change]:
    """Return the changes of all certified neighbours, there and back. tell: as for `blends`."""
    pairs = certified_pairs(creature, grid, found)
    ways = [way for one, other in pairs for way in ((one, other), (other, one))]
    return of_each(_changed, folder, ways, tell)


def _changed(folder: Path, way: Pair) -> Change:
    """Test a change in its own process, which receives only the walks' place."""
    (creature, before), (_, after) = (open_champion(folder / cell.name) for cell in way)
    return Change(*way, float(succeeds(creature, before, after).mean()))


def succeeds(creature: Creature, before: Champion, after: Champion) -> np.ndarray:
    """Return [S]: whether the body stays up, settles, and keeps the commanded speed and heading."""
    step = float(creature.model.opt.timestep)
    moments = WARMUP + np.arange(MOMENTS) / MOMENTS
    steps = round((moments[-1] + SECONDS + SETTLES + WATCHED) / step)
    told = told_headings(before, after, moments, steps, step)
    twin = ChangingTwin(creature, before, after, step, moments, SECONDS)
    outcome = simulate(
        creature,
        after,
        nominal_starts(creature, MOMENTS),
        steps * step,
        record=MOMENTS,
        heading=told,
        threads=1,
        twin=twin,
    )
    return outcome.stayed_up & _as_told(creature, outcome, float(after.wish["speed"]))


def told_headings(
    before: Champion, after: Champion, moments: np.ndarray, steps: int, step: float
) -> np.ndarray | None:
    """Return headings [S, T] rad: turning as one walk, then as the other; None if neither turns."""
    rates = [np.radians(champion.wish.get("turn", 0.0)) for champion in (before, after)]
    if not any(rates):
        return None
    share = np.clip((np.arange(steps) * step - moments[:, None]) / SECONDS, 0.0, 1.0)
    turns: np.ndarray = step * (rates[0] + share * (rates[1] - rates[0]))
    return np.cumsum(turns, axis=1) - turns[:, :1]


def _as_told(creature: Creature, outcome: Outcome, speed: float) -> np.ndarray:
    """Return [S] for the last seconds: speed by chords of a second, and the mean heading."""
    limits, film = CertificateConfig().wishes, outcome.trajectory
    watched, second = round(WATCHED / film.time_step), round(1.0 / film.time_step)
    root = creature.root_qpos
    place = film.qpos[:, -watched:, root : root + 2]
    fast = np.linalg.norm(place[:, second:] - place[:, :-second], axis=2).mean(1)
    fine: np.ndarray = np.abs(fast / speed - 1) <= limits.speed
    if outcome.astray.size:
        fine &= np.degrees(np.abs(outcome.astray[:, -watched:].mean(1))) <= limits.heading
    return fine
