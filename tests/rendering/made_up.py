"""Champions made without evolution, which tread on the spot or fall."""

import dataclasses
import json

import numpy as np
from helpers import pose_champion

from mjxgait.champion import write_champion
from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.config import PoseConfig
from mjxgait.training.folder import CHAMPION, METRICS, create_run


def treading(creature, degrees=4.0, period=0.5):
    """Key poses a few degrees around the stand, advanced by the clock."""
    rng = np.random.default_rng(3)
    poses = creature.joints.stand + np.radians(
        rng.uniform(-degrees, degrees, (2, len(creature.joints.names)))
    )
    return pose_champion(
        creature,
        poses,
        {"threshold": 0.1, "period": period},
        PoseConfig(advance="clock"),
        fitness=1.0,
        origin={"born": 3, "seed": 0, "versions": {"jax": "9.9"}},
    )


def falling(creature):
    """Legs straight out to one side: it falls at once."""
    upright = treading(creature)
    poses = np.stack([creature.joints.pose_high, creature.joints.pose_high])
    return dataclasses.replace(upright, genome={**upright.genome, "key_poses": poses})


def metrics_line(generation):
    numbers = {
        "best": 1.0 + generation,
        "mean": 0.5 * generation,
        "lower_quartile": 0.3 * generation,
        "upper_quartile": 0.7 * generation,
    }
    terms = {
        "term_distance": float(generation),
        "term_alive": 1.0,
        "term_slip": 0.2,
        "term_drift": None,
    }
    return (
        {"generation": generation, "forced": generation == 3, "unique": 8, "spread": 0.2}
        | numbers
        | terms
    )


def write_run(folder, creature, champion=None, generations=6):
    """A run folder with metrics and, if there is one, a champion."""
    create_run(folder, creature, Config())
    (folder / METRICS).write_text(
        "".join(json.dumps(metrics_line(g)) + "\n" for g in range(generations))
    )
    if champion is not None:
        write_champion(champion, creature, folder / CHAMPION)
    return folder
