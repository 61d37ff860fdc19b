"""A run whose bodies grow is made of the same parts as every other."""

from pathlib import Path
from typing import Any

import pytest

from mjxgait.champion.blocks.material import DRAG
from mjxgait.control.brains.controller import Brains
from mjxgait.errors import UserError
from mjxgait.library import load_creature
from mjxgait.parts.registry import add_own
from mjxgait.parts.settings import build_config
from mjxgait.physics.trees.tree import Surroundings
from mjxgait.runs.blueprint import draw_up
from mjxgait.runs.folder import create_run
from mjxgait.simulation.rollout import Simulator


class Smelling(Brains):
    """A brain with a mistake."""

    def __init__(self, *told: Any) -> None:
        super().__init__(*told)
        self.reads = (*self.reads, "contcat")


def swimmer(controller: str) -> Simulator:
    use = {"controller": controller, "task": "swim"}
    return draw_up(load_creature("blocks"), build_config({"use": use}, "test")).simulator()


def test_a_brain_reads_only_what_there_is_to_sense():
    add_own("controller", "smelling", Smelling)
    assert swimmer("brain").controller.reads == ("joint_pos", "contact")
    with pytest.raises(UserError, match='there is no sense "contcat"'):
        swimmer("smelling")


def test_who_swims_has_water_and_neither_ground_nor_weight():
    plant: Any = swimmer("brain").plant
    assert plant.around == Surroundings(step=0.01, floor=False, gravity=0.0, drag=DRAG)


@pytest.mark.parametrize(
    ("env", "given", "said"),
    [
        ("tall_quadruped", {"use": {"controller": "brain"}}, "its body is there already"),
        ("tall_quadruped", {"use": {"task": "swim"}}, "only bodies that grow"),
        ("blocks", {"use": {"task": "swim"}}, "poses has nothing to move"),
        ("blocks", {"use": {"controller": "brain"}}, "cannot walk yet, only swim"),
        (
            "blocks",
            {"use": {"controller": "brain", "task": "swim"}, "rollout": {"ground": "bumps:0.05"}},
            "rollout.ground is for a body that is there",
        ),
    ],
)
def test_who_does_not_fit_is_refused_in_one_sentence(
    env: str, given: dict[str, Any], said: str, tmp_path: Path
):
    creature, config = load_creature(env), build_config(given, "test")
    for asked in (
        lambda: draw_up(creature, config),
        lambda: create_run(tmp_path, creature, config),
    ):
        with pytest.raises(UserError, match=f"{env}: .*{said}"):
            asked()
    assert not list(tmp_path.iterdir()), "before anything is written"
