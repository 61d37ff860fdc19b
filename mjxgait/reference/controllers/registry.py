"""Which twin moves which kind of champion."""

import functools
from collections.abc import Callable, Mapping

from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.errors import not_loaded
from mjxgait.reference.controllers.protocol import Twin

Maker = Callable[[Creature, Champion, float], Twin]
"""From creature, champion and step in s."""


_OWN: dict[str, Maker] = {}


@functools.cache
def _shipped() -> Mapping[str, Maker]:
    """Return the makers of shipped twins; imported late, for each of them imports this package."""
    from mjxgait.controllers.expressions.reference import ProgramTwin
    from mjxgait.controllers.key_poses.reference import PoseTwin
    from mjxgait.controllers.sims_brain.reference import brain_twin

    return {"poses": PoseTwin, "program": ProgramTwin, "brain": brain_twin}


def register_twin(controller: str, make: Maker) -> None:
    """Makes the twins of a kind of controller known."""
    _OWN[controller] = make


def twin_of(creature: Creature, champion: Champion, step: float) -> Twin:
    """The champion's controller.

    Raises:
      UserError: the champion is not finite, or code of the user's own that was not named.
    """
    champion.check_finite(creature)
    make = _OWN.get(champion.controller) or _shipped().get(champion.controller)
    if make is None:
        raise not_loaded("controller", champion.controller)
    return make(creature, champion, step)
