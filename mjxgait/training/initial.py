"""The last populations of earlier runs as the first of a new one.

The new run keeps it in its folder, so that it begins again without the earlier runs.
"""

import dataclasses
from collections.abc import Container, Mapping, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.evolution.state import EvolutionState
from mjxgait.files import DamagedFile
from mjxgait.training.checkpoint import first_difference
from mjxgait.training.disk import disk_errors
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.folder import open_run
from mjxgait.training.npz import read_arrays, write_arrays
from mjxgait.training.stored import read_stored, stored_generations
from mjxgait.types import by_name

INITIAL = "initial.npz"
"""File in a run folder: the arrays [N, ...] of these genomes by dotted name. Those that the earlier
task did not use are missing and stay as drawn."""
GENOMES = "genomes."
MAX_BYTES = 1_000_000_000
"""Largest size of the arrays in bytes."""

Genomes = Mapping[str, np.ndarray]
Shapes = dict[str, tuple[int, ...]]
"""Shape of each array of a genome by dotted name."""


@dataclasses.dataclass(frozen=True)
class Initial:
    """Genomes of the last checkpoint of a run, or of several, without those that have no fitness.

    Attributes:
      source: folder of that run, or of the first. controller, reads: its controller and what that
        observes. joints: names of the body's joints; empty for bodies that grow. meaning: see
        `_meaning_of`.
      genomes: best first; of several runs first the best of each, then each second best.
    """

    source: Path
    controller: str
    reads: tuple[str, ...]
    joints: tuple[str, ...]
    meaning: Mapping[str, object]
    genomes: Genomes


def initial_of(source: Path) -> Initial:
    """Return the population of a run's latest checkpoint.

    Raises:
      UserError: no run, no intact checkpoint, or no individual with a fitness.
    """
    creature, config = open_run(source)
    arrays = read_stored(source, creature.digest).arrays
    alive = np.isfinite(arrays["fitness"])
    if not alive.any():
        raise UserError(
            f"{source}: no individual of its last checkpoint has a fitness; take a run with more "
            "generations"
        )
    found = {k.removeprefix(GENOMES): v[alive] for k, v in arrays.items() if k.startswith(GENOMES)}
    controller = build_experiment(creature, config).simulator.controller
    for observation, names in _genes_of(controller).items():
        if observation not in controller.reads:
            found = {k: array for k, array in found.items() if not k.startswith(tuple(names))}
    return Initial(
        source,
        config.use.controller,
        tuple(controller.reads),
        _joints(creature),
        _meaning_of(controller),
        found,
    )


def united(sources: Sequence[Path]) -> Initial:
    """Return the populations of several runs of one creature; of equal genomes one.

    Raises:
      UserError: see `initial_of`.
    """
    each = [initial_of(source) for source in sources]
    rows = [_different(one.genomes) for one in each]
    ranked = sorted((rank, run) for run, own in enumerate(rows) for rank in range(len(own)))
    genomes = {
        name: np.stack([each[run].genomes[name][rows[run][rank]] for rank, run in ranked])
        for name in each[0].genomes
    }
    return dataclasses.replace(each[0], genomes=genomes)


def _different(genomes: Genomes) -> list[int]:
    """Return the places of genomes that differ from all before them."""
    count = len(next(iter(genomes.values())))
    rows = [b"".join(array[i].tobytes() for array in genomes.values()) for i in range(count)]
    return [i for i, row in enumerate(rows) if row not in rows[:i]]


def check_initial(initial: Initial, experiment: Experiment) -> None:
    """Refuse genomes that mean something else in another run, or fit nowhere in it.

    Raises:
      UserError: names the difference.
    """
    controller, use = experiment.simulator.controller, experiment.config.use
    if initial.controller != use.controller:
        raise UserError(
            f"{initial.source}: its controller is {initial.controller}, that of the new run "
            f"{use.controller}; give the new run --use.controller {initial.controller}"
        )
    if initial.joints != _joints(experiment.creature):
        raise UserError(
            f"{initial.source}: its body has other joints than the new run's; take a run of the "
            "same body"
        )
    if initial.joints and set(initial.reads) != set(controller.reads):
        raise UserError(
            f"{initial.source}: its controller observes {', '.join(initial.reads)}, that of the "
            f"new run {', '.join(controller.reads)}; take a run with the same observations"
        )
    for setting, value in _meaning_of(controller).items():
        if (other := initial.meaning.get(setting)) != value:
            raise UserError(
                f"{initial.source}: its genomes are of {setting} = {other}, those of the new run "
                f"of {value}, and would mean something else; give the new run --{setting} {other}"
            )
    wanted, found = _shapes(by_name(experiment.abstract().genomes)), _shapes(initial.genomes)
    wanted = _without_idle(wanted, found, controller)
    if name := first_difference(found, wanted):
        raise UserError(
            f"{initial.source}: its genomes have {name} of shape {found.get(name, 'none')}, "
            f"the new run's {wanted.get(name, 'none')}; evolve both with the same settings of the "
            "controller"
        )


def has_begun(folder: Path) -> bool:
    """Return whether a run has its first individuals."""
    return (folder / INITIAL).exists() or bool(stored_generations(folder))


def keep_initial(folder: Path, initial: Initial) -> None:
    """Write the genomes into a run folder."""
    with disk_errors(folder):
        write_arrays(folder / INITIAL, initial.genomes)


def read_initial(folder: Path) -> Genomes | None:
    """Return the genomes that a run began with; None if they were drawn.

    Raises:
      UserError: the file is damaged.
    """
    path = folder / INITIAL
    return read_arrays(path, MAX_BYTES) if path.exists() else None


def planted(state: EvolutionState, genomes: Genomes, controller: object = None) -> EvolutionState:
    """Replace the first individuals of an unevaluated population [P]; the rest stays drawn.

    controller: of the run; arrays that it needs for one observation alone may be missing.

    Raises:
      UserError: the genomes have other shapes.
    """
    own = by_name(state.genomes)
    if _without_idle(_shapes(own), genomes, controller) != _shapes(genomes):
        raise DamagedFile(f"{INITIAL}: its genomes do not fit the settings of this run")
    count = min(len(state.fitness), *(len(array) for array in genomes.values()))
    for name, array in genomes.items():
        own[name] = own[name].at[:count].set(jnp.asarray(array[:count], own[name].dtype))
    made = jax.tree.unflatten(jax.tree.structure(state.genomes), own.values())
    return dataclasses.replace(state, genomes=made)


def _genes_of(controller: object) -> Mapping[str, Sequence[str]]:
    """Return the beginnings of names of a genome's arrays that do nothing without an observation.

    Only bodies that grow have some: their tasks differ in what a brain observes.
    """
    found: Mapping[str, Sequence[str]] = getattr(controller, "genes_of", {})
    return found


def _meaning_of(controller: object) -> Mapping[str, object]:
    """Return the settings, by dotted name, without which a genome of one shape is ambiguous."""
    found: Mapping[str, object] = getattr(controller, "meaning", {})
    return found


def _without_idle(shapes: Shapes, found: Container[str], controller: object) -> Shapes:
    """Return the shapes without those that are not found and do nothing without an observation."""
    idle = tuple(name for names in _genes_of(controller).values() for name in names)
    return {k: shape for k, shape in shapes.items() if k in found or not k.startswith(idle)}


def _joints(creature: Creature) -> tuple[str, ...]:
    return () if creature.settings.creature.grows else tuple(creature.joints.names)


def _shapes(arrays: Mapping[str, np.ndarray | jax.ShapeDtypeStruct]) -> Shapes:
    return {name: tuple(array.shape[1:]) for name, array in arrays.items()}
