"""Exchange between islands, and their union, on packed states; no program is needed for it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mjxgait.config.islands import IslandsConfig
from mjxgait.training.folder import MOTHERS
from mjxgait.training.packed import Packed

OF_EACH = ("terms", "outcome", "fitness", "born", "origin", "rounds")
"""Arrays [P, ...] of a state, besides those of the genomes."""
SUMS = ("failures", "episodes", "evaluations", "sim_steps", "computed_steps", "unique")
MEANS = ("mean", "median", "lower_quartile", "upper_quartile", "spread")
"""Metrics summed or averaged over the islands; the other metrics are those of the best one."""


def exchanged(states: Sequence[Packed], config: IslandsConfig) -> list[Packed]:
    """Return the states after each island's best have replaced the worst of others.

    All states are of the same generation. Individuals evaluated on easier trials than an island's
    do not migrate to it.
    """
    found = [_individuals(state.arrays) for state in states]

    def come(island: int) -> list[dict[str, np.ndarray]]:
        least = _level(states[island])
        sources = [i for i in config.sources(island) if _level(states[i]) >= least]
        return [_first(found[i], config.migrants) for i in sources]

    return [_taken_in(state, come(island)) for island, state in enumerate(states)]


def gathered(states: Sequence[Packed]) -> Packed:
    """Return the best of all islands as one population of the same size.

    All else is the best island's. Of islands whose trials differ in difficulty, only those with the
    hardest count.
    """
    hardest = max(map(_level, states))
    states = [state for state in states if _level(state) == hardest]
    leader = int(np.nanargmax([_comparable(state.arrays["fitness"])[0] for state in states]))
    size = len(states[leader].arrays["fitness"])
    found = [_individuals(state.arrays) for state in states]
    return states[leader].with_arrays(_sorted(_joined(found), size))


def together(lines: Sequence[Mapping[str, Any]], seconds: float) -> dict[str, Any]:
    """Return one metrics line for all islands; `island` is the index of the best one.

    seconds: of all islands for a generation, compilation included. Islands that took turns took
    the sum of their own times, which exclude it.
    """
    bests = [-np.inf if line["best"] is None else line["best"] for line in lines]
    leader = int(np.argmax(bests))
    line = dict(lines[leader]) | {"island": leader}
    # A migrant has no mother on this island.
    line.pop(MOTHERS, None)
    line |= {name: sum(each[name] for each in lines) for name in SUMS}
    for name in MEANS:
        known = [each[name] for each in lines if each[name] is not None]
        line[name] = float(np.mean(known)) if known else None
    worst = [each["worst"] for each in lines if each["worst"] is not None]
    line["worst"] = min(worst, default=None)
    line["forced"] = any(each["forced"] for each in lines)
    line["wall_s"] = round(min(seconds, sum(each["wall_s"] for each in lines)), 4)
    line["steps_per_second"] = round(line["sim_steps"] / max(line["wall_s"], 1e-9))
    return line


def _taken_in(state: Packed, migrants: Sequence[Mapping[str, np.ndarray]]) -> Packed:
    """Replace the worst of a population by migrants, at most half of it; sort best first."""
    if not migrants:
        return state
    size = len(state.arrays["fitness"])
    come = _sorted(_joined(migrants), size // 2)
    stay = _first(_individuals(state.arrays), size - len(come["fitness"]))
    return state.with_arrays(_sorted(_joined([stay, come]), size))


def _level(state: Packed) -> int:
    """Number of times that the trials have become harder."""
    return int(state.arrays.get("level", 0))


def _individuals(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {
        name: array
        for name, array in arrays.items()
        if name in OF_EACH or name.partition(".")[0] == "genomes"
    }


def _first(arrays: Mapping[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    return {name: array[:count] for name, array in arrays.items()}


def _joined(parts: Sequence[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _sorted(arrays: Mapping[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """Return the best `count`, best first; ties keep their order."""
    order = np.argsort(-_comparable(arrays["fitness"]), kind="stable")[:count]
    return {name: array[order] for name, array in arrays.items()}


def _comparable(fitness: np.ndarray) -> np.ndarray:
    return np.where(np.isnan(fitness), -np.inf, fitness)
