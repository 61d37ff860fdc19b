"""The small quadruped and a gait for it."""

import numpy as np
import pytest
from certify_made_up import LEGS, TOML, XML, make_champion

from mjxgait.creature import load_creature


@pytest.fixture(scope="session")
def tiny(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tiny")
    (folder / "creature.xml").write_text(XML)
    (folder / "creature.toml").write_text(TOML)
    return load_creature(folder)


@pytest.fixture(scope="session")
def trotter(tiny):
    """Trot found by hand: one diagonal pair swings while the other pushes."""
    column = {name: i for i, name in enumerate(tiny.joints.names)}
    poses = np.zeros((2, 8))
    for leg in LEGS:
        swings = leg in ("front_left", "hind_right")
        hip, knee = column[f"{leg}_hip"], column[f"{leg}_knee"]
        poses[:, hip] = (-0.5, -0.2) if swings else (0.0, 0.2)
        poses[:, knee] = (0.75, 0.1) if swings else (0.1, 0.1)
    return make_champion(tiny, poses, {"period": 0.5, "steer": 1.0}, advance="clock")
