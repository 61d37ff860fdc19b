"""The reference controller of a champion."""

from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.kinds import controller_kind
from mjxgait.reference.controllers.protocol import Twin


def twin_of(creature: Creature, champion: Champion, step: float) -> Twin:
    """Return the champion's controller in NumPy. step: s.

    Raises:
      UserError: the champion is not finite, or code of the user's own that was not named.
    """
    champion.check_finite(creature)
    made: Twin = controller_kind(champion.controller).part("reference")(creature, champion, step)
    return made
