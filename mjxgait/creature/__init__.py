"""From a creature folder to the static facts of a `Creature`."""

from mjxgait.creature.load import Creature, load_creature
from mjxgait.creature.settings import CreatureSettings

__all__ = ["Creature", "CreatureSettings", "load_creature"]
