"""A run whose bodies grow is made of the same parts as every other."""

import pytest

from mjxgait.control.brains.controller import Brains
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.parts.registry import add_own
from mjxgait.parts.settings import build_config
from mjxgait.runs.blueprint import draw_up
from mjxgait.tasks.swim import Swim


class Smelling(Brains):
    """A brain with a mistake."""

    def __init__(self, *told) -> None:
        super().__init__(*told)
        self.reads = (*self.reads, "contcat")


def test_a_brain_reads_only_what_there_is_to_sense(stool: Creature):
    add_own("task", "swim", Swim)
    for kind in (Brains, Smelling):
        add_own("controller", kind.__name__, kind)
    use = {"controller": "Brains", "task": "swim"}
    simulator = draw_up(stool, build_config({"use": use}, "test")).simulator()
    assert simulator.controller.reads == ("joint_pos", "contact")
    wrong = build_config({"use": use | {"controller": "Smelling"}}, "test")
    with pytest.raises(UserError, match='there is no sense "contcat"'):
        draw_up(stool, wrong).simulator()
