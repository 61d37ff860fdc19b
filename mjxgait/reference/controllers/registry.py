"""Which twin moves which kind of champion."""

from collections.abc import Callable

from mjxgait.champion import Champion
from mjxgait.controllers.expressions.reference import ProgramTwin
from mjxgait.controllers.key_poses.reference import PoseTwin
from mjxgait.controllers.sims_brain.reference import BrainTwin
from mjxgait.controllers.sims_brain.reference_body.parts import grow
from mjxgait.creature import Creature
from mjxgait.errors import not_loaded
from mjxgait.reference.controllers.protocol import Twin

Maker = Callable[[Creature, Champion, float], Twin]
"""From creature, champion and step in s."""


def _brain(creature: Creature, champion: Champion, step: float) -> Twin:
    """creature: the champion's own, which has grown. Its hinges are called `part3_0`."""
    parts = grow(champion.genome, champion.settings.parts, champion.settings.links)
    names = [name.removeprefix("part").split("_") for name in creature.joints.names]
    hinges = [(int(part), int(hinge)) for part, hinge in names]
    return BrainTwin(champion.genome, parts, hinges, step, champion.settings.every)


_TWINS: dict[str, Maker] = {"poses": PoseTwin, "program": ProgramTwin, "brain": _brain}


def register_twin(controller: str, make: Maker) -> None:
    """Makes the twins of a kind of controller known."""
    _TWINS[controller] = make


def twin_of(creature: Creature, champion: Champion, step: float) -> Twin:
    """The champion's controller.

    Raises:
      UserError: the champion is not finite, or code of the user's own that was not named.
    """
    champion.check_finite(creature)
    if champion.controller not in _TWINS:
        raise not_loaded("controller", champion.controller)
    return _TWINS[champion.controller](creature, champion, step)
