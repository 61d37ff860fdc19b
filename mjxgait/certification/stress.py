"""A harder test than the certificate: bumps, slopes, slippery floors, pushes, ten minutes' walk.

Each trial simulates the same champion under one disturbance. Uneven ground is the creature's
terrain (`creature.on("rough:0.05")`); the others change the initial conditions or the model.

Letters: `S` simulations.
"""

import copy
import dataclasses
import json
from collections.abc import Callable, Iterator

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.trials import Draw, common_draw, simulate
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.reference.layout import start_frame
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.reference.starts import Starts, perturbed_starts, pushed_starts


def slippery(creature: Creature, friction: float) -> Creature:
    """Return the creature with this coefficient of sliding friction at every contact."""
    model = copy.copy(creature.model)
    model.geom_friction[:, 0] = friction
    return dataclasses.replace(creature, model=model)


FLOORS = 4
"""Number of rough floors among which the starts are divided."""
TRIALS = 9
"""Number of stress tests; a hasty examination stops at the first that fails."""


@dataclasses.dataclass(frozen=True)
class StressConfig:
    """Settings of the stress tests.

    starts: S of each trial. share: of the starts that must succeed. seconds: of each trial but the
    longest, `long`. bumps: hip heights. slope: deg. friction: coefficient.
    push: sqrt(g * hip height). trunk: factor on its mass and inertia.
    """

    starts: int = 32
    share: float = 0.9
    seconds: float = 22.0
    long: float = 600.0
    bumps: float = 0.05
    slope: float = 5.0
    friction: float = 0.4
    push: float = 0.3
    trunk: float = 1.2


@dataclasses.dataclass(frozen=True)
class Trial:
    """One stress test. share: of its starts that stayed up and got a body length ahead."""

    name: str
    share: float
    passed: bool


@dataclasses.dataclass(frozen=True)
class Stress:
    """All trials of one champion, identified by its fingerprint."""

    champion: str
    trials: tuple[Trial, ...]
    config: StressConfig

    @property
    def passed(self) -> bool:
        """True if all trials pass."""
        return all(trial.passed for trial in self.trials)

    def rows(self) -> list[str]:
        """Return a line for each trial, and one for the whole."""
        lines = [
            f"{t.name:24} {t.share:>4.0%}  {'pass' if t.passed else 'FAIL'}" for t in self.trials
        ]
        return [*lines, self.verdict]

    @property
    def verdict(self) -> str:
        """Sentence on whether the champion walks anywhere."""
        if not self.passed:
            return "It does not walk anywhere yet."
        if self.config != StressConfig():
            return "It passes, but by other settings than those of `mjxgait stress`."
        return "It walks anywhere."

    def document(self) -> dict[str, object]:
        """Return the content of `stress.json`."""
        return {"schema": 1, "passed": self.passed} | dataclasses.asdict(self)

    def to_json(self) -> str:
        """Return the text of `stress.json`."""
        return json.dumps(self.document(), indent=2) + "\n"


def stress(
    creature: Creature,
    champion: Champion,
    config: StressConfig | None = None,
    tell: Callable[[str], object] = lambda name: None,
    hasty: bool = False,
    draw: Draw | None = None,
) -> Stress:
    """Test a walking champion beyond the certificate, one disturbance at a time.

    Args:
      tell: called with the name of each trial before it runs.
      hasty: stops after the first failed trial; the longest is the last.
      draw: of starts and pushes; the one shared by all champions if left out.

    Raises:
      UserError: the task is not `walk`.
    """
    if champion.task != "walk":
        raise UserError(
            f"this champion's task is {champion.task}: only a walk is stressed; `mjxgait certify` "
            "examines it"
        )
    config, found = config or StressConfig(), []
    draw = draw or common_draw(CertificateConfig())
    for name, tried in _trials(creature, champion, config, draw):
        tell(name)
        done = [_done(creature, outcome) for outcome in tried()]
        share = float(np.concatenate(done).mean())
        found.append(Trial(name, share, share >= config.share))
        if hasty and not found[-1].passed:
            break
    return Stress(champion.fingerprint, tuple(found), config)


def _trials(
    creature: Creature, champion: Champion, config: StressConfig, draw: Draw
) -> Iterator[tuple[str, Callable[[], list[Outcome]]]]:
    """Yield the name of each trial and the function that simulates it."""
    plain = perturbed_starts(creature, config.starts, draw.generator(0))

    def walked(
        starts: Starts, body: Creature = creature, seconds: float = config.seconds
    ) -> Callable[[], list[Outcome]]:
        return lambda: [simulate(body, champion, starts, seconds)]

    def bumps() -> list[Outcome]:
        floors = [creature.on(f"rough:{config.bumps:g}@{i}") for i in range(FLOORS)]
        shares = [plain.rows(np.arange(i, len(plain), FLOORS)) for i in range(FLOORS)]
        # Low-hanging parts may brush a bump.
        return [
            simulate(floor, champion, some, config.seconds, fall=Fall(touch=False))
            for floor, some in zip(floors, shares, strict=True)
            if len(some)
        ]

    yield f"bumps of {config.bumps:.0%}", bumps
    start, rise = start_frame(creature), np.radians(config.slope)
    ways = {"up": start.forward, "down": -start.forward, "left": start.left, "right": -start.left}
    for way, direction in ways.items():
        slope = np.tile(rise * direction[:2], (len(plain), 1))
        yield f"slope of {config.slope:g}° {way}", walked(dataclasses.replace(plain, slope=slope))
    even = dataclasses.replace(plain, friction=np.ones(len(plain)))
    yield f"friction {config.friction:g}", walked(even, slippery(creature, config.friction))
    speed = config.push * creature.unit_speed
    window = CertificateConfig().pushes.window
    pushed = pushed_starts(creature, config.starts, draw.generator(1), speed, window)
    yield f"push of {config.push:g} √(g·h)", walked(pushed)
    mass = plain.mass.copy()
    mass[:, creature.trunk] *= config.trunk
    yield f"trunk {config.trunk - 1:+.0%}", walked(dataclasses.replace(plain, mass=mass))
    yield f"{config.long / 60:g} minutes", walked(plain, seconds=config.long)


def _done(creature: Creature, outcome: Outcome) -> np.ndarray:
    """Mask [S] of simulations that stayed up and got more than a body length ahead."""
    done: np.ndarray = outcome.stayed_up & (outcome.travel[:, 0] > creature.frame.body_length)
    return done
