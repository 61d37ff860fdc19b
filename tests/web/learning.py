"""Runs with a checkpoint of a first population, which is not simulated and not evolved."""

import dataclasses
import json

import jax
import numpy as np
from end_to_end.unevolved import embodied
from rendering.made_up import metrics_line

from mjxgait.champion import write_champion
from mjxgait.config.layers import find_creature
from mjxgait.creature import load_creature
from mjxgait.plugins.registry import build_config
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.experiment import build_experiment
from mjxgait.training.folder import CHAMPION, METRICS, create_run

KINDS = {
    # name: creature, controller, task, settings of the controller
    "key poses": ("tall_quadruped", "poses", "walk", {}),
    "expressions": ("luxo", "program", "hop", {}),
    "a network": ("tall_quadruped", "network", "walk", {}),
    "bodies of blocks": ("blocks", "brain", "swim", {"parts": 4, "nodes": 3, "links": 4}),
}
GENERATION = 5


def begun(folder, kind, population=12):
    """A run of a kind, and its experiment."""
    name, controller, task, settings = KINDS[kind]
    table = {
        "use": {"controller": controller, "task": task},
        "controller": settings,
        "evolution": {"population": population},
    }
    creature, config = load_creature(find_creature(name)), build_config(table, kind)
    create_run(folder, creature, config)
    return build_experiment(creature, config)


def store(folder, experiment, generation=GENERATION, turned=0):
    """Write a checkpoint and its best as champion, as a training does; return the champion.

    turned: by how many places the population is shifted.
    """
    state = embodied(experiment)
    count = len(state.fitness)
    state = dataclasses.replace(
        state,
        genomes=jax.tree.map(lambda leaf: np.roll(leaf, turned, axis=0), state.genomes),
        fitness=np.arange(count, 0, -1, dtype=np.float32),
        terms=np.zeros(state.terms.shape, np.float32),
        outcome=np.zeros(state.outcome.shape, np.float32),
        generation=np.int32(generation),
    )
    checkpoints = Checkpoints(folder)
    checkpoints.save(state, experiment.creature.name, experiment.creature.digest)
    checkpoints.close()
    champion = experiment.champion(state, {})
    write_champion(champion, experiment.creature, folder / CHAMPION)
    with (folder / METRICS).open("a") as log:
        log.write(json.dumps(metrics_line(generation)) + "\n")
    return champion
