"""Which task demands what."""

from collections.abc import Mapping
from typing import Any

from mjxgait.certify.tasks.follow import FollowDemands
from mjxgait.certify.tasks.hop import HopDemands
from mjxgait.certify.tasks.jump import JumpDemands
from mjxgait.certify.tasks.limbo import LimboDemands
from mjxgait.certify.tasks.plain import HasCriteria, PlainDemands
from mjxgait.certify.tasks.protocol import Demands
from mjxgait.certify.tasks.roam import RoamDemands
from mjxgait.certify.tasks.staying import StaysUp
from mjxgait.certify.tasks.swim import SwimDemands
from mjxgait.certify.tasks.travel import TravelDemands
from mjxgait.certify.tasks.walk import WalkDemands
from mjxgait.champion.blocks.material import DRAG
from mjxgait.errors import not_loaded

_DEMANDS: dict[str, Demands] = {
    "walk": WalkDemands(),
    "hop": HopDemands(),
    "limbo": LimboDemands(),
    "travel": TravelDemands(),
    "swim": SwimDemands(),
    "roam": RoamDemands(),
    "jump": JumpDemands(),
    "follow": FollowDemands(DRAG),
    "follow-on-land": FollowDemands(0.0),
}


def register_demands(task: str, own: HasCriteria) -> None:
    """Makes the demands of a task of the user's known."""
    _DEMANDS[task] = PlainDemands(own)


def demands_of(task: str, wish: Mapping[str, Any] | None = None) -> Demands:
    """Those of a task, and of what was asked besides.

    Raises:
      UserError: it is code of the user's own that was not named.
    """
    if task not in _DEMANDS:
        raise not_loaded("task", task)
    return _DEMANDS[task].asked(wish or {})


def how_simulated(task: str, wish: Mapping[str, Any] | None = None) -> Demands | StaysUp:
    """What a simulation of it must know: goals, falls, turns; of an unknown task the usual."""
    return (_DEMANDS.get(task) or StaysUp()).asked(wish or {})
