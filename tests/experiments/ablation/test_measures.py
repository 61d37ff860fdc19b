"""Measures of every champion of a study, whatever its task."""

import dataclasses

import numpy as np
import pytest
from helpers import pose_champion

from mjxgait.config.layers import find_creature
from mjxgait.creature import load_creature
from mjxgait.experiments.ablation import measures
from mjxgait.experiments.ablation.measures import walked


def test_a_standing_champion_counts_as_up_in_walk_but_not_in_hop(
    monkeypatch: pytest.MonkeyPatch,
):
    """Simulated for 6 s instead of 22."""
    monkeypatch.setattr(measures, "SECONDS", 6.0)
    monkeypatch.setattr(measures, "STARTS", 4)
    luxo = load_creature(find_creature("luxo"))
    stands = pose_champion(luxo, np.stack([luxo.joints.stand] * 2), {})
    _, up, _ = walked(luxo, stands)
    _, arrived, _ = walked(luxo, dataclasses.replace(stands, task="hop"))
    assert up == 1
    assert arrived == 0
