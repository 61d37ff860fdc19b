"""Plan of a study: its checked file, as variants with the full config of every run."""

import contextlib
import dataclasses
import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic

from mjxgait.config.evolution import AncestorsConfig
from mjxgait.config.layers import data_folder, find_file
from mjxgait.config.schema import Config, GroundText, Physics
from mjxgait.config.tables import (
    STRICT,
    Count,
    Finite,
    Seed,
    Table,
    Whole,
    as_table,
    build,
    merge,
    not_none,
    read_toml,
)
from mjxgait.creature import Creature
from mjxgait.creature.ground.spec import FLAT
from mjxgait.errors import UserError
from mjxgait.plugins import resolve_config
from mjxgait.tasks.walk.targets import WalkTargets, with_targets
from mjxgait.training.folder import check_parts

Measure = Literal["walk", "up", "certified", "fitness", "area", "generations"]


@dataclasses.dataclass(frozen=True)
class VariantTable:
    """One variant: its name, the config keys that it changes, and its own generations, if any.

    config: file or name of a shipped config, used instead of the study's config and base.
    gait: target gait, as in `train --gait`.
    """

    __pydantic_config__ = STRICT
    name: Annotated[str, pydantic.Field(min_length=1, max_length=60)]
    settings: dict[str, Any] = dataclasses.field(default_factory=dict)
    generations: Count | None = None
    config: str | None = None
    gait: str | None = None


@dataclasses.dataclass(frozen=True)
class Study:
    """A study file.

    Attributes:
      question: the study's question; the report's title.
      env: creature. config: file or name of a shipped config, laid under the variants.
      seeds: number of seeds, from first_seed on. generations: of every run.
      measure: measure that compares the variants (docs/research/ablations.md). threshold: fitness
        to reach,
        for the measure `generations`.
      certify: whether every run's champion is examined for its certificate, about 10 s for each
        that may pass.
      grounds: grounds on which every champion is tested, whatever it evolved on
        (docs/reference/ground.md);
        `walk`, `up` and `certified` use the first; each further one has its own table.
      paired: whether all variants use the same seeds; else each has its own.
      allow_equal: whether two variants may be equal, as in a test of the method itself.
      rows: number of runs of one shape side by side in one program; 0: all, best on one machine. On
        a cluster, the runs per job. The fast step's last bits may depend on the other rows.
      physics: of all runs, as in `train --physics`; by default as in the settings.
      base: config keys of all variants.
      variant: variants; the first is the base of the comparisons. grid: dotted config keys and
        their values, instead of variants.
    """

    __pydantic_config__ = STRICT
    question: str
    env: str = "tall_quadruped"
    config: str | None = None
    seeds: Annotated[int, pydantic.Field(ge=2)] = 16
    first_seed: Seed = 0
    generations: Count = 30
    measure: Measure = "walk"
    threshold: Finite | None = None
    certify: bool = False
    grounds: tuple[GroundText, ...] = (FLAT,)
    paired: bool = True
    allow_equal: bool = False
    rows: Whole = 0
    physics: Physics | None = None
    base: dict[str, Any] = dataclasses.field(default_factory=dict)
    variant: tuple[VariantTable, ...] = ()
    grid: dict[str, tuple[object, ...]] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if bool(self.variant) == bool(self.grid):
            raise ValueError("give [[variant]] tables or a [grid], one of the two")
        if not self.grounds or len(set(self.grounds)) < len(self.grounds):
            raise ValueError("grounds must name at least one ground, and none twice")
        if self.measure == "certified" and not self.certify:
            raise ValueError('measure = "certified" needs certify = true')
        if self.measure == "generations" and self.threshold is None:
            raise ValueError('measure = "generations" counts up to a fitness: set threshold')


@dataclasses.dataclass(frozen=True)
class Run:
    """One evolution run of a study."""

    variant: str
    seed: int
    generations: int
    config: Config


@dataclasses.dataclass(frozen=True)
class Plan:
    """A study with all its runs, variant by variant; the first variant is the base."""

    study: Study
    variants: tuple[str, ...]
    runs: tuple[Run, ...]

    def of(self, variant: str) -> list[Run]:
        """Return the runs of a variant, by seed."""
        return [run for run in self.runs if run.variant == variant]

    def upper_bound(self, creature: Creature) -> int:
        """Return the number of creature-steps if no individual falls."""
        return sum(_most_steps(run, creature) for run in self.runs)


def read_study(file: Path, over: Mapping[str, object]) -> Study:
    """Return the study in a file or shipped under this name, with options laid over it.

    If `generations` changes, variants with their own number keep their share of evaluations, which
    includes the initial population's.

    Raises:
      UserError: names the file and the key.
    """
    path = find_file(file, data_folder("configs") / "ablations", "study")
    given = build(Study, read_toml(path), str(path))
    study = build(Study, merge(dataclasses.asdict(given), not_none(**over)), str(path))
    scale = (study.generations + 1) / (given.generations + 1)
    scaled = [
        dataclasses.replace(
            v, generations=v.generations and max(1, round((v.generations + 1) * scale) - 1)
        )
        for v in study.variant
    ]
    return dataclasses.replace(study, variant=tuple(scaled))


def make_plan(study: Study, creature: Creature, where: str) -> Plan:
    """Return every run with its full config.

    Raises:
      UserError: an unknown key, a bad value, two variants of one name, or two that are equal.
    """
    tables = list(study.variant) or _grid(study)
    configs: dict[str, Config] = {}
    for table in tables:
        if table.name in configs:
            raise UserError(f'{where}: two variants are called "{table.name}"; name them apart')
        new = _config(study, table, creature, where)
        equal = next((name for name, other in configs.items() if other == new), None)
        if equal is not None and not study.allow_equal:
            raise UserError(
                f'{where}: the variants "{equal}" and "{table.name}" are equal; change one, or set '
                "allow_equal = true"
            )
        configs[table.name] = new
    if len(configs) < 2:
        raise UserError(f"{where}: a comparison needs two variants")
    runs = []
    for place, (name, variant) in enumerate(configs.items()):
        first = study.first_seed + (0 if study.paired else place * study.seeds)
        for seed in range(first, first + study.seeds):
            runs.append(
                Run(
                    name,
                    seed,
                    variant.evolution.generations,
                    dataclasses.replace(variant, seed=seed),
                )
            )
    return Plan(study, tuple(configs), tuple(runs))


def check_variants(plan: Plan, creature: Creature, where: str) -> None:
    """Refuse a study with a variant that could not be examined in the end.

    Raises:
      UserError: names the variant and says why; see `check_parts`.
    """
    for variant in plan.variants:
        with _located(f'{where}: variant "{variant}"'):
            check_parts(creature, plan.of(variant)[0].config)


def _config(study: Study, table: VariantTable, creature: Creature, where: str) -> Config:
    """Return the config of a variant's runs, without their seeds."""
    here = f'{where}: variant "{table.name}"'
    use = {
        **as_table(study.base.get("use", {}), f"{where}: [base] use"),
        **as_table(table.settings.get("use", {}), f"{here}: use"),
    }
    file = table.config or study.config
    with _located(here):
        config = resolve_config(
            creature.settings.train, creature.name, Path(file) if file else None, use
        )
    if not table.config:
        config = _lay(config, study.base, f"{where}: [base]")
    config = _lay(config, table.settings, here)
    if study.physics is not None:
        config = _lay(config, {"rollout": {"physics": study.physics}}, where)
    with _located(here):
        config = with_targets(config, creature, WalkTargets(gait=table.gait))
    return _settled(config, table.generations or study.generations)


@contextlib.contextmanager
def _located(where: str) -> Iterator[None]:
    """Prefix a `UserError` with its place."""
    try:
        yield
    except UserError as error:
        raise UserError(f"{where}: {error}") from None


def _settled(config: Config, generations: int) -> Config:
    """Return the config without early stopping and without ancestors.

    A run that stopped early would be compared with runs of more generations.
    """
    evolution = dataclasses.replace(
        config.evolution.unstopped(), generations=generations, ancestors=AncestorsConfig()
    )
    return dataclasses.replace(config, evolution=evolution)


def _lay(config: Config, table: Table, where: str) -> Config:
    evolution = as_table(table.get("evolution", {}), f"{where}: evolution")
    if "seed" in table or "generations" in evolution:
        raise UserError(
            f"{where}: seeds and generations are the study's own keys, not settings of a variant"
        )
    if "ancestors" in evolution:
        raise UserError(
            f"{where}: runs of a study begin with drawn individuals, not with ancestors"
        )
    laid = build(type(config), merge(dataclasses.asdict(config), table), where)
    if laid.evolution.islands.count > 1:
        raise UserError(
            f"{where}: a run of a study is one population; evolution.islands.count must be 1"
        )
    return laid


def _grid(study: Study) -> list[VariantTable]:
    """Return the base and every combination of the grid's values."""
    rows = [VariantTable("base")]
    for values in itertools.product(*study.grid.values()):
        settings: dict[str, Any] = {}
        for key, value in zip(study.grid, values, strict=True):
            settings = merge(settings, _nested(key, value))
        rows.append(
            VariantTable(
                ", ".join(
                    f"{key.split('.')[-1]} = {value}"
                    for key, value in zip(study.grid, values, strict=True)
                ),
                settings,
            )
        )
    return rows


def _nested(key: str, value: object) -> dict[str, object]:
    first, _, rest = key.partition(".")
    return {first: _nested(rest, value) if rest else value}


def _most_steps(run: Run, creature: Creature) -> int:
    rollout, evolution = run.config.rollout, run.config.evolution
    seeding = -(-evolution.population // evolution.offspring)
    episodes = (run.generations + seeding) * evolution.offspring * rollout.starts
    return episodes * round(rollout.seconds / creature.model.opt.timestep)
