"""Trial run on a draw shared by all champions, by which one of them is chosen."""

import math
from collections.abc import Sequence

import numpy as np

from mjxgait.certification import draws
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion
from mjxgait.certification.draws import AIMS
from mjxgait.certification.simulate import simulate
from mjxgait.certification.steering import told_to_turn
from mjxgait.certification.tasks import demands_of
from mjxgait.certification.verdict import judge
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.starts import Starts, join
from mjxgait.reference.watch import Watch


def rehearse(
    creature: Creature,
    champion: Champion,
    count: int,
    config: CertificateConfig | None = None,
    threads: int = 0,
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
    draw, demands = draws.common(config), demands_of(champion.task, champion.wish)
    disturbed = demands.aimed(
        draws.starts(creature, config, draw, count), config, draw.generator(AIMS)
    )
    pushes: tuple[Starts, ...] = ()
    seconds = config.seconds
    if demands.by_pushes:
        pushes = (draws.pushes(creature, config, draw, count),)
        seconds = min(seconds, config.pushes.window[1] + config.pushes.ladder_seconds)
    starts = demands.aimed(join(disturbed, *pushes), config)

    def margin(well: np.ndarray) -> float:
        pushed = _cautious(well[count:], caution) if pushes else np.nan
        return _worst(demands.disturbed(_cautious(well[:count], caution), pushed, config))

    watch = Watch(len(starts), lambda lost: margin(~lost) < wanted)
    fall = demands.fall(config)
    outcome = simulate(creature, champion, starts, seconds, fall=fall, threads=threads, watch=watch)
    if watch.over:
        return margin(~watch.lost)
    succeeded = demands.succeeded(outcome, starts, config)
    reached = margin(np.where(np.arange(len(starts)) < count, succeeded, outcome.stayed_up))
    if reached < wanted:
        return reached
    return min(reached, _worst(told_to_turn(creature, champion, config, draw, threads)))


def _cautious(well: np.ndarray, caution: float) -> float:
    """Share of successes [S] minus `caution` standard errors."""
    share = float(well.mean())
    return share - caution * math.sqrt(share * (1 - share) / len(well))


def _worst(criteria: Sequence[Criterion]) -> float:
    """Margin of the worst criterion; infinite without criteria, so that it limits nothing."""
    return judge(criteria).margin if criteria else np.inf
