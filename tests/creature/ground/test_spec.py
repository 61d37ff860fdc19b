"""The ground as text: what is accepted, and the errors for the rest."""

import pytest

from mjxgait.config.schema import Config
from mjxgait.config.tables import build
from mjxgait.config.traced import traced
from mjxgait.creature.ground.spec import LEVEL, GroundSpec, parse_ground
from mjxgait.errors import UserError

TEXTS = {
    "flat": LEVEL,
    "slope:0.1": GroundSpec("slope", 0.1, "up"),
    "slope:0.1:across": GroundSpec("slope", 0.1, "across"),
    "steps:0.05:down@3": GroundSpec("steps", 0.05, "down", 3),
    "bumps:0.05": GroundSpec("bumps", 0.05),
    "rough:0.05@12": GroundSpec("rough", 0.05, "", 12),
}


@pytest.mark.parametrize("text", TEXTS)
def test_ground_texts_survive_a_round_trip(text: str):
    assert parse_ground(text) == TEXTS[text]
    assert str(TEXTS[text]) == text


@pytest.mark.parametrize(
    ("text", "told"),
    {
        "ruogh:0.05": "no ground",
        "rough": "no ground",
        "rough:": "no ground",
        "rough:high": "no size",
        "rough:nan": "no size",
        "rough:-0.1": "no size",
        "slope:5": "no size",
        "rough:0.05:up": "no direction",
        "slope:0.1:left": "no direction",
        "slope:0.1@3": "no seed",
    }.items(),
)
def test_the_error_names_the_key_and_the_allowed_values(text: str, told: str):
    with pytest.raises(UserError) as error:
        build(Config, {"rollout": {"ground": text}}, "mine.toml")
    for part in ("mine.toml", "rollout.ground", text, told, "rough:S"):
        assert part in str(error.value)


def test_only_the_kind_of_ground_changes_the_program():
    """So a study can compare heights in one program."""

    def shape(ground: str) -> object:
        config = build(Config, {"rollout": {"ground": ground}}, "test")
        return traced(config).rollout.ground

    assert shape("rough:0.05@3") == shape("rough:0.1") == "rough"
    assert shape("flat") == "flat"
