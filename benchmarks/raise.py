"""Limits of champions beyond the certificate, in C MuJoCo, as a table for docs/research/results.md.

    python benchmarks/raise.py runs/every/tall_quadruped-0 runs/every/duck-0 --json raise.json

The starts are those of the certificate's criterion 4 with another seed, the same for every column.
`A%, B%`: share that stays up for 22 s, and the mean forward distance over that of the same starts
on the plain floor, up to the fall if there is one. Columns:

- push: sudden change of the trunk's horizontal velocity, in sqrt(g h), that fells half; from any
  side, between 2 and 4 s, 5 s to fall.
- plain: the floor of evolution; share that stays up and speed in body lengths/s.
- bumps: rough ground (docs/reference/ground.md) that rises and falls by at most this share of the
  hip height;
  four of them, a quarter of the starts on each. Other parts than feet may touch it.
- uphill, downhill: steepest slope in degrees on which 90 % stay up and get more than a body length
  forward, all gentler ones included.
- friction, trunk: coefficient of sliding friction 0.4 instead of 0.9; mass and inertia of the trunk
  body 1.3 times as large.
- 10 min: number of ten-minute walks that stay up, of one undisturbed and three perturbed.
- turn at once, turn gently: one undisturbed walk, left / right. The command turns by 90 degrees, at
  once or at 15 degrees a second. s from the command until the heading, mean over a second, comes
  within 15 degrees and stays there for the rest of the 40 s; else the heading at the end.
"""

import argparse
import dataclasses
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mjxgait.certification import CertificateConfig, push_ladder
from mjxgait.certification.certificate import half_point
from mjxgait.certification.config import PushesConfig
from mjxgait.certification.stress import slippery
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.reference.starts import (
    Starts,
    join,
    nominal_starts,
    perturbed_starts,
)
from mjxgait.training.folder import open_champion

SECONDS = 22.0
SEED = 7
BUMPS = (0.02, 0.05, 0.1)
FLOORS = 4
SLOPES = (2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0, 25.0, 30.0)
PUSHES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.2, 1.6)
LONG = 600.0
BEFORE_TURN, TURN_SECONDS, WITHIN = 5.0, 40.0, 15.0
TURNS = {"turn_at_once": np.inf, "turn_gently": 15.0}
"""Rate of the commanded heading in degrees per second."""
HEADER = (
    "run",
    "push",
    "plain",
    "bumps 2%",
    "5%",
    "10%",
    "uphill",
    "downhill",
    "friction 0.4",
    "trunk +30%",
    "10 min",
    "turn at once",
    "turn gently",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--starts", type=int, default=16, help="of each trial; a multiple of four")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    options = parser.parse_args()
    if options.starts % FLOORS:
        parser.error(f"--starts must be a multiple of {FLOORS}")
    print_row(HEADER)
    print_row(["---"] * len(HEADER))
    found = []
    for run in options.runs:
        found.append(
            {"run": run.name} | examine(*open_champion(run), options.starts, note(run.name))
        )
        print_row(cells(found[-1]))
        if options.json:
            options.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def note(run: str) -> Callable[[str], None]:
    """Return a function that prints the current trial to standard error, outside the table."""
    return lambda trial: print(f"{run}: {trial}", file=sys.stderr, flush=True)


def examine(
    creature: Creature, champion: Champion, count: int, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Run all trials of one champion."""
    starts = perturbed_starts(creature, count, np.random.default_rng(SEED))
    tell("plain")
    plain = simulate(creature, champion, starts, SECONDS)
    way = float(plain.travel[:, 0].mean())
    found: dict[str, Any] = {
        "starts": count,
        "plain": {
            "up": share_up(plain),
            "body_lengths_per_second": way / SECONDS / creature.frame.body_length,
        },
    }
    for amplitude in BUMPS:
        tell(f"bumps of {amplitude:.0%}")
        found[f"bumps_{amplitude:g}"] = bearing(bumps(creature, champion, starts, amplitude), way)
    for name, sign in (("uphill", 1), ("downhill", -1)):
        tell(name)
        found[name] = slopes(creature, champion, starts, sign)
    tell("friction, trunk")
    found["friction_0.4"] = bearing(
        [simulate(slippery(creature, 0.4), champion, even_friction(starts), SECONDS)], way
    )
    found["trunk_1.3"] = bearing(
        [simulate(creature, champion, heavier_trunk(creature, starts, 1.3), SECONDS)], way
    )
    for name, rate in TURNS.items():
        tell(name.replace("_", " "))
        found[name] = {
            side: turn(creature, champion, angle, rate)
            for side, angle in (("left", 90.0), ("right", -90.0))
        }
    tell("pushes")
    found["push"] = pushes(creature, champion, count)
    tell("ten minutes")
    found["ten_minutes"] = long_walk(creature, champion, starts)
    return found


def share_up(*outcomes: Outcome) -> float:
    return float(np.concatenate([outcome.stayed_up for outcome in outcomes]).mean())


def bearing(outcomes: Sequence[Outcome], way: float) -> dict[str, float]:
    """Share that stays up, and forward distance over that on the plain floor, `way` in m."""
    travel = np.concatenate([outcome.travel[:, 0] for outcome in outcomes])
    return {"up": share_up(*outcomes), "distance": float(travel.mean() / way)}


def bumps(
    creature: Creature, champion: Champion, starts: Starts, amplitude: float
) -> list[Outcome]:
    """Simulate an equal share of the starts on each floor; amplitude: hip heights."""
    floors = [creature.on(f"rough:{amplitude:g}@{SEED + i}") for i in range(FLOORS)]
    shares = [starts.rows(np.arange(i, len(starts), FLOORS)) for i in range(FLOORS)]
    return [
        simulate(floor, champion, share, SECONDS, fall=Fall(touch=False))
        for floor, share in zip(floors, shares, strict=True)
    ]


def slopes(creature: Creature, champion: Champion, starts: Starts, sign: int) -> dict[str, Any]:
    """Try ever steeper slopes, up to the first that too few manage."""
    managed, steepest = {}, 0.0
    for degrees in SLOPES:
        outcome = simulate(creature, champion, sloping(creature, starts, sign * degrees), SECONDS)
        share = float(
            (outcome.stayed_up & (outcome.travel[:, 0] > creature.frame.body_length)).mean()
        )
        managed[f"{degrees:g}"] = {"managed": share, "forward": float(outcome.travel[:, 0].mean())}
        if share < 0.9:
            break
        steepest = degrees
    return {"degrees": steepest, "tried": managed}


def sloping(creature: Creature, starts: Starts, degrees: float) -> Starts:
    rise = np.radians(degrees) * creature.frame.start_axes[0][:2]
    return dataclasses.replace(starts, slope=np.tile(rise, (len(starts), 1)))


def even_friction(starts: Starts) -> Starts:
    return dataclasses.replace(starts, friction=np.ones(len(starts)))


def heavier_trunk(creature: Creature, starts: Starts, factor: float) -> Starts:
    mass = starts.mass.copy()
    mass[:, creature.trunk] *= factor
    return dataclasses.replace(starts, mass=mass)


def turn(creature: Creature, champion: Champion, degrees: float, rate: float) -> dict[str, Any]:
    """Walk straight, then command another heading, approached at `rate` degrees/s."""
    time_step = creature.model.opt.timestep
    before, steps = round(BEFORE_TURN / time_step), round((BEFORE_TURN + TURN_SECONDS) / time_step)
    since = np.maximum(np.arange(steps) - before + 1, 0) * time_step
    asked = (
        np.where(since > 0, abs(degrees), 0.0)
        if np.isinf(rate)
        else np.minimum(since * rate, abs(degrees))
    )
    commanded = np.sign(degrees) * np.radians(asked)
    outcome = simulate(
        creature,
        champion,
        nominal_starts(creature, 1),
        steps * time_step,
        record=1,
        heading=commanded,
    )
    width = round(1 / time_step)
    mean = np.convolve(
        np.degrees(headings(creature, outcome.trajectory.qpos[0])),
        np.full(width, 1 / width),
        "valid",
    )[before:]
    # NaN, from a diverged simulation, counts as off.
    off = np.flatnonzero(~(np.abs(mean - degrees) <= WITHIN))
    arrived = int(off[-1]) + 1 if len(off) else 0
    reached = bool(outcome.stayed_up[0]) and arrived < len(mean)
    return {
        "reached": reached,
        # A mean over a second is complete at its end.
        "seconds": arrived * time_step + 1.0 if reached else None,
        "fell": float(outcome.fell[0] - BEFORE_TURN) if not outcome.stayed_up[0] else None,
        "heading_at_end": float(mean[-1]) if np.isfinite(mean[-1]) else None,
    }


def headings(creature: Creature, qpos: np.ndarray) -> np.ndarray:
    """[T] rad, left positive, without jumps, from positions [T, nq]."""
    data = mujoco.MjData(creature.model)
    forward, left = (
        creature.frame.stand_rot @ creature.frame.forward,
        creature.frame.stand_rot @ creature.frame.left,
    )
    angle = np.full(len(qpos), np.nan)
    for k in np.flatnonzero(np.isfinite(qpos).all(1)):
        data.qpos[:] = qpos[k]
        mujoco.mj_kinematics(creature.model, data)
        nose = data.xmat[creature.trunk].reshape(3, 3) @ creature.frame.forward
        angle[k] = np.arctan2(nose @ left, nose @ forward)
    return np.unwrap(angle)


def pushes(creature: Creature, champion: Champion, count: int) -> dict[str, Any]:
    config = CertificateConfig(seed=SEED, pushes=PushesConfig(ladder=PUSHES, ladder_count=count))
    shares = push_ladder(creature, champion, config)
    return {
        "fells_half": half_point({0.0: 1.0} | shares),
        "up": {f"{speed:g}": share for speed, share in shares.items()},
    }


def long_walk(creature: Creature, champion: Champion, starts: Starts) -> dict[str, Any]:
    outcome = simulate(
        creature, champion, join(nominal_starts(creature, 1), starts.rows(slice(0, 3))), LONG
    )
    return {
        "up": int(outcome.stayed_up.sum()),
        "of": len(outcome.fell),
        "fell": [float(t) if np.isfinite(t) else None for t in outcome.fell],
        "forward": outcome.travel[:, 0].tolist(),
    }


def cells(found: dict[str, Any]) -> list[str]:
    """Return one row of the table."""

    def borne(name: str) -> str:
        return f"{found[name]['up']:.0%}, {found[name]['distance']:.0%}"

    def turned(result: dict[str, Any]) -> str:
        if result["reached"]:
            return f"{result['seconds']:.1f} s"
        return (
            f"falls after {result['fell']:.1f} s"
            if result["fell"] is not None
            else f"no, {result['heading_at_end']:.0f}°"
        )

    half = found["push"]["fells_half"]
    return [
        found["run"],
        f"{half:.2f}" if half is not None else f"> {PUSHES[-1]:g}",
        f"{found['plain']['up']:.0%}, {found['plain']['body_lengths_per_second']:.2f}/s",
        *(borne(f"bumps_{amplitude:g}") for amplitude in BUMPS),
        *(f"{found[name]['degrees']:g}°" for name in ("uphill", "downhill")),
        borne("friction_0.4"),
        borne("trunk_1.3"),
        f"{found['ten_minutes']['up']} of {found['ten_minutes']['of']}",
        *(f"{turned(found[name]['left'])} / {turned(found[name]['right'])}" for name in TURNS),
    ]


def print_row(row: Sequence[str]) -> None:
    print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
