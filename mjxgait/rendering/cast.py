"""Individuals to show: champions of runs, the best of a population, or the best of several
generations.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from mjxgait.rendering.video import Runner, spoken
from mjxgait.rendering.walk import Walk, record_walk
from mjxgait.training.folder import open_champion

LOOP_SECONDS = 12.0
"""Simulated time to find a steady stride; shared, so that all outputs show the same stride."""


def champion_of(run: Path, seconds: float) -> Runner:
    """Return the run's champion."""
    return Runner(record_walk(*open_champion(run), seconds))


def champions_of(runs: Sequence[Path], seconds: float) -> list[Runner]:
    """Return each run's champion, labelled by creature, or by folder if creatures repeat."""
    walks = [champion_of(run, seconds).walk for run in runs]
    names = [spoken(walk) for walk in walks]
    for others in ([run.resolve().name for run in runs], [str(run) for run in runs]):
        names = names if len(set(names)) == len(names) else others
    return [Runner(walk, name) for walk, name in zip(walks, names, strict=True)]


def top_of(run: Path, count: int, seconds: float) -> list[Runner]:
    """Return the best of the latest population, best first.

    Raises:
      UserError: the population is smaller.
    """
    return [
        Runner(walk, f"rank {rank}")
        for rank, walk in _walks(run, None, range(1, count + 1), seconds)
    ]


def through_generations(run: Path, generations: Sequence[int], seconds: float) -> list[Runner]:
    """Return the best of each of these generations.

    Raises:
      UserError: there is no checkpoint of one of them.
    """
    return in_generations(run, dict.fromkeys(generations, 0), seconds)


def in_generations(run: Path, places: Mapping[int, int], seconds: float) -> list[Runner]:
    """Return one individual per generation, given by its place; 0 is the best.

    Raises:
      UserError: there is no checkpoint of one of them.
    """
    return [
        Runner(walk, f"generation {generation}")
        for generation, place in places.items()
        for _, walk in _walks(run, generation, range(place + 1, place + 2), seconds)
    ]


def _walks(
    run: Path, generation: int | None, ranks: range, seconds: float
) -> Iterator[tuple[int, Walk]]:
    from mjxgait.inspect.snapshot import read_snapshot

    snapshot = read_snapshot(run, generation)
    for rank, champion in [(rank, snapshot.champion(rank)) for rank in ranks]:
        yield rank, record_walk(champion.embodied(snapshot.creature), champion, seconds)
