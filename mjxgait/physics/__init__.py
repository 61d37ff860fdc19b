"""Batched rigid-body physics behind the `Plant` protocol."""

from typing import Literal

from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.physics.fast import UnsupportedModel, fast_plant
from mjxgait.physics.layout import sense_layout
from mjxgait.physics.plain import mjx_plant
from mjxgait.types import Plant


def make_plant(
    creature: Creature, physics: Literal["auto", "mjx"], touch_ends: bool
) -> tuple[Plant, int]:
    """The plant of a creature, and how many lanes per device suit it.

    Args:
      touch_ends: whether an episode ends when a part touches the floor that must not.

    Raises:
      UserError: MJX does not support something in the model; in its words.
    """
    model, layout = creature.model_where(touch_ends), sense_layout(creature)
    if physics == "auto":
        try:
            return fast_plant(model, layout), 64
        except UnsupportedModel:
            pass
    try:
        return mjx_plant(model, layout), 16
    except NotImplementedError as error:
        raise UserError(
            f"{creature.name}: creature.xml uses what MJX does not support: {error}"
        ) from None
