"""Loading rejects what evolution would ignore, and accepts decoration."""

import shutil
from pathlib import Path

import pytest
from helpers import STOOL

from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model

FLOOR = '<geom name="floor"'
FREE = "1 0 0 0 0 0 0 0"


def with_things(tmp_path: Path, things: str, qpos: str = "", more: str = "") -> Creature:
    """The stool with other things in its world. qpos: their part of the keyframe."""
    shutil.copytree(STOOL, tmp_path / "stool")
    file = tmp_path / "stool" / "creature.xml"
    text = file.read_text().replace(FLOOR, things + FLOOR)
    text = text.replace('<key name="stand" qpos="', f'<key name="stand" qpos="{qpos} ')
    file.write_text(text.replace("</worldbody>", "</worldbody>" + more))
    return load_creature(tmp_path / "stool")


BALL = '<body name="ball" pos="2 0 1"><freejoint/><geom size="0.1"/></body>'
DOOR = '<body name="door" pos="2 0 1"><joint/><geom size="0.1" contype="0" conaffinity="0"/></body>'
BITS = 'contype="{bits}" conaffinity="{bits}"'
STEP = f'<geom {{name}} type="box" size="0.1 0.1 0.1" pos="1 0 0.1" {BITS}/>'


@pytest.mark.parametrize(
    ("things", "qpos", "words"),
    [
        (BALL, "2 0 1 1 0 0 0", 'body "ball" moves but is no part of "trunk"'),
        (DOOR, "0", 'body "door" moves but is no part of "trunk"'),
        (STEP.format(name='name="step"', bits=3), "", 'geom "step" stands in the world'),
        (
            f'<body name="shelf">{STEP.format(name="", bits=3)}</body>',
            "",
            'a geom without name (number 1, in body "shelf") stands in the world',
        ),
        (
            '<geom name="wall" type="plane" size="1 1 1" zaxis="-1 0 0" contype="3"/>',
            "",
            'geom "wall"',
        ),
    ],
)
def test_other_things_in_the_world_are_rejected(tmp_path: Path, things: str, qpos: str, words: str):
    with pytest.raises(UserError) as error:
        with_things(tmp_path, things, qpos)
    assert words in str(error.value)
    assert "take the" in str(error.value)
    assert str(tmp_path / "stool") in str(error.value)
    assert "\n" not in str(error.value)


def test_a_geom_with_only_an_explicit_contact_pair_is_rejected(tmp_path: Path):
    pair = '<contact><pair geom1="step" geom2="front_left_foot"/></contact>'
    with pytest.raises(UserError, match='geom "step"'):
        with_things(tmp_path, STEP.format(name='name="step"', bits=0), more=pair)


@pytest.mark.parametrize(
    "things",
    [
        STEP.format(name='name="picture"', bits=0),
        STEP.format(name='name="ghost"', bits=8),
        '<body name="frame"><geom size="0.1" contype="0" conaffinity="0"/></body>',
        '<light pos="0 0 3"/><camera name="far" pos="0 -3 1"/>',
    ],
    ids=["silent", "other bits", "in a body", "light"],
)
def test_decoration_is_allowed(tmp_path: Path, things: str):
    assert with_things(tmp_path, things).name == "stool"


def test_an_import_reports_what_it_leaves_out(tmp_path: Path):
    """An import drops the scene around a creature, with a note."""
    text = (STOOL / "creature.xml").read_text()
    step = STEP.format(name='name="step"', bits=3)
    text = text[: text.index("<keyframe>")] + "</mujoco>"
    (tmp_path / "scene.xml").write_text(text.replace(FLOOR, BALL + step + FLOOR))
    notes = import_model(tmp_path / "scene.xml", ImportChoices(apart=False)).notes
    told = [change.what for change in notes.changes]
    assert 'left out: body "ball" (2.09 kg), geom "step"' in told
