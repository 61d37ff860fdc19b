"""A run whose bodies grow is made of the same parts as every other."""

from typing import Any

import pytest

from mjxgait.control.brains.controller import Brains
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.parts.registry import add_own
from mjxgait.parts.settings import build_config
from mjxgait.physics.trees.tree import Surroundings
from mjxgait.runs.blueprint import DRAG, draw_up
from mjxgait.simulation.rollout import Simulator
from mjxgait.tasks.swim import Swim


class Smelling(Brains):
    """A brain with a mistake."""

    def __init__(self, *told: Any) -> None:
        super().__init__(*told)
        self.reads = (*self.reads, "contcat")


def swimmer(stool: Creature, controller: type) -> Simulator:
    """The stool lends its time step."""
    add_own("task", "swim", Swim)
    add_own("controller", controller.__name__, controller)
    use = {"controller": controller.__name__, "task": "swim"}
    return draw_up(stool, build_config({"use": use}, "test")).simulator()


def test_a_brain_reads_only_what_there_is_to_sense(stool: Creature):
    assert swimmer(stool, Brains).controller.reads == ("joint_pos", "contact")
    with pytest.raises(UserError, match='there is no sense "contcat"'):
        swimmer(stool, Smelling)


def test_who_swims_has_water_and_neither_ground_nor_weight(stool: Creature):
    plant: Any = swimmer(stool, Brains).plant
    step = float(stool.model.opt.timestep)
    assert plant.around == Surroundings(step=step, floor=False, gravity=0.0, drag=DRAG)
