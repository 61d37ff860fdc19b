"""One checkpoint and its run, read back as NumPy arrays independently of the devices that wrote it.

Letters: `P` individuals, `R` starts, `F` fitness terms.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from mjxgait.champion import Champion, serializer_of, split_genome
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.files import read_json
from mjxgait.training.ended import end_of
from mjxgait.training.folder import CHAMPION, CONFIG, METRICS, kept_champion, open_run
from mjxgait.training.logs import Line, read_metrics
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
    """An intact checkpoint and its run.

    arrays: of the state, by dotted name. lines: of the metrics, up to this generation. generations:
    those with a checkpoint. versions: of the packages that wrote the run's champion. written: s
    since the epoch. size: bytes on disk.
    """

    run: Path
    manifest: Manifest
    creature: Creature
    config: Config
    arrays: Mapping[str, np.ndarray]
    lines: Sequence[Line]
    generations: Sequence[int]
    versions: Mapping[str, str]
    written: float
    size: int

    @property
    def generation(self) -> int:
        """Generation after which the checkpoint was written."""
        return self.manifest.generation

    @property
    def genomes(self) -> dict[str, np.ndarray]:
        """The controller's arrays [P, ...] by name, best individual first."""
        return split_genome(self._every_gene)[0]

    @property
    def _every_gene(self) -> dict[str, np.ndarray]:
        """The arrays of `genomes` and, if bodies evolve, their sizes."""
        named = ((name.partition("."), array) for name, array in self.arrays.items())
        return {rest: array for (room, _, rest), array in named if room == "genomes"}

    @property
    def rows(self) -> np.ndarray:
        """Genes [P, genes] of all genomes, each in its own unit; without those of an opponent."""
        own = {n: a for n, a in self._every_gene.items() if not n.startswith("opponent.")}
        flat = [array.reshape(len(array), -1) for array in own.values()]
        return np.concatenate(flat, axis=1)

    def champion(self, rank: int) -> Champion:
        """Return an individual; rank 1 is the best.

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
        """Fitness [P], best first."""
        return self.arrays["fitness"]

    @property
    def ended(self) -> str | None:
        """Reason why the run ends at this checkpoint; None if it continues."""
        return end_of(self.run, self.creature, self.config, Stored(self.manifest, self.arrays))

    @cached_property
    def trouble(self) -> str | None:
        """Reason why the run's champion cannot be read; None if it can, or does not exist yet."""
        if not (self.run / CHAMPION).exists():
            return None
        try:
            kept_champion(self.run, self.creature)
        except UserError as error:
            return str(error)
        return None


def read_snapshot(path: Path, generation: int | None = None) -> Snapshot:
    """Return the checkpoint of a run folder (the latest, or that of `generation`), or the one at a
    path.

    Raises:
      UserError: not a run or checkpoint, or a damaged or foreign one; says which and names the
        newest intact one.
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


def _lines(path: Path, last: int) -> list[Line]:
    """Metrics up to a generation; none if the file is foreign, since the checkpoint alone is still
    useful.
    """
    try:
        return [line for line in read_metrics(path) if line["generation"] <= last]
    except UserError:
        return []


def _locate(path: Path, generation: int | None) -> tuple[Path, int | None]:
    """Run folder, and the generation that the path itself names."""
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
    shapes = serializer_of(config.use.controller).shapes(config.controller, creature)
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
    """Return the number of genomes in both populations."""
    mine, other = ({row.tobytes() for row in s.rows} for s in (a, b))
    return len(mine & other)
