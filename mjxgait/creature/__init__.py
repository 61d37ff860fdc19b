"""Creature folders, and the static facts of a `Creature`."""

from mjxgait.creature.creature import Creature
from mjxgait.creature.load import load_creature
from mjxgait.creature.settings import CreatureSettings

__all__ = ["Creature", "CreatureSettings", "load_creature"]
