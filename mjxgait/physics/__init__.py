"""Batched rigid-body physics behind the `Plant` protocol."""

from typing import TypeVar

import mujoco

from mjxgait.config.schema import Physics
from mjxgait.creature import Creature
from mjxgait.creature.overlap import find_crossings
from mjxgait.errors import UserError
from mjxgait.physics.derived import OtherTopology, observation_layout
from mjxgait.physics.lane_major import UnsupportedModel, lane_major_plant
from mjxgait.physics.lane_major.model import check_supported
from mjxgait.types import ModelPlant

Parameters = TypeVar("Parameters")

SLOWER = "16 to 32"
"""Factor by which plain MJX is slower per creature-step (docs/research/performance.md)."""


def make_plant(
    creature: Creature, physics: Physics, touch_ends: bool, padded: bool = False
) -> tuple[ModelPlant, int]:
    """Return the plant of a creature, and a suitable number of lanes per device.

    Args:
      touch_ends: whether an episode ends when a part touches the floor that must not.
      padded: whether the program must also serve bodies with other shapes.

    Raises:
      UserError: MJX does not support something in the model; the message quotes MJX.
    """
    model, layout = creature.model_where(touch_ends), observation_layout(creature)
    crossings = find_crossings(creature)
    note = ""
    if physics == "auto":
        try:
            return lane_major_plant(model, layout, crossings, padded), 64
        except UnsupportedModel as reason:
            note = _cost(reason)
    # MJX and the geometry package that it needs take half a second to import.
    from mjxgait.physics.mjx import mjx_plant

    try:
        return mjx_plant(model, layout, crossings, note), 16
    except NotImplementedError as error:
        raise UserError(
            f"{creature.name}: creature.xml uses what MJX does not support: {error}"
        ) from None


def parameters_of(
    plant: ModelPlant[object, Parameters], creature: Creature, touch_ends: bool
) -> Parameters:
    """Return the numbers of a creature for the plant of another one of the same topology.

    Raises:
      UserError: the creatures differ in more than numbers.
    """
    model, layout = creature.model_where(touch_ends), observation_layout(creature)
    try:
        return plant.parameters_of(model, layout, find_crossings(creature))
    except OtherTopology as reason:
        raise UserError(
            f"{creature.name} needs a program of its own, for its topology is another: {reason}"
        ) from None


def fallback_note(model: mujoco.MjModel) -> str:
    """Describe the element that rules out the lane-major physics, and the cost; empty if none."""
    try:
        check_supported(model)
    except UnsupportedModel as reason:
        return _cost(reason)
    return ""


def _cost(reason: UnsupportedModel) -> str:
    return (
        f"Plain MJX simulates this creature; a step takes {SLOWER} times as long as in the fast "
        f"physics, which does not support this: {reason}"
    )
