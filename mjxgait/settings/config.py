"""Everything a run can be told, as frozen dataclasses."""

import dataclasses
from typing import Annotated, Literal

import pydantic

from mjxgait.ground.spec import FLAT, check_ground
from mjxgait.settings.control import DriveConfig, PoseConfig
from mjxgait.settings.islands import IslandsConfig
from mjxgait.settings.tables import (
    HOST,
    KIND,
    SHAPE,
    STRICT,
    Count,
    Finite,
    Fraction,
    NonNegative,
    Positive,
    Whole,
)
from mjxgait.settings.walk import WalkConfig

GroundText = Annotated[str, pydantic.AfterValidator(check_ground)]


@dataclasses.dataclass(frozen=True)
class TerminationConfig:
    """What ends an episode early; a key that is not given is as creature.toml has it.

    Attributes:
      min_up: cosine of the trunk's tilt below which it has tipped over; -1 never ends an
        episode.
      height: lowest and highest trunk height, in standing heights.
      touch: whether an episode ends when a part touches the floor that must not. Only then
        may evolution leave out the contacts of these parts.
    """

    __pydantic_config__ = STRICT
    min_up: Annotated[Annotated[float, pydantic.Field(ge=-1, le=1)] | None, SHAPE] = None
    height: Annotated[tuple[NonNegative, Positive] | None, SHAPE] = None
    touch: Annotated[bool | None, SHAPE] = None

    def __post_init__(self) -> None:
        if self.height is not None and self.height[0] >= self.height[1]:
            raise ValueError(f"height = {list(self.height)}: the first must be the smaller")


@dataclasses.dataclass(frozen=True)
class RolloutConfig:
    """How individuals are judged.

    Attributes:
      seconds: length of an episode.
      starts: R, episodes per individual; the first is nominal, the others are perturbed, the
        same for all.
      variety: so many times as many perturbed starts there are in all; each generation takes
        the next ones. With more than 1 everybody must be judged anew: `evolution.elite`.
      joint_noise: rad; half width of the uniform perturbation of each joint at a perturbed
        start.
      velocity_noise: rad/s; the same for the speeds of the joints.
      friction: range of the factor on the floor's friction.
      push: sudden change of the trunk's horizontal velocity at a random moment of a perturbed
        start, in units of sqrt(g * hip height).
      gains: half width of the uniform change of each joint's kp and kd in a perturbed start,
        as a share.
      masses: the same for each part's mass and inertia, which then differ from lane to lane;
        a step costs a third more (docs/performance.md).
      latency: most control steps by which the torques of a perturbed start come late.
      slope: deg; the ground of a perturbed start slopes by so much at most, to any side. Not with a
        `ground`, which all starts have.
      rough: hip heights; that ground rises and falls by so much besides.
      terminate: whether an episode ends when the creature falls; if not, its whole body meets
        the floor.
      termination: what counts as falling, where it differs from creature.toml.
      worst: share of the worst start in the score; the mean of the starts has the rest.
      caution: standard errors of its starts' mean by which the score is less: who was lucky on few
        is not believed as one that did well on many.
      physics: the fast step where the model allows it, or plain MJX.
      lanes: simulations in flight per device; 0 lets the program choose.
      block: individuals that a machine of a cluster judges at once, at most (docs/cluster.md).
      body: its numbers are constants of the compiled program, which is faster, or inputs:
        then another body of the same make-up needs no compilation.
      ground: flat, slope:0.1, steps:0.05, bumps:0.05 or rough:0.05, in hip heights
        (docs/ground.md).
    """

    __pydantic_config__ = STRICT
    seconds: Annotated[Positive, SHAPE] = 8.0
    starts: Annotated[Count, SHAPE] = 3
    variety: Annotated[Count, SHAPE] = 1
    joint_noise: NonNegative = 0.1
    velocity_noise: NonNegative = 0.3
    friction: tuple[Positive, Positive] = (0.8, 1.2)
    push: NonNegative = 0.2
    gains: Fraction = 0.1
    masses: Annotated[Fraction, SHAPE] = 0.0
    latency: Annotated[Whole, SHAPE] = 0
    slope: Annotated[float, pydantic.Field(ge=0, le=45), SHAPE] = 0.0
    rough: Annotated[float, pydantic.Field(ge=0, le=0.5), SHAPE] = 0.0
    terminate: Annotated[bool, SHAPE] = True
    termination: TerminationConfig = dataclasses.field(default_factory=TerminationConfig)
    worst: Fraction = 0.5
    caution: Annotated[NonNegative, SHAPE] = 0.0
    physics: Annotated[Literal["auto", "mjx"], SHAPE] = "auto"
    lanes: Annotated[Whole, SHAPE] = 0
    block: Annotated[Count, HOST] = 64
    ground: Annotated[GroundText, KIND] = FLAT
    body: Annotated[Literal["constants", "inputs"], SHAPE] = "constants"

    def __post_init__(self) -> None:
        if self.uneven and self.ground != FLAT:
            raise ValueError(
                f"ground = {self.ground}: all starts have it; slope and rough are for a flat one"
            )

    @property
    def uneven(self) -> bool:
        """Whether perturbed starts have uneven ground of their own."""
        return bool(self.slope or self.rough)


@dataclasses.dataclass(frozen=True)
class ForcedConfig:
    """Forced evolution: a spell of rapid mutation and newcomers when growth stalls.

    Attributes:
      enabled: whether there are such spells.
      window: generations over which best and mean are watched.
      gain: relative growth below which both have stalled.
      newcomers: share of new random genomes among a forced generation's offspring, the others
        are mutants.
      mutations: how many times each mutant is mutated.
      accept: quantile of the population's fitness that an offspring must reach to be taken
        in.
      refresh: share of the population to replace.
      limit: generations a spell lasts at most; 0 lets it last until the population is
        refreshed.
      patience: spells in a row without a better best after which the run stops; 0 never stops
        it.
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
class EvolutionConfig:
    """The genetic algorithm; `mjxgait/search/breeding.py` says how parents and children are drawn.

    Attributes:
      population: P, individuals that live from one generation to the next.
      generations: cap on the generations of a run.
      target: fitness at which a run stops.
      growth: the population grows to this multiple of P, then is culled back to P.
      pose_range: share of each joint's pose range, about its middle, in which key poses lie.
      pose_span: deg; width of every hinge's pose range, about its middle in creature.toml, as
        far as the joint's range in creature.xml allows; 0 leaves the ranges of creature.toml.
      initial: uniform draws or a Latin hypercube.
      initial_spread: share of each gene's range, about its middle, in which the first genomes
        lie.
      initial_choice: so many are drawn and judged for each place of the first generation.
      selection: how parents are drawn: any, by rank, or the best of some rivals.
      rivals: of a tournament.
      proportional: parents are drawn in proportion to their fitness instead.
      crossover: share of offspring with two parents, the others have one.
      crossing: `permute` draws K poses from the parents' 2K in any order; `align` leaves each
        pose in its place.
      pool: whom parents are drawn from: last generation's survivors, or `growing`, which also
        holds the children born so far (they rank last).
      unique_children: a child that equals somebody of the pool or a sibling is drawn anew
        before it is simulated.
      survival: of the `best` of parents and children, or of `children` alone, and the best so
        far.
      elite: that share of the population, the best, lives on among the children and is judged
        with them, for survival of children.
      remember: whether their earlier rounds count as well: the mean of all rounds is what those
        are worth that are judged once more.
      mutation: `redraw` re-draws two joints of one pose, `single` one joint, `pose` a whole
        pose, `gaussian` moves every joint of one pose by sigma, `mixed` is one or the other
        of the first and the last. `bit` and `byte` read the value of one joint as 8 bits over
        its range and flip one of them, or re-draw all eight, as classic GAs do.
      mutation_rate: share of offspring mutated.
      sigma: of the gaussian mutation, in units of the range of each joint.
      body: how many times larger or smaller the parts below the trunk may become, each
        mirrored pair by a gene of its own (docs/creature.md); 1 leaves the body as it is.
      tuning_rate: chance that a tuning gene of a mutated offspring changes; likewise a
        body's.
      tuning_sigma: by how much it changes, in units of its range; likewise a body's.
      remove_duplicates: of individuals with the same genome only one survives.
      forced: a spell of rapid mutation and newcomers when growth stalls.
      islands: several such populations that exchange their best (docs/cluster.md).
    """

    __pydantic_config__ = STRICT
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
    crossing: Literal["permute", "align"] = "align"
    pool: Annotated[Literal["parents", "growing"], SHAPE] = "parents"
    unique_children: Annotated[bool, SHAPE] = False
    survival: Literal["best", "children"] = "best"
    elite: Annotated[Fraction, SHAPE] = 0.0
    remember: Annotated[bool, SHAPE] = False
    mutation: Literal["redraw", "single", "pose", "gaussian", "mixed", "bit", "byte"] = "mixed"
    mutation_rate: Fraction = 0.8
    sigma: Positive = 0.12
    body: Annotated[float, pydantic.Field(ge=1, le=2), SHAPE] = 1.0
    tuning_rate: Fraction = 0.3
    tuning_sigma: Positive = 0.1
    remove_duplicates: bool = True
    forced: ForcedConfig = dataclasses.field(default_factory=ForcedConfig)
    islands: IslandsConfig = dataclasses.field(default_factory=IslandsConfig)

    def __post_init__(self) -> None:
        if self.population < 2:
            raise ValueError("population must be at least 2: crossover needs two parents")
        if round(self.population * (self.growth - 1)) < 1:
            raise ValueError(
                f"growth = {self.growth} leaves no room for offspring; make it larger than {1 + 1 / self.population:.3g}"
            )

        if self.proportional and (self.unique_children or self.pool == "growing"):
            raise ValueError("proportional is for children that are born all at once")
        if self.elite and self.survival == "best":
            raise ValueError('elite is for survival = "children": of the best all live on anyway')
        if self.remember and not self.elite:
            raise ValueError("remember is for an elite: nobody else is judged more than once")
        if self.elites >= self.offspring:
            raise ValueError(f"elite = {self.elite} leaves no room for children")

    @property
    def offspring(self) -> int:
        """Individuals evaluated per generation."""
        return round(self.population * (self.growth - 1))

    @property
    def elites(self) -> int:
        """Of the best that are judged again in each generation."""
        return max(round(self.elite * self.population), 1) if self.elite else 0


@dataclasses.dataclass(frozen=True)
class ExaminationConfig:
    """Who is chosen for the examination in C MuJoCo that ends a run.

    Attributes:
      every: generations between looks on the way at the best, if it is promising; 0 examines only
        after the last generation.
      enough: margin on the draw to choose on that leads to an examination in the first half of the
        generations; in the second any pass does.
      draws: perturbed starts, and as many pushes, to choose on; the examination draws others.
      attempts: examinations of a run, the one at its end included.
      candidates: so many of the best, different from each other, are looked at in the end, until
        one has enough margin; 0 leaves all examinations out.
      on_the_way: so many of them are looked at on the way. With few starts in each generation the
        first is often the luckiest.
      difference: in units of each gene's range, root mean square; what counts as different.
      level: what ends a run early: one that walks by the certificate, or that walks anywhere
        (docs/certificate.md).
    """

    __pydantic_config__ = STRICT
    every: Annotated[Whole, HOST] = 5
    enough: Annotated[Finite, HOST] = 0.2
    draws: Annotated[Count, HOST] = 32
    attempts: Annotated[Count, HOST] = 3
    candidates: Annotated[Whole, HOST] = 12
    on_the_way: Annotated[Count, HOST] = 1
    difference: Annotated[NonNegative, HOST] = 0.02
    level: Annotated[Literal["walks", "anywhere"], HOST] = "walks"


@dataclasses.dataclass(frozen=True)
class UseConfig:
    """Who takes part.

    Attributes:
      controller: what moves the creature: poses, program (docs/programs.md), brain
        (docs/blocks.md), or FILE.py:CLASS of your own (docs/extending.md).
      task: what the creature is to do: walk, hop, limbo, travel; swim, walk, jump, follow and
        follow-on-land of bodies that grow (docs/blocks.md); or FILE.py:CLASS of your own.
    """

    __pydantic_config__ = STRICT
    controller: Annotated[str, SHAPE] = "poses"
    task: Annotated[str, SHAPE] = "walk"


@dataclasses.dataclass(frozen=True)
class Config:
    """A run's settings.

    Attributes:
      seed: Of all randomness.
      checkpoint_every: Generations between checkpoints, which is what a killed run loses at
        most; the latest three stay.
      keep_every: Checkpoints of generations that are a multiple of this are kept for good.
      use: Who takes part.
      controller: What moves the creature.
      drive: How the joints' motors follow.
      rollout: How individuals are judged.
      fitness: What is wanted of them.
      evolution: The genetic algorithm.
      examination: Who is examined.
    """

    __pydantic_config__ = STRICT
    seed: Annotated[Whole, HOST] = 0
    checkpoint_every: Annotated[Count, HOST] = 5
    keep_every: Annotated[Count, HOST] = 5
    use: UseConfig = dataclasses.field(default_factory=UseConfig)
    controller: PoseConfig = dataclasses.field(default_factory=PoseConfig)
    drive: DriveConfig = dataclasses.field(default_factory=DriveConfig)
    rollout: RolloutConfig = dataclasses.field(default_factory=RolloutConfig)
    fitness: WalkConfig = dataclasses.field(default_factory=WalkConfig)
    evolution: EvolutionConfig = dataclasses.field(default_factory=EvolutionConfig)
    examination: ExaminationConfig = dataclasses.field(default_factory=ExaminationConfig)

    def __post_init__(self) -> None:
        if self.rollout.variety > 1 and not self.evolution.elite:
            raise ValueError(
                f"rollout.variety = {self.rollout.variety}: who has been judged on other starts "
                'does not compare; set evolution.survival = "children" and evolution.elite'
            )

    @property
    def wish(self) -> dict[str, float | str]:
        """What is asked of a walk, by name; of who does something else nothing can be."""
        asked = getattr(self.fitness, "wish", None)
        return asked.table if asked is not None else {}
