"""Neighbouring walks of a repertoire in C MuJoCo: blends half way, and changes between them.

An engine blends poses without physics. Here the two controllers are blended and the body is
simulated: if it walks, the engine's blend is near to what the body can do.

Letters: `S` moments at which the change is commanded, `T` control steps.
"""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from mjxgait.certification import CertificateConfig, nominal_check
from mjxgait.certification.acceptance import Wish
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.controllers.key_poses.reference import pose_cycle
from mjxgait.creature import Creature
from mjxgait.experiments.repertoire.found import Found
from mjxgait.experiments.repertoire.grid import Cell, Grid, has_mirror
from mjxgait.processes import one_per_core
from mjxgait.reference.changing import ChangingReference
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.walk import WARMUP
from mjxgait.training.folder import command, open_champion

Pair = tuple[Cell, Cell]
Tried = TypeVar("Tried")


def certified_pairs(creature: Creature, grid: Grid, found: list[Found]) -> list[Pair]:
    """Return all neighbours that are both certified.

    A symmetric body's right turns are left out: they are mirror images of the left turns.
    """
    known = {one.cell for one in found if one.certified}
    lowest = 0.0 if has_mirror(creature) else -np.inf
    return [
        pair
        for pair in grid.pairs
        if known.issuperset(pair) and min(cell.turn for cell in pair) >= lowest
    ]


def of_each(
    work: Callable[[Path, Pair], Tried],
    folder: Path,
    pairs: Sequence[Pair],
    tell: Callable[[int, int], object],
) -> list[Tried]:
    """Return the work's result for each pair, in order; one pair per core.

    tell: called with the counts done and total.

    Raises:
      UserError: a process was killed from outside.
    """
    again = command("repertoire", "--resume", folder, run=folder)
    tried = one_per_core(partial(work, folder), pairs, tell, folder=folder, again=again)
    return tried or []


WALKS = (1, 2, 3)
"""Numbers of the criteria that decide whether a blend walks: up, ahead, in a rhythm."""


@dataclasses.dataclass(frozen=True)
class Blend:
    """Blend of two certified neighbours. fails: criteria of a walk that it does not meet."""

    between: tuple[Cell, Cell]
    fails: tuple[str, ...]

    @property
    def walks(self) -> bool:
        """Whether the blend meets all criteria of a walk."""
        return not self.fails

    @property
    def entry(self) -> dict[str, object]:
        """Entry of the table."""
        names = [cell.name for cell in self.between]
        return {"between": names, "walks": self.walks, "fails": list(self.fails)}


def blends(
    folder: Path,
    creature: Creature,
    grid: Grid,
    found: list[Found],
    tell: Callable[[int, int], object],
) -> list[Blend]:
    """Return a blend for each of the `certified_pairs`. tell: called with counts done and total."""
    return of_each(_blended, folder, certified_pairs(creature, grid, found), tell)


def _blended(folder: Path, pair: Pair) -> Blend:
    """Test a pair in its own process, which receives only the walks' place."""
    (creature, one), (_, other) = (open_champion(folder / cell.name) for cell in pair)
    seen = nominal_check(creature, half_way(one, other, creature))
    criteria = [criterion for criterion in seen.criteria if criterion.number in WALKS]
    return Blend(pair, tuple(criterion.name for criterion in criteria if not criterion.passed))


def half_way(one: Champion, other: Champion, creature: Creature) -> Champion:
    """Return the mean of two controllers, pose by pose, with the mean of their targets."""
    cycles = [_cycle(champion, creature) for champion in (one, other)]
    genome = {
        "key_poses": np.mean(cycles, axis=0),
        "tuning": np.mean([one.genome["tuning"], other.genome["tuning"]], axis=0),
    }
    steps = round((one.settings.interpolation + other.settings.interpolation) / 2)
    settings = dataclasses.replace(
        one.settings, mirror=False, key_poses=len(cycles[0]), interpolation=steps
    )
    wish = _between(one.wish, other.wish)
    return dataclasses.replace(one, genome=genome, settings=settings, wish=wish)


def _cycle(champion: Champion, creature: Creature) -> np.ndarray:
    """Return all poses [C, J] of a champion's cycle."""
    poses = champion.genome["key_poses"]
    return pose_cycle(poses, creature) if champion.settings.mirror else poses


def _between(one: Wish, other: Wish) -> dict[str, object]:
    turn = (one.get("turn", 0.0) + other.get("turn", 0.0)) / 2
    speed = (one["speed"] + other["speed"]) / 2
    others = {name: value for name, value in one.items() if name not in ("turn", "steer")}
    return {**others, "speed": speed} | ({"turn": turn} if turn else {})


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
    def entry(self) -> dict[str, object]:
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
    commanded = commanded_headings(before, after, moments, steps, step)
    reference = ChangingReference(creature, before, after, step, moments, SECONDS)
    outcome = simulate(
        creature,
        after,
        nominal_starts(creature, MOMENTS),
        steps * step,
        record=MOMENTS,
        heading=commanded,
        threads=1,
        reference=reference,
    )
    return outcome.stayed_up & _as_commanded(creature, outcome, float(after.wish["speed"]))


def commanded_headings(
    before: Champion, after: Champion, moments: np.ndarray, steps: int, step: float
) -> np.ndarray | None:
    """Return headings [S, T] rad: turning as one walk, then as the other; None if neither turns."""
    rates = [np.radians(champion.wish.get("turn", 0.0)) for champion in (before, after)]
    if not any(rates):
        return None
    share = np.clip((np.arange(steps) * step - moments[:, None]) / SECONDS, 0.0, 1.0)
    turns: np.ndarray = step * (rates[0] + share * (rates[1] - rates[0]))
    return np.cumsum(turns, axis=1) - turns[:, :1]


def _as_commanded(creature: Creature, outcome: Outcome, speed: float) -> np.ndarray:
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
