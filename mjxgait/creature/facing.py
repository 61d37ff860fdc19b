"""A body that faces another way.

For evolution and certification, walking backwards is walking forward with the body turned around.
"""

import dataclasses
from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np

from mjxgait.config.tables import dump_toml
from mjxgait.creature.creature import Creature
from mjxgait.creature.scale import SETTINGS, load_files
from mjxgait.creature.settings import (
    Balance,
    CreatureSettings,
    Steering,
    Stepping,
    Usual,
)
from mjxgait.errors import UserError, did_you_mean

Way = Literal["forward", "back", "left", "right"]
WAYS: tuple[Way, ...] = get_args(Way)
Table = Mapping[str, float]


def facing(creature: Creature, way: str) -> Creature:
    """Return the creature with its forward axis turned to `way`.

    Its reflexes act on the body as before, under other names. Sideways there is no mirror, because
    the mirror image of a sidestep goes the other way, and no steering, because the correction that
    turns a walk does not turn a sidestep.

    Raises:
      UserError: there is no such way.
    """
    if way not in WAYS:
        raise UserError(f"--way {way}: {did_you_mean(way, WAYS)}")
    if way == "forward":
        return creature
    ahead = {"back": -creature.frame.forward, "left": creature.frame.left}
    axis = ahead.get(way, -creature.frame.left)
    settings = _turned(creature.settings, way, axis)
    return load_files({**creature.files, SETTINGS: dump_toml(settings)})


def _turned(settings: CreatureSettings, way: str, axis: np.ndarray) -> CreatureSettings:
    # The defaults apply to walking forward; they may not fit another way.
    settings = dataclasses.replace(settings, usual=Usual())
    balance, stepping, steering = settings.balance, settings.stepping, settings.steering
    x, y, z = np.round(axis, 9) + 0.0
    identity = dataclasses.replace(
        settings.creature,
        name=f"{settings.creature.name}_{way}",
        forward=(float(x), float(y), float(z)),
    )
    if way == "back":
        steering = Steering(_times(steering.bend, -1), _times(steering.stride, -1))
        balance = Balance(_times(balance.pitch, -1), _times(balance.roll, -1))
        stepping = Stepping(_times(stepping.ahead, -1), _times(stepping.aside, -1), stepping.turn)
        return dataclasses.replace(
            settings, creature=identity, steering=steering, balance=balance, stepping=stepping
        )
    # The body is now as long as it was wide, so the stated length is dropped. Roll to the right
    # becomes pitch towards the right side, and likewise all around.
    sign = 1 if way == "right" else -1
    return dataclasses.replace(
        settings,
        creature=dataclasses.replace(identity, body_length=None),
        mirror=dataclasses.replace(settings.mirror, symmetric=False, pairs=()),
        steering=Steering(),
        balance=Balance(_times(balance.roll, sign), _times(balance.pitch, -sign)),
        stepping=Stepping(
            _times(stepping.aside, -sign), _times(stepping.ahead, sign), stepping.turn
        ),
    )


def _times(table: Table, sign: int) -> dict[str, float]:
    return {pattern: sign * weight for pattern, weight in table.items()}
