"""Faults that a file states plainly: limits the wrong way round, zero masses, joints in a ring."""

from pathlib import Path

import numpy as np
import pytest
from importer.models import BIPED, QUADRUPED, bring, told

from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model

FIXED = '<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


def biped(more: str) -> str:
    return BIPED.replace("</robot>", more + "</robot>")


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        (QUADRUPED.replace('range="-60 60"', 'range="60 -60"', 1), "xml", "joints fl_hip swapped"),
        (
            BIPED.replace('lower="-1.2" upper="1.2"', 'lower="1.2" upper="-1.2"', 1),
            "urdf",
            'joint "left_hip_roll" swapped',
        ),
    ],
)
@pytest.mark.usefixtures("a_short_search")
def test_limits_in_the_wrong_order_are_swapped_and_reported(
    text: str, kind: str, said: str, tmp_path: Path
):
    right, _ = bring(tmp_path, QUADRUPED if kind == "xml" else BIPED, kind)
    creature, imported = bring(tmp_path, text, kind)
    assert told(imported, said)
    np.testing.assert_allclose(creature.model.jnt_range, right.model.jnt_range)


@pytest.mark.usefixtures("a_short_search")
def test_a_mass_of_zero_with_shapes_is_reported(tmp_path: Path):
    shape = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    inertial = '<inertial><mass value="0"/></inertial>'
    on_the_trunk = FIXED.format(name="n", parent="trunk", child="box")
    plain, _ = bring(tmp_path, BIPED, "urdf")
    with_box, imported = bring(
        tmp_path,
        biped(f'<link name="box">{inertial}{shape}</link>{on_the_trunk}'),
        "urdf",
    )
    assert told(imported, 'mass of link "box" taken from its shapes')
    assert with_box.model.body_mass.sum() == pytest.approx(plain.model.body_mass.sum() + 1.0)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('<link name="trunk"/>', 'two links are named "trunk"'),
        (FIXED.format(name="left_knee", parent="trunk", child="x"), 'two joints are named "left_k'),
        (FIXED.format(name="n", parent="trunk", child="left_fot"), 'did you mean "left_foot"'),
        (
            FIXED.format(name="n", parent="left_foot", child="right_foot"),
            'link "right_foot" is the child of two joints',
        ),
        (FIXED.format(name="n", parent="left_foot", child="trunk"), "lead back to it"),
    ],
)
def test_joints_that_form_no_tree_are_named(more: str, said: str, tmp_path: Path):
    file = tmp_path / "robot.urdf"
    file.write_text(biped(more), encoding="utf-8")
    with pytest.raises(UserError, match=said):
        import_model(file, ImportChoices(apart=False))
