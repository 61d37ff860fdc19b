"""Which task demands what."""

import functools
from collections.abc import Mapping
from typing import Any

from mjxgait.certification.tasks.plain import HasCriteria, PlainDemands
from mjxgait.certification.tasks.protocol import Demands
from mjxgait.certification.tasks.staying import StaysUp
from mjxgait.errors import not_loaded

_OWN: dict[str, Demands] = {}


@functools.cache
def _shipped() -> Mapping[str, Demands]:
    """Return the demands of the shipped tasks; imported late, for each of them imports this package."""
    from mjxgait.controllers.sims_brain.reference_body.material import DRAG
    from mjxgait.tasks.hop.criteria import HopDemands
    from mjxgait.tasks.hop.limbo_criteria import LimboDemands
    from mjxgait.tasks.hop.travel_criteria import TravelDemands
    from mjxgait.tasks.modular.follow_criteria import FollowDemands
    from mjxgait.tasks.modular.jump_criteria import JumpDemands
    from mjxgait.tasks.modular.roam_criteria import RoamDemands
    from mjxgait.tasks.modular.swim_criteria import SwimDemands
    from mjxgait.tasks.walk.criteria import WalkDemands

    return {
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


def _find(task: str) -> Demands | None:
    return _OWN.get(task) or _shipped().get(task)


def register_demands(task: str, own: HasCriteria) -> None:
    """Makes the demands of a task of the user's known."""
    _OWN[task] = PlainDemands(own)


def demands_of(task: str, wish: Mapping[str, Any] | None = None) -> Demands:
    """Those of a task, and of what was asked besides.

    Raises:
      UserError: it is code of the user's own that was not named.
    """
    found = _find(task)
    if found is None:
        raise not_loaded("task", task)
    return found.asked(wish or {})


def how_simulated(task: str, wish: Mapping[str, Any] | None = None) -> Demands | StaysUp:
    """What a simulation of it must know: goals, falls, turns; of an unknown task the usual."""
    return (_find(task) or StaysUp()).asked(wish or {})
