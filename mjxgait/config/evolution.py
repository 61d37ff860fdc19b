"""Settings of the search, as frozen dataclasses."""

import dataclasses
from typing import Annotated, Literal

import pydantic

from mjxgait.config.tables import (
    ADDED,
    HOST,
    SHAPE,
    STRICT,
    Count,
    Finite,
    Fraction,
    NonNegative,
    Positive,
    Whole,
)


@dataclasses.dataclass(frozen=True)
class IslandsConfig:
    """Separate populations, each of the whole `population`, on the same starts.

    Attributes:
      count: number of islands; 1 is the plain algorithm.
      every: generations between exchanges; 0: none.
      migrants: best individuals of an island, copied over the worst of another; of all that reach
        an island the best stay, at most half its population.
      topology: where they go: to the next island of the ring, or to all the others.
    """

    __pydantic_config__ = STRICT
    count: Annotated[Count, HOST] = 1
    every: Annotated[Whole, HOST] = 5
    migrants: Annotated[Count, HOST] = 2
    topology: Annotated[Literal["ring", "all"], HOST] = "ring"

    def sources(self, island: int) -> list[int]:
        """Return the islands that send migrants to an island."""
        if self.topology == "ring":
            return [(island - 1) % self.count] if self.count > 1 else []
        return [other for other in range(self.count) if other != island]


@dataclasses.dataclass(frozen=True)
class ForcedConfig:
    """Forced evolution: a phase of rapid mutation and immigrants when growth stalls.

    Attributes:
      enabled: allows forced phases.
      window: generations over which best and mean are watched.
      gain: relative growth below which both have stalled.
      newcomers: share of new random genomes among a forced generation's offspring, the others are
        mutants.
      mutations: number of mutations of each mutant.
      accept: quantile of the population's fitness that an offspring must reach to be accepted.
      refresh: share of the population to replace.
      limit: longest phase, in generations; 0 lets it last until the population is refreshed.
      patience: phases in a row without a better best after which the run stops; 0 never stops it.
    """

    __pydantic_config__ = STRICT
    enabled: bool = True
    window: Annotated[Count, SHAPE] = 8
    gain: NonNegative = 0.01
    newcomers: Fraction = 0.5
    mutations: Annotated[Count, SHAPE] = 3
    accept: Fraction = 0.25
    refresh: Fraction = 0.5
    limit: Whole = 4
    patience: Annotated[Whole, HOST] = 3


@dataclasses.dataclass(frozen=True)
class RestartConfig:
    """A new first population in place of one that has learnt nothing, such as only to stand.

    Attributes:
      every: generations between comparisons of the best fitness; 0: never.
      below: fitness up to which the best has learnt nothing.
    """

    __pydantic_config__ = STRICT
    every: Whole = 0
    below: Finite = 0.0


def several(runs: int) -> int:
    """Return a number of runs; raise ValueError for a single one."""
    if runs == 1:
        raise ValueError("give 2 or more, or 0 for none")
    return runs


@dataclasses.dataclass(frozen=True)
class AncestorsConfig:
    """Small runs of an easier task, or the same, before this one; their best individuals begin it.

    They stay in the run's folder `ancestors`. `train --from` takes their place. Source: Shim, Shin
    and Kim (2004).

    Attributes:
      runs: number of them, at least 2; 0: the first individuals are drawn.
      task: what they evolve for, with the creature's settings for it.
      population: P of each.
      generations: number of generations of each.
      initial_choice: genomes drawn and evaluated for each place of their first generation; 0: as
        many as for that task.
      starts: R of each; 0: as many as for that task.
    """

    __pydantic_config__ = STRICT
    runs: Annotated[Whole, pydantic.AfterValidator(several), HOST] = 0
    task: Annotated[str, HOST] = "swim"
    population: Annotated[int, pydantic.Field(ge=2), HOST] = 60
    generations: Annotated[Count, HOST] = 40
    initial_choice: Annotated[Whole, HOST, ADDED] = 0
    starts: Annotated[Whole, HOST, ADDED] = 0


@dataclasses.dataclass(frozen=True)
class EvolutionConfig:
    """Search; see `mjxgait/evolution/breeding.py` for draws of parents and children.

    Attributes:
      search: how children come about: `ga` breeds them from parents; `es` draws them all from a
        distribution that it learns (separable CMA-ES), for genomes of bounded reals. Then settings
        of parents, crossover, mutation, lineages and forced evolution do nothing, except sigma.
      population: P, individuals that survive from one generation to the next.
      generations: maximum number of generations.
      target: fitness at which a run stops.
      growth: the population grows to this multiple of P, then is culled back to P.
      pose_range: share of each joint's pose range, about its middle, in which key poses lie.
      pose_span: deg; width of every hinge's pose range, about its middle in creature.toml, as far
        as the joint's range in creature.xml allows; 0 keeps the ranges of creature.toml.
      initial: uniform draws or a Latin hypercube.
      initial_spread: share of each gene's range, about its middle, in which the first genomes lie.
      initial_choice: genomes drawn and evaluated for each place of the first generation.
      selection: how parents are drawn: any, by rank, or the best of some rivals.
      rivals: tournament size.
      proportional: draws parents in proportion to their fitness instead.
      crossover: share of offspring with two parents, the others have one.
      crossing: `permute` draws K poses from the parents' 2K in any order (Wilson); `align` leaves
        each pose in its place; `mixed` is one or the other for each child.
      permuted: share of `mixed` crossovers that permute.
      pool: source of parents: last generation's survivors, or `growing`, which also holds the
        children born so far (they rank last).
      unique_children: redraws a child that equals a member of the pool or a sibling, before it is
        simulated.
      survival: the `best` of parents and children survive, or the `children` and the best so far.
      elite: share of the population, the best, that survives among the children and is evaluated
        with them, for survival of children.
      remember: the elite's earlier evaluations count too: the fitness is the mean of all rounds.
      mutation: `redraw` re-draws two joints of one pose, `single` one joint, `pose` a whole pose,
        `gaussian` moves every joint of one pose by sigma, `mixed` is one or the other of the first
        and the last. `bit` and `byte` read the value of one joint as 8 bits over its range and flip
        one of them, or re-draw all eight, as classic GAs do.
      redrawn: share of `mixed` mutations that re-draw.
      mutation_rate: share of offspring mutated.
      sigma: standard deviation of the gaussian mutation, in units of the range of each joint; of an
        evolution strategy, the first one of every gene.
      body: largest factor by which the parts below the trunk may grow or shrink, each mirrored pair
        by a gene of its own (docs/reference/creature-folder.md); 1 leaves the body unchanged.
      tuning_rate: chance that a tuning gene of a mutated offspring changes; likewise a body gene.
      tuning_sigma: size of that change, in units of the gene's range; likewise a body gene's.
      remove_duplicates: of individuals with the same genome only one survives.
      same: what makes a duplicate: the same `genome`, or the same `verdict` (results) to the bit,
        for genomes with many neutral genes: a child replaces its parent. By genome in a forced
        phase.
      lineage: records in a run's metrics the mother of each child, not for islands.
      family: largest share of the population that may descend, mother by mother, from one of the
        first generation: keeps one family from taking over.
      forced: a phase of rapid mutation and immigrants when growth stalls.
      restart: a new first population in place of one that has learnt nothing.
      ancestors: small runs before this one; not for islands and studies.
      islands: several such populations that exchange their best (docs/guide/cluster.md).
    """

    __pydantic_config__ = STRICT
    search: Annotated[Literal["ga", "es"], SHAPE, ADDED] = "ga"
    population: Annotated[Count, SHAPE] = 256
    generations: Annotated[Whole, HOST] = 75
    target: Annotated[Finite | None, HOST] = None
    growth: Annotated[Positive, SHAPE] = 2.0
    pose_range: Annotated[float, pydantic.Field(gt=0, le=1)] = 1.0
    pose_span: Annotated[NonNegative, SHAPE] = 0.0
    initial: Literal["uniform", "latin"] = "uniform"
    initial_spread: Fraction = 0.6
    initial_choice: Count = 1
    selection: Literal["uniform", "rank", "tournament"] = "rank"
    rivals: Annotated[Count, SHAPE] = 2
    proportional: Annotated[bool, SHAPE] = False
    crossover: Fraction = 0.7
    crossing: Literal["permute", "align", "mixed"] = "align"
    permuted: Fraction = 0.5
    pool: Annotated[Literal["parents", "growing"], SHAPE] = "parents"
    unique_children: Annotated[bool, SHAPE] = False
    survival: Literal["best", "children"] = "best"
    elite: Annotated[Fraction, SHAPE] = 0.0
    remember: Annotated[bool, SHAPE] = False
    mutation: Literal["redraw", "single", "pose", "gaussian", "mixed", "bit", "byte"] = "mixed"
    redrawn: Fraction = 0.5
    mutation_rate: Fraction = 0.8
    sigma: Positive = 0.12
    body: Annotated[float, pydantic.Field(ge=1, le=2), SHAPE] = 1.0
    tuning_rate: Fraction = 0.3
    tuning_sigma: Positive = 0.1
    remove_duplicates: bool = True
    same: Annotated[Literal["genome", "verdict"], SHAPE] = "genome"
    lineage: Annotated[bool, SHAPE] = False
    family: Annotated[Fraction, SHAPE] = 1.0
    forced: ForcedConfig = dataclasses.field(default_factory=ForcedConfig)
    restart: Annotated[RestartConfig, ADDED] = dataclasses.field(default_factory=RestartConfig)
    ancestors: Annotated[AncestorsConfig, ADDED] = dataclasses.field(
        default_factory=AncestorsConfig
    )
    islands: IslandsConfig = dataclasses.field(default_factory=IslandsConfig)

    def __post_init__(self) -> None:
        if self.population < 2:
            raise ValueError("population must be at least 2: crossover needs two parents")
        if round(self.population * (self.growth - 1)) < 1:
            raise ValueError(
                f"growth = {self.growth} leaves no room for offspring; make it larger than "
                f"{1 + 1 / self.population:.3g}"
            )

        at_once = not self.unique_children and self.pool != "growing"
        if (self.proportional or self.follows) and not at_once:
            which = "proportional" if self.proportional else "lineage or family"
            raise ValueError(f"{which} is for children that are born all at once")
        if self.search == "es" and self.offspring - self.elites < 2:
            raise ValueError(
                'search = "es" learns from at least 2 children of a generation, and these '
                f"settings leave {self.offspring - self.elites}; make population or growth larger"
            )
        if self.elite and self.survival == "best":
            raise ValueError(
                'elite is for survival = "children": of the best all live on anyway; set it to 0'
            )
        if self.remember and not self.elite:
            raise ValueError(
                "remember is for an elite: no other individual is evaluated more than once"
            )
        if self.elites >= self.offspring:
            raise ValueError(f"elite = {self.elite} leaves no room for children")

    def patient(self) -> "EvolutionConfig":
        """Return the settings without an end because forced phases fail."""
        return dataclasses.replace(self, forced=dataclasses.replace(self.forced, patience=0))

    def unstopped(self) -> "EvolutionConfig":
        """Return the settings without any end before the last generation."""
        return dataclasses.replace(self.patient(), target=None)

    @property
    def follows(self) -> bool:
        """Return whether mothers are recorded; children that a strategy draws have none."""
        return self.search == "ga" and (self.lineage or self.family < 1)

    @property
    def offspring(self) -> int:
        """Individuals evaluated per generation."""
        return round(self.population * (self.growth - 1))

    @property
    def elites(self) -> int:
        """Number of the best evaluated again in each generation."""
        return max(round(self.elite * self.population), 1) if self.elite else 0
