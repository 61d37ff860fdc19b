"""Each condition of a fall, in a simulation that meets no other."""

import numpy as np
import pytest
from certify_made_up import make_champion

from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.outcome import Fall
from mjxgait.reference.starts import Starts, nominal_starts, pushed_starts

ANYHOW = {"min_up": -1.0, "height": (0.001, 100.0), "touch": False}


def flat(creature: Creature) -> Champion:
    """Champion that lies down on its belly, upright."""
    return make_champion(creature, np.tile([1.0, 1.4], (2, 4)))


def knocked(creature: Creature) -> Starts:
    return pushed_starts(creature, 1, np.random.default_rng(0), 6.0, (0.1, 0.1))


def falls(creature: Creature, champion: Champion, starts: Starts, **fall: object) -> bool:
    outcome = simulate(creature, champion, starts, 1.5, fall=Fall(**{**ANYHOW, **fall}))
    return bool(np.isfinite(outcome.fell[0]))


@pytest.mark.parametrize(
    "fall", [{"touch": True}, {"height": (0.5, 100.0)}], ids=["touches", "too low"]
)
def test_lying_on_the_belly_is_a_fall(tiny: Creature, fall: dict):
    starts = nominal_starts(tiny, 1)
    assert falls(tiny, flat(tiny), starts, **fall)
    assert not falls(tiny, flat(tiny), starts)
    assert not falls(tiny, make_champion(tiny), starts, **fall)


def test_tipping_over_is_a_fall(tiny: Creature):
    still = make_champion(tiny)
    assert falls(tiny, still, knocked(tiny), min_up=0.5)
    assert not falls(tiny, still, knocked(tiny))
    assert not falls(tiny, still, nominal_starts(tiny, 1), min_up=0.5)


def test_rising_too_high_is_a_fall(tiny: Creature):
    """A knock against its feet throws it up."""
    still = make_champion(tiny)
    assert falls(tiny, still, knocked(tiny), height=(0.001, 1.05))
    assert not falls(tiny, still, nominal_starts(tiny, 1), height=(0.001, 1.05))
