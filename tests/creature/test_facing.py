"""`--way`: the same body with another side as its front."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import STOOL, said_by
from scipy.spatial.transform import Rotation

from mjxgait.api import load_creature
from mjxgait.config.schema import Config
from mjxgait.controllers.observations import SENSES
from mjxgait.creature import Creature
from mjxgait.creature.scale import WAYS, facing
from mjxgait.creature.settings import Balance, Steering, Stepping
from mjxgait.errors import UserError
from mjxgait.plugins import resolve_config
from mjxgait.training.folder import create_run, open_run

RNG = np.random.default_rng(5)


@pytest.fixture(scope="module")
def rich(stool: Creature) -> Creature:
    """The stool with every kind of weight for every joint."""

    def table() -> dict[str, float]:
        return {name: float(RNG.normal()) for name in stool.joints.names}

    settings = dataclasses.replace(
        stool.settings,
        balance=Balance(table(), table()),
        steering=Steering(table(), table()),
        stepping=Stepping(table(), table(), table()),
    )
    return dataclasses.replace(stool, settings=settings)


def weights(creature: Creature, table: dict[str, float]) -> np.ndarray:
    return np.array([table[name] for name in creature.joints.names])


@pytest.mark.parametrize("way", WAYS[1:])
def test_facing_turns_the_axes_but_not_the_standing_pose(stool: Creature, way: str):
    turned, frame = facing(stool, way), stool.frame
    ahead = {"back": -frame.forward, "left": frame.left, "right": -frame.left}[way]
    np.testing.assert_allclose(turned.frame.forward, ahead, atol=1e-9)
    np.testing.assert_allclose(turned.frame.up, frame.up, atol=1e-9)
    np.testing.assert_allclose(turned.frame.left, np.cross(frame.up, ahead), atol=1e-9)
    np.testing.assert_array_equal(turned.stand_qpos, stool.stand_qpos)
    assert turned.frame.hip_height == stool.frame.hip_height
    assert turned.joints.names == stool.joints.names
    assert turned.name == f"{stool.name}_{way}"
    assert turned.files["creature.xml"] == stool.files["creature.xml"]


@pytest.mark.parametrize("way", WAYS[1:])
def test_the_response_to_a_fall_does_not_depend_on_the_front(rich: Creature, way: str):
    """Balance and stepping add up to the same angles, whichever side is the front."""
    turned = facing(rich, way)

    def answer(creature: Creature, rotation: np.ndarray, fall: np.ndarray) -> np.ndarray:
        """Angles [J]. rotation: of the trunk; fall: [2] m along world x and y, the way to step."""
        sensed = SimpleNamespace(trunk_rot=rotation)
        pitch, roll = (float(SENSES[name](creature, sensed, 0.0)) for name in ("pitch", "roll"))
        ahead, left = (fall @ axis[:2] for axis in creature.frame.start_axes)
        tables = creature.settings
        return (
            pitch * weights(creature, tables.balance.pitch)
            + roll * weights(creature, tables.balance.roll)
            + ahead * weights(creature, tables.stepping.ahead)
            + left * weights(creature, tables.stepping.aside)
        )

    for _ in range(5):
        tilt = Rotation.from_rotvec(RNG.normal(scale=0.3, size=3)).as_matrix()
        moment = tilt @ rich.frame.stand_rot, RNG.normal(size=2)
        np.testing.assert_allclose(answer(turned, *moment), answer(rich, *moment), atol=1e-5)


def test_facing_back_reverses_steering_and_keeps_the_mirror(rich: Creature):
    """Like a car in reverse: what turned it left turns it right."""
    back = facing(rich, "back")
    for table in ("bend", "stride"):
        mine, its = (getattr(c.settings.steering, table) for c in (rich, back))
        np.testing.assert_allclose(weights(back, its), -weights(rich, mine))
    assert back.settings.stepping.turn == rich.settings.stepping.turn, "its hips turn as they did"
    np.testing.assert_array_equal(back.mirror.partner, rich.mirror.partner)
    np.testing.assert_array_equal(back.mirror.sign, rich.mirror.sign)
    again = facing(back, "back")
    np.testing.assert_allclose(again.frame.forward, rich.frame.forward, atol=1e-9)
    assert again.settings.balance == rich.settings.balance


@pytest.mark.parametrize("way", ["left", "right"])
def test_facing_aside_keeps_the_turning_of_the_hips(rich: Creature, way: str):
    """Left of the direction of travel stays left, whatever that direction is."""
    assert facing(rich, way).settings.stepping.turn == rich.settings.stepping.turn


@pytest.mark.parametrize("way", ["back", "left", "right"])
def test_first_steps_another_way_may_be_bad(rich: Creature, way: str):
    usual, turned = (
        resolve_config(c.settings.train, c.name).fitness.leniency for c in (rich, facing(rich, way))
    )
    assert (usual, turned) == (0.0, 1.0)


def test_facing_aside_takes_the_width_as_length(stool: Creature):
    """It has neither a mirror nor a given length: its mirror image walks the other way."""
    stated = dataclasses.replace(stool.settings.creature, body_length=3.0)
    long = dataclasses.replace(stool, settings=dataclasses.replace(stool.settings, creature=stated))
    for way in ("left", "right"):
        aside = facing(long, way)
        assert not aside.mirror.symmetric
        assert aside.settings.steering == Steering()
        assert aside.frame.body_length < 1.0
    assert facing(long, "back").frame.body_length == 3.0


def test_a_run_keeps_the_way(tmp_path: Path):
    creature = load_creature(STOOL, way="back")
    folder = create_run(tmp_path / "run", creature, Config())
    kept, _ = open_run(folder)
    np.testing.assert_array_equal(kept.frame.forward, creature.frame.forward)
    assert kept.digest == creature.digest


def test_facing_forward_changes_nothing(stool: Creature):
    assert facing(stool, "forward") is stool


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--env", STOOL, "--way", "backwards"), 'did you mean "back"'),
        (("--env", STOOL, "--way", "up"), "known: back, forward, left, right"),
    ],
)
def test_mistakes_are_reported_in_one_sentence(arguments, words, capsys: pytest.CaptureFixture):
    assert words in said_by(capsys, "train", *arguments, code=2)
    with pytest.raises(UserError, match="--way"):
        load_creature(STOOL, way="up")


def test_a_resumed_run_keeps_its_way(tmp_path: Path, stool: Creature, capsys):
    folder = create_run(tmp_path / "run", stool, Config())
    said = said_by(capsys, "train", "--resume", folder, "--way", "back", code=2)
    assert "--way need" in said
