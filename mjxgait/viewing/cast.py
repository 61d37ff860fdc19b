"""Who is shown: the champion of a run, the best of its population, or the best of several
generations.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mjxgait.champion import Champion, read_champion
from mjxgait.errors import UserError
from mjxgait.runs.folder import CHAMPION, open_run
from mjxgait.viewing.video import Runner
from mjxgait.viewing.walk import record_walk

LOOP_SECONDS = 12.0
"""Simulated to find a steady stride."""


def champion_of(run: Path, seconds: float) -> Runner:
    """The run's champion."""
    creature, _ = open_run(run)
    return Runner(record_walk(creature, read_champion(run / CHAMPION, creature), seconds))


def top_of(run: Path, count: int, seconds: float) -> list[Runner]:
    """The best of the latest population, best first.

    Raises:
      UserError: there are not so many.
    """
    return [
        Runner(walk, f"rank {rank}")
        for rank, walk in _walks(run, None, range(1, count + 1), seconds)
    ]


def through_generations(run: Path, generations: Sequence[int], seconds: float) -> list[Runner]:
    """The best of each of these generations.

    Raises:
      UserError: there is no checkpoint of one of them.
    """
    return [
        Runner(walk, f"generation {generation}")
        for generation in generations
        for _, walk in _walks(run, generation, range(1, 2), seconds)
    ]


def _walks(run: Path, generation: int | None, ranks: range, seconds: float):
    from mjxgait.control.poses import TUNING
    from mjxgait.inspect.snapshot import read_snapshot

    snapshot = read_snapshot(run, generation)
    if ranks[-1] > len(snapshot.fitness):
        raise UserError(
            f"{run}: no individual {ranks[-1]}; the population has ranks 1 to "
            f"{len(snapshot.fitness)}"
        )
    for rank in ranks:
        i = rank - 1
        individual = Champion(
            creature=snapshot.creature.name,
            digest=snapshot.creature.digest,
            key_poses=np.asarray(snapshot.key_poses[i], float),
            tuning=dict(zip(TUNING, map(float, snapshot.tuning[i]), strict=True)),
            controller=snapshot.config.controller,
            fitness=float(snapshot.fitness[i]),
            terms={},
            origin={"generation": snapshot.generation},
        )
        yield rank, record_walk(snapshot.creature, individual, seconds)
