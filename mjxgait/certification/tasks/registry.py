"""Which task demands what."""

from collections.abc import Mapping
from typing import Any

from mjxgait.certification.tasks.plain import HasCriteria, PlainDemands
from mjxgait.certification.tasks.protocol import Demands
from mjxgait.certification.tasks.staying import StaysUp
from mjxgait.controllers.sims_brain.reference_body.material import DRAG
from mjxgait.errors import not_loaded
from mjxgait.tasks.hop.criteria import HopDemands
from mjxgait.tasks.hop.limbo_criteria import LimboDemands
from mjxgait.tasks.hop.travel_criteria import TravelDemands
from mjxgait.tasks.modular.follow_criteria import FollowDemands
from mjxgait.tasks.modular.jump_criteria import JumpDemands
from mjxgait.tasks.modular.roam_criteria import RoamDemands
from mjxgait.tasks.modular.swim_criteria import SwimDemands
from mjxgait.tasks.walk.criteria import WalkDemands

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
