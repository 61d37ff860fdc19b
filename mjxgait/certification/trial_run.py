"""The rehearsal: one draw that is the same for all champions, on which one of them is chosen."""

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
    """The worst margin of criteria 4 and 5 on the draw that is the same for all champions.

    Champions are chosen by it, and examined on another draw. Where pushes decide it ends when those
    pushed last have had time to fall. Else it is as long as the examination: who gets to a goal late
    is late for that only.

    Args:
      count: perturbed starts, and as many pushes where those decide.
      wanted: as soon as this margin is out of reach nobody is simulated any further; returned is
        then what it would be at most.
      caution: standard errors by which the measured shares count less. A champion that was chosen
        by a share has been lucky more often than not.
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
    """Share of successes [S], less so many of its standard errors."""
    share = float(well.mean())
    return share - caution * math.sqrt(share * (1 - share) / len(well))


def _worst(criteria: Sequence[Criterion]) -> float:
    """Their margin; nothing that is not asked is in the way."""
    return judge(criteria).margin if criteria else np.inf
