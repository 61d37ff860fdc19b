"""What every champion of a study is judged by, whatever it evolved for."""

import dataclasses

import numpy as np
import pytest
from helpers import pose_champion

from mjxgait.config.layers import find_creature
from mjxgait.creature import load_creature
from mjxgait.experiments.ablation import rows
from mjxgait.experiments.ablation.rows import walked


def test_who_stands_is_up_where_it_must_walk_and_not_where_it_has_a_goal(
    monkeypatch: pytest.MonkeyPatch,
):
    """For 6 s instead of 22."""
    monkeypatch.setattr(rows, "SECONDS", 6.0)
    monkeypatch.setattr(rows, "STARTS", 4)
    luxo = load_creature(find_creature("luxo"))
    stands = pose_champion(luxo, np.stack([luxo.joints.stand] * 2), {})
    _, up, _ = walked(luxo, stands)
    _, arrived, _ = walked(luxo, dataclasses.replace(stands, task="hop"))
    assert up == 1
    assert arrived == 0
