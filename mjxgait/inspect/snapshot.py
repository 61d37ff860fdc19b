"""One checkpoint read back as NumPy arrays, whatever devices wrote it, together with the run it
belongs to.

Letters: `P` individuals, `R` starts, `F` fitness terms.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.champion import Champion, codec_of, split_genome
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.files import read_json
from mjxgait.training.ended import end_of
from mjxgait.training.folder import (
    CHAMPION,
    CONFIG,
    METRICS,
    kept_champion,
    open_run,
    read_metrics,
)
from mjxgait.training.stored import (
    FOLDER,
    Manifest,
    Stored,
    is_number,
    read_stored,
    stored_generations,
)


@dataclasses.dataclass(frozen=True, eq=False)
class Snapshot:
    """A checkpoint that is whole, and its run.

    arrays: of the state, by dotted name. lines: of the metrics, up to this generation. generations:
    there are checkpoints of.
    versions: of the packages that wrote the run's champion. written: s since the epoch. size: bytes
    on disk.
    """

    run: Path
    manifest: Manifest
    creature: Creature
    config: Config
    arrays: Mapping[str, np.ndarray]
    lines: Sequence[Mapping[str, Any]]
    generations: Sequence[int]
    versions: Mapping[str, str]
    written: float
    size: int

    @property
    def generation(self) -> int:
        """That the checkpoint was written after."""
        return self.manifest.generation

    @property
    def genomes(self) -> dict[str, np.ndarray]:
        """The controller's arrays [P, ...] by name, best individual first."""
        return split_genome(self._every_gene)[0]

    @property
    def _every_gene(self) -> dict[str, np.ndarray]:
        """The arrays of `genomes` and, where bodies evolve, their sizes."""
        named = ((name.partition("."), array) for name, array in self.arrays.items())
        return {rest: array for (room, _, rest), array in named if room == "genomes"}

    @property
    def rows(self) -> np.ndarray:
        """[P, genes] every gene of every genome, in its own unit."""
        flat = [array.reshape(len(array), -1) for array in self._every_gene.values()]
        return np.concatenate(flat, axis=1)

    def champion(self, rank: int) -> Champion:
        """An individual; rank 1 is the best.

        Raises:
          UserError: the population is smaller.
        """
        if not 1 <= rank <= len(self.fitness):
            raise UserError(
                f"{self.run}: no individual {rank}; the population has ranks 1 to "
                f"{len(self.fitness)}"
            )
        return Champion.of(
            self.creature,
            self.config,
            {name: np.asarray(a[rank - 1], float) for name, a in self._every_gene.items()},
            fitness=float(self.fitness[rank - 1]),
            terms={},
            origin={"generation": self.generation},
        )

    @property
    def fitness(self) -> np.ndarray:
        """[P], best first."""
        return self.arrays["fitness"]

    @property
    def ended(self) -> str | None:
        """Why the run is over at this checkpoint; None when it was to go on."""
        return end_of(self.run, self.creature, self.config, Stored(self.manifest, self.arrays))

    @cached_property
    def trouble(self) -> str | None:
        """Why the run's champion cannot be read; None where it can, or there is none yet."""
        if not (self.run / CHAMPION).exists():
            return None
        try:
            kept_champion(self.run, self.creature)
        except UserError as error:
            return str(error)
        return None


def read_snapshot(path: Path, generation: int | None = None) -> Snapshot:
    """The checkpoint of a run folder (the latest, or that of `generation`), or the one at a path.

    Raises:
      UserError: not a run or checkpoint, or a damaged or foreign one; says which and names the
        newest that is intact.
    """
    run, generation = _locate(path, generation)
    creature, config = open_run(run)
    stored = read_stored(run, creature.digest, generation)
    folder = run / FOLDER / str(stored.manifest.generation)
    _check_shape(folder, stored.arrays, creature, config)
    files = [file for file in folder.rglob("*") if file.is_file()]
    return Snapshot(
        run=run,
        manifest=stored.manifest,
        creature=creature.spanned(config.evolution.pose_span),
        config=config,
        arrays=stored.arrays,
        lines=_lines(run / METRICS, stored.manifest.generation),
        generations=stored_generations(run),
        versions=_versions(run),
        written=folder.stat().st_mtime,
        size=sum(file.stat().st_size for file in files),
    )


def _lines(path: Path, last: int) -> list[dict[str, Any]]:
    """The metrics up to a generation; none where the file is not one of ours: the checkpoint is
    still worth telling of.
    """
    try:
        return [line for line in read_metrics(path) if line["generation"] <= last]
    except UserError:
        return []


def _locate(path: Path, generation: int | None) -> tuple[Path, int | None]:
    """The run folder, and the generation that the path itself names."""
    if not path.exists():
        raise UserError(f"{path}: no such folder")
    if (path / CONFIG).is_file():
        return path, generation
    path = path.resolve()
    if path.name == FOLDER and (path.parent / CONFIG).is_file():
        return path.parent, generation
    if is_number(path.name) and path.parent.name == FOLDER:
        run = path.parent.parent
        if not (run / CONFIG).is_file():
            raise UserError(
                f"{path}: a checkpoint without its run; keep {CONFIG} and the creature folder "
                f"beside {FOLDER}/"
            )
        if generation is not None and generation != int(path.name):
            raise UserError(
                f"{path}: is generation {path.name}; for generation {generation} name the run "
                f"folder {run}"
            )
        return run, int(path.name)
    raise UserError(
        f"{path}: neither a run folder (it has no {CONFIG}) nor one of its checkpoints; `mjxgait "
        "train` makes one"
    )


def _check_shape(
    folder: Path, arrays: Mapping[str, np.ndarray], creature: Creature, config: Config
) -> None:
    shapes = codec_of(config.use.controller).shapes(config.controller, creature)
    prefix = "genomes." if config.evolution.body == 1.0 else "genomes.plan."
    for name, shape in shapes.items():
        wanted = (config.evolution.population, *shape)
        found = arrays[prefix + name].shape if prefix + name in arrays else None
        if found != wanted:
            raise UserError(
                f"{folder}: holds {name.replace('_', ' ')} of shape {found}, this run's "
                f"{CONFIG} asks for {wanted}; one of the two is from another run"
            )


def _versions(run: Path) -> dict[str, str]:
    try:
        return dict(read_json(run / CHAMPION)["origin"]["versions"])
    except (UserError, ValueError, LookupError, TypeError):
        return {}


def shared(a: Snapshot, b: Snapshot) -> int:
    """How many genomes are in both populations."""
    mine, other = ({row.tobytes() for row in s.rows} for s in (a, b))
    return len(mine & other)
