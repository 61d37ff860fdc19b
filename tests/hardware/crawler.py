"""A body of five blocks with a brain that observes angles and contacts, and a short motion of it."""

import functools

import numpy as np
from rendering.grown import graph

from mjxgait.champion import Champion
from mjxgait.config.layers import find_creature
from mjxgait.controllers.config import DriveConfig
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.reference_body import NEURONS
from mjxgait.creature import load_creature
from mjxgait.rendering.walk import Walk, record_walk

SECONDS = 3.0
ANGLE, CONTACT, OWN = 1, 4, 8
"""Sources of a part: its first hinge, its contact, its own neurons."""


def genome() -> dict[str, np.ndarray]:
    """Its graph, and nerves: a wave for each node, corrected by the angle and the contact."""
    nodes = 3
    kinds = [NEURONS.index("oscillate-wave"), NEURONS.index("sum"), NEURONS.index("sum")]
    sources = [[0, 0, 0], [OWN, ANGLE, CONTACT], [0, 0, 0]]
    waves = [[[0.3 * node, 1.0, 0.0], [0.8, -0.6, 0.4], [0.0, 0.0, 0.0]] for node in range(nodes)]
    body = graph()
    # Its limbs bend towards the ground, not beside it.
    body["graph.turn"][0, 0, 0] = 1.2
    return {
        **body,
        "nerves.kind": np.tile(kinds, (nodes, 1)),
        "nerves.source": np.tile(sources, (nodes, 1, 1)),
        "nerves.weight": np.array(waves),
        "nerves.effect_source": np.full((nodes, 3), OWN + 1),
        "nerves.effect_weight": np.ones((nodes, 3)),
        "centre.kind": np.zeros(1, int),
        "centre.source": np.zeros((1, 3), int),
        "centre.weight": np.zeros((1, 3)),
    }


def champion(task: str = "roam") -> Champion:
    """Its champion."""
    blocks = load_creature(find_creature("blocks"))
    return Champion(
        creature=blocks.name,
        digest=blocks.digest,
        controller="brain",
        genome=genome(),
        settings=BrainConfig(nodes=3, connections=1, central=1),
        drive=DriveConfig(),
        task=task,
        fitness=0.0,
        terms={},
        origin={},
    )


@functools.cache
def crawl() -> Walk:
    """Its motion in the reference simulator."""
    best = champion()
    return record_walk(best.embodied(load_creature(find_creature("blocks"))), best, SECONDS)
