"""Trials of a champion on C MuJoCo: draws of starts and pushes, steering, and the trial run.

A champion's draw follows from its fingerprint, which exists only once the champion is complete.
Evolution therefore cannot tune for it, and every examination of a champion uses the same draw.

Letters: `S` simulations, `R` recorded ones (the first of the `S`), `T` control steps.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from mjxgait.certification.acceptance import acceptance_of, task_rules
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion
from mjxgait.certification.verdict import verdict_on
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.processes import cores
from mjxgait.reference.controllers import ReferenceController
from mjxgait.reference.outcome import Fall, Outcome, Watch
from mjxgait.reference.starts import Starts, join, perturbed_starts, pushed_starts, unfamiliar
from mjxgait.reference.stepping import ReferenceSimulation

AIMS = 3
"""Purpose of the draw of a task's goals."""
COMMANDS = 4
"""Purpose of the draw of commands."""


@dataclasses.dataclass(frozen=True)
class Draw:
    """Source of all draws of an examination. words: of the seed."""

    words: tuple[int, ...]

    def generator(self, purpose: int) -> np.random.Generator:
        """Return the generator for a purpose.

        0: starts. 1: pushes. 2: the ladder of larger pushes. Also `AIMS` and `COMMANDS`.
        """
        return np.random.default_rng([*self.words, purpose])


def common_draw(config: CertificateConfig) -> Draw:
    """Return the draw shared by all champions."""
    return Draw((config.seed,))


def own_draw(champion: Champion, config: CertificateConfig) -> Draw:
    """Return the champion's own draw."""
    return Draw((config.seed, int(champion.fingerprint, 16)))


def starts(creature: Creature, config: CertificateConfig, draw: Draw, count: int) -> Starts:
    """Draw the starts of criterion 4."""
    noise, rng = config.starts, draw.generator(0)
    familiar = perturbed_starts(
        creature, count, rng, noise.joints, noise.velocities, noise.friction, noise.masses
    )
    return unfamiliar(
        familiar,
        rng,
        gains=noise.gains,
        latency=noise.latency,
        slope=float(np.radians(noise.slope)),
        floor=noise.floor,
    )


def pushes(creature: Creature, config: CertificateConfig, draw: Draw, count: int) -> Starts:
    """Draw the pushes of criterion 5."""
    speed = config.pushes.speed * creature.unit_speed
    return pushed_starts(creature, count, draw.generator(1), speed, config.pushes.window)


def ladder(creature: Creature, config: CertificateConfig, draw: Draw) -> list[Starts]:
    """Draw the larger pushes, a group for each size, all within two seconds.

    Each is watched only for as long as a fall takes.
    """
    settings, rng = config.pushes, draw.generator(2)
    begin, end = settings.window[0], min(settings.window[0] + 2.0, settings.window[1])
    watched = np.full(settings.ladder_count, end + settings.ladder_seconds)
    speeds = [size * creature.unit_speed for size in settings.ladder]
    return [
        dataclasses.replace(
            pushed_starts(creature, settings.ladder_count, rng, speed, (begin, end)), end=watched
        )
        for speed in speeds
    ]


def simulate(
    creature: Creature,
    champion: Champion,
    starts: Starts,
    seconds: float,
    *,
    record: int = 0,
    heading: np.ndarray | None = None,
    fall: Fall | None = None,
    threads: int = 0,
    watch: Watch | None = None,
    reference: ReferenceController | None = None,
    config: CertificateConfig | None = None,
) -> Outcome:
    """Simulate the champion from every start; a start without a goal gets the task's nominal one.

    Args:
      record: R, number of simulations to record, from the first on. These run to the end even
        after a fall; the others stop there.
      fall: conditions of a fall; the task's by default.
      heading: [T] or [S, T] rad, commanded heading at each control step; None takes the task's,
        mostly straight ahead.
      threads: 0 takes the machine's cores. The result does not depend on it.
      watch: receives the simulations that can no longer succeed, and ends all once that decides
        the result.
      reference: replaces the champion's own reference controller.
      config: thresholds by which a start has a goal, and `watch` a result; the default ones.
    """
    config = config or CertificateConfig()
    steps = round(seconds / creature.model.opt.timestep)
    task = task_rules(champion.task, champion.wish)
    fall = fall or task.fall(config)
    starts = task.aimed(starts, config)
    if heading is None:
        heading = task.commanded_heading(steps, creature.model.opt.timestep)
    commanded = None if heading is None else np.broadcast_to(heading, (len(starts), steps))
    stepping = ReferenceSimulation(
        creature, champion, starts, record, fall, task, reference, threads=threads or cores()
    )

    def decided(seen: Outcome, steps: int) -> bool:
        return watch is not None and watch.tell(task.lost(seen, starts, steps, config))

    return stepping.to_the_end(steps, commanded, None if watch is None else decided)


def steering_criteria(
    creature: Creature,
    champion: Champion,
    config: CertificateConfig,
    draw: Draw,
    threads: int = 0,
) -> tuple[Criterion, ...]:
    """Evaluate drawn commands from perturbed starts; empty if the task has none."""
    acceptance, step = acceptance_of(champion.task, champion.wish), creature.model.opt.timestep
    commands = acceptance.commands(config, step, draw.generator(COMMANDS))
    if commands is None:
        return ()
    begun = starts(creature, config, draw, len(commands))
    begun = dataclasses.replace(begun, **commands.lights)
    outcome = simulate(
        creature,
        champion,
        begun,
        commands.seconds,
        heading=commands.heading,
        fall=acceptance.fall(config),
        threads=threads,
    )
    return acceptance.obeyed(outcome, commands, config)


def trial_run(
    creature: Creature,
    champion: Champion,
    count: int,
    config: CertificateConfig | None = None,
    wanted: float = -np.inf,
    caution: float = 0.0,
) -> float:
    """Return the worst margin of criteria 4, 5 and steering on the draw shared by all champions.

    This margin chooses champions; the examination uses another draw. If pushes decide, a trial run
    ends once the last pushed have had time to fall. Otherwise it lasts as long as the examination:
    a late arrival at a goal must count here too.

    Args:
      count: perturbed starts, and as many pushes if pushes decide.
      wanted: once this margin is out of reach, the simulations stop and the largest margin that
        is still possible is returned.
      caution: standard errors that are subtracted from the measured shares. A champion chosen by
        a share has been lucky more often than not.
    """
    config = config or CertificateConfig()
    draw, acceptance = common_draw(config), acceptance_of(champion.task, champion.wish)
    begun, seconds = _trial_starts(creature, champion, count, config)

    def margin(well: np.ndarray) -> float:
        pushed = _cautious(well[count:], caution) if acceptance.by_pushes else np.nan
        return _worst(acceptance.disturbed(_cautious(well[:count], caution), pushed, config))

    watch = Watch(len(begun), lambda lost: margin(~lost) < wanted)
    fall = acceptance.fall(config)
    outcome = simulate(creature, champion, begun, seconds, fall=fall, watch=watch, config=config)
    if watch.over:
        return margin(~watch.lost)
    succeeded = acceptance.succeeded(outcome, begun, config)
    reached = margin(np.where(np.arange(len(begun)) < count, succeeded, outcome.stayed_up))
    if reached < wanted:
        return reached
    return min(reached, _worst(steering_criteria(creature, champion, config, draw)))


def _trial_starts(
    creature: Creature, champion: Champion, count: int, config: CertificateConfig
) -> tuple[Starts, float]:
    """Return the starts of a trial run, those with a push last, and its length in s."""
    draw, acceptance = common_draw(config), acceptance_of(champion.task, champion.wish)
    disturbed = acceptance.aimed(
        starts(creature, config, draw, count), config, draw.generator(AIMS)
    )
    if not acceptance.by_pushes:
        return acceptance.aimed(disturbed, config), config.seconds
    pushed = pushes(creature, config, draw, count)
    seconds = min(config.seconds, config.pushes.window[1] + config.pushes.ladder_seconds)
    return acceptance.aimed(join(disturbed, pushed), config), seconds


def _cautious(well: np.ndarray, caution: float) -> float:
    """Share of successes [S] minus `caution` standard errors."""
    share = float(well.mean())
    return share - caution * math.sqrt(share * (1 - share) / len(well))


def _worst(criteria: Sequence[Criterion]) -> float:
    """Margin of the worst criterion; infinite without criteria, so that it limits nothing."""
    return verdict_on(criteria).margin if criteria else np.inf
