"""The rehearsal: one draw that is the same for all champions, on which one of them is chosen."""

from collections.abc import Sequence

import numpy as np

from mjxgait.certify import draws
from mjxgait.certify.config import CertificateConfig
from mjxgait.certify.criteria import Criterion
from mjxgait.certify.draws import AIMS
from mjxgait.certify.simulate import simulate
from mjxgait.certify.starts import Starts, join
from mjxgait.certify.steering import told_to_turn
from mjxgait.certify.tasks import demands_of
from mjxgait.champion import Champion
from mjxgait.creature import Creature

FIRST = 4
"""Divides the starts: after so small a share of them the worst are told from the good."""


def rehearse(
    creature: Creature,
    champion: Champion,
    count: int,
    config: CertificateConfig | None = None,
    threads: int = 0,
    wanted: float = -np.inf,
) -> float:
    """The worst margin of criteria 4 and 5 on the draw that is the same for all champions.

    Champions are chosen by it, and examined on another draw. Where pushes decide it ends when those
    pushed last have had time to fall. Else it is as long as the examination: who gets to a goal late
    is late for that only.

    Args:
      count: perturbed starts, and as many pushes where those decide.
      wanted: a margin that is out of reach after the first of them ends it; returned is then
        what it would be at most.
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
    fall, well, margin = demands.fall(config), np.ones(len(starts), bool), np.inf
    first = np.arange(len(starts)) % count < max(count // FIRST, 1)
    for rows in filter(len, (np.flatnonzero(first), np.flatnonzero(~first))):
        mine = starts.rows(rows)
        outcome = simulate(creature, champion, mine, seconds, fall=fall, threads=threads)
        succeeded = demands.succeeded(outcome, mine, config)
        well[rows] = np.where(rows < count, succeeded, outcome.stayed_up)
        pushed = float(well[count:].mean()) if pushes else np.nan
        margin = _worst(demands.disturbed(float(well[:count].mean()), pushed, config))
        if margin < wanted:
            return margin
    return min(margin, _worst(told_to_turn(creature, champion, config, draw, threads)))


def _worst(criteria: Sequence[Criterion]) -> float:
    return min((criterion.margin for criterion in criteria), default=np.inf)
