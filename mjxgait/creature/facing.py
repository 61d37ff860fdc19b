"""A body of which another side is ahead: who walks backwards is one who faces the other way and
walks forward, for evolution and for the examiner.
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
    """The creature whose forward axis points where `way` is now.

    What its reflexes do to the body stays the same: a fall to its old front is answered as ever, by
    another name. The mirror image of a sidestep goes the other way, so who goes aside has no mirror;
    nor has it steering, for what turns a walk does not turn a sidestep.

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
    # What is usual ahead is not known to be so the other way round.
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
    # It is as long as it was wide, and what was roll to the right is a pitch towards the right side, and likewise all around.
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
