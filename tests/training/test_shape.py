"""Which runs share compiled programs; other bodies and sizes are tried in `test_library`."""

import dataclasses

import pytest
from helpers import small_config

from mjxgait import kinds
from mjxgait.creature import Creature
from mjxgait.plugins import registry
from mjxgait.training.experiment import program_key


def test_numbers_are_free(stool: Creature):
    """So is the seed, and the lock that is held while a program is compiled has the same name."""
    config = small_config(drive={"law": "pd"}, fitness={"weights": {"slip": 3.0}})
    one, other = (
        program_key(stool, each) for each in (small_config(), dataclasses.replace(config, seed=5))
    )
    assert one == other
    assert hash(one) == hash(other)
    assert one.name("evaluate") == other.name("evaluate") != one.name("absorb")


@pytest.mark.parametrize("kind", ["controller", "task"])
def test_code_of_the_same_name_that_was_defined_anew_is_other_code(
    stool: Creature, kind: str, monkeypatch: pytest.MonkeyPatch
):
    before = program_key(stool, small_config())
    name = getattr(small_config().use, kind)
    own = type(name, (registry.find(kind, name),), {})
    shipped = kinds.shipped(kind)[name]
    monkeypatch.setitem(kinds._OWN, (kind, name), dataclasses.replace(shipped, **{kind: own}))
    assert program_key(stool, small_config()) != before
