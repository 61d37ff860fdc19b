"""A run folder with checkpoints, written without training."""

import json
import shutil

import numpy as np
import pytest
from helpers import pose_champion
from inspection.made_up import FORCED, LAST, POPULATION, make_state

from mjxgait.champion import write_champion
from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.layers import find_creature
from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.controller import TUNING
from mjxgait.creature import load_creature
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.folder import CHAMPION, METRICS, create_run


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory):
    creature = load_creature(find_creature("tall_quadruped"))
    config = Config(seed=11, evolution=EvolutionConfig(population=POPULATION, generations=LAST))
    folder = tmp_path_factory.mktemp("runs") / "walk"
    create_run(folder, creature, config)
    checkpoints = Checkpoints(folder)
    for generation in range(LAST + 1):
        state = make_state(creature, config, generation)
        checkpoints.save(state, creature.name, creature.digest)
        line = {
            "generation": generation,
            "best": float(state.fitness[0]),
            "mean": 1.0,
            "forced": generation == FORCED,
        }
        with (folder / METRICS).open("a") as log:
            log.write(json.dumps(line) + "\n")
    checkpoints.close()
    write_champion(
        pose_champion(
            creature,
            np.asarray(state.genomes.key_poses[0]),
            dict.fromkeys(TUNING, 1.0),
            config.controller,
            fitness=1.0,
            origin={"versions": {"jax": "9.9"}},
        ),
        creature,
        folder / CHAMPION,
    )
    return folder


@pytest.fixture
def run(finished_run, tmp_path):
    """A copy that a test may damage."""
    return shutil.copytree(finished_run, tmp_path / "walk")
