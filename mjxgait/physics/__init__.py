"""Batched rigid-body physics behind the `Plant` protocol."""

from typing import Literal

import mujoco

from mjxgait.creature import Creature
from mjxgait.creature.overlap import find_crossings
from mjxgait.errors import UserError
from mjxgait.physics.fast import UnsupportedModel, fast_plant
from mjxgait.physics.fast.support import check_supported
from mjxgait.physics.layout import sense_layout
from mjxgait.physics.plain import mjx_plant
from mjxgait.types import Plant

SLOWER = "15 to 30"
"""How many times as long a creature-step takes in plain MJX (docs/performance.md)."""


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
    crossings = find_crossings(creature)
    note = ""
    if physics == "auto":
        try:
            return fast_plant(model, layout, crossings), 64
        except UnsupportedModel as reason:
            note = _cost(reason)
    try:
        return mjx_plant(model, layout, crossings, note), 16
    except NotImplementedError as error:
        raise UserError(
            f"{creature.name}: creature.xml uses what MJX does not support: {error}"
        ) from None


def fallback_note(model: mujoco.MjModel) -> str:
    """Which element keeps a model from the fast physics, and the cost; empty if nothing does."""
    try:
        check_supported(model)
    except UnsupportedModel as reason:
        return _cost(reason)
    return ""


def _cost(reason: UnsupportedModel) -> str:
    return (
        f"Plain MJX simulates this creature; a step takes {SLOWER} times as long as in the fast "
        f"physics, which does not know this: {reason}"
    )
