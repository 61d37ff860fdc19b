"""Which runs share compiled programs; `test_library` covers other bodies and sizes."""

import dataclasses

import pytest
from helpers import small_config

from mjxgait import kinds
from mjxgait.creature import Creature
from mjxgait.plugins import registry
from mjxgait.training.experiment import program_key


def test_numbers_do_not_change_the_program_key(stool: Creature):
    """Nor does the seed; the lock held during compilation keeps its name too."""
    config = small_config(drive={"law": "pd"}, fitness={"weights": {"slip": 3.0}})
    one, other = (
        program_key(stool, each) for each in (small_config(), dataclasses.replace(config, seed=5))
    )
    assert one == other
    assert hash(one) == hash(other)
    assert one.name("evaluate") == other.name("evaluate") != one.name("absorb")


@pytest.mark.parametrize("kind", ["controller", "task"])
def test_redefined_code_of_the_same_name_changes_the_program_key(
    stool: Creature, kind: str, monkeypatch: pytest.MonkeyPatch
):
    before = program_key(stool, small_config())
    name = getattr(small_config().use, kind)
    own = type(name, (registry.find(kind, name),), {})
    shipped = kinds.shipped(kind)[name]
    monkeypatch.setitem(kinds._OWN, (kind, name), dataclasses.replace(shipped, **{kind: own}))
    assert program_key(stool, small_config()) != before
