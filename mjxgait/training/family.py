"""Record of the bodies that were born in each generation of a run, for bodies that grow.

A run that logs parents (`evolution.lineage`) writes one file per generation into RUN/family. Parents
are in `metrics.jsonl`. Evolution reads neither.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mjxgait.evolution.state import EvolutionState
from mjxgait.files import DamagedFile
from mjxgait.training.disk import disk_errors
from mjxgait.training.npz import read_arrays, write_arrays
from mjxgait.types import by_name

FAMILY = "family"
"""Folder in a run."""
GRAPH_PREFIX = "graph."
"""Beginning of the names of the arrays that a body grows from."""
OF_EACH = {"places", "origin", "fitness"}
"""Names of the arrays [n] of a file besides those of the bodies."""
MAX_BYTES = 100_000_000
"""Largest size of a file's arrays in bytes."""


@dataclasses.dataclass(frozen=True, eq=False)
class Newborns:
    """Those of a population that were born in its generation, best first.

    places: [n] in the population. origin: [n] an `Origin`. fitness: [n] in that generation. bodies:
    arrays [n, ...] that the bodies grow from, by dotted name.
    """

    places: np.ndarray
    origin: np.ndarray
    fitness: np.ndarray
    bodies: Mapping[str, np.ndarray]


def newborns_of(state: EvolutionState) -> Newborns | None:
    """Return the newborns of a state on this side of the device; None for bodies that do not grow.

    The first population, and each that a run draws anew, counts as born.
    """
    bodies = {n: a for n, a in by_name(state.genomes).items() if n.startswith(GRAPH_PREFIX)}
    if not bodies:
        return None
    (born,) = np.nonzero(np.asarray(state.born) == int(state.generation))
    return Newborns(
        born,
        np.asarray(state.origin)[born],
        np.asarray(state.fitness)[born],
        {name: np.asarray(array)[born] for name, array in bodies.items()},
    )


def keep_newborns(run: Path, state: EvolutionState) -> None:
    """Write the newborns of a generation, if bodies grow.

    They are written before the checkpoint of their generation, as the log is: a kill in between
    leaves surplus files, which a resumed run removes.
    """
    found = newborns_of(state)
    if found is None:
        return
    given = {"places": found.places, "origin": found.origin, "fitness": found.fitness}
    folder = run / FAMILY
    with disk_errors(folder):
        folder.mkdir(exist_ok=True)
        write_arrays(_file(run, int(state.generation)), {**given, **found.bodies})


def drop_newborns(run: Path, generation: int) -> None:
    """Remove the files after a generation, because a resumed run writes them again."""
    for path in (run / FAMILY).glob("*.npz"):
        if path.stem.isdecimal() and int(path.stem) > generation:
            path.unlink()


def read_newborns(run: Path, generation: int) -> Newborns | None:
    """Return the newborns of a generation; None where none were recorded.

    Raises:
      UserError: the file is damaged.
    """
    path = _file(run, generation)
    if not path.exists():
        return None
    try:
        arrays = read_arrays(path, MAX_BYTES)
    except DamagedFile as error:
        raise DamagedFile(f"{error}; delete it, and the tree ends there") from None
    bodies = {name: array for name, array in arrays.items() if name.startswith(GRAPH_PREFIX)}
    lengths = {array.shape[:1] for array in arrays.values()}
    if not bodies or not arrays.keys() >= OF_EACH or len(lengths) != 1:
        raise DamagedFile(f"{path}: its arrays do not fit each other; delete it")
    return Newborns(**{name: arrays[name] for name in OF_EACH}, bodies=bodies)


def _file(run: Path, generation: int) -> Path:
    return run / FAMILY / f"{generation}.npz"
