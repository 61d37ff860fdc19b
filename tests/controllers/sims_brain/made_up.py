"""Helpers for the tests of modular bodies."""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.sims_brain.genotype import (
    Capacity,
    Graph,
    Ranges,
    random_graph,
)
from mjxgait.controllers.sims_brain.phenotype import GrownBody, body_of
from mjxgait.evolution.chance import key_of
from mjxgait.physics.batched_trees.tree import ModularSensed
from mjxgait.types import Sensed

CAPACITY, LANES = Capacity(), 96
"""Capacity and number of random bodies; with these, all tests share compiled programs."""
_draw = jax.jit(jax.vmap(lambda key: random_graph(key, CAPACITY, Ranges())))


def random_graphs(seed: int) -> Graph:
    """Random graphs [LANES]."""
    return _draw(jax.random.split(key_of(seed), LANES))


@partial(jax.jit, static_argnums=1)
def bodies_of(graphs: Graph, capacity: Capacity = CAPACITY) -> GrownBody:
    """Bodies of graphs [LANES]."""
    return jax.vmap(lambda graph: body_of(graph, capacity))(graphs)


def one(tree: Any, place: int) -> Any:
    """One of many, as NumPy arrays."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[place], tree)


def genome_of(graph: Graph) -> dict[str, np.ndarray]:
    """A graph's arrays under the names of a champion's genome."""
    names = [field.name for field in dataclasses.fields(graph)]
    return {f"graph.{name}": np.asarray(getattr(graph, name)) for name in names}


CALM = Sensed(
    joint_pos=jnp.zeros(3),
    joint_vel=jnp.zeros(3),
    bias=jnp.zeros(9),
    trunk_pos=jnp.zeros(3),
    trunk_rot=jnp.eye(3),
    trunk_vel=jnp.zeros(3),
    trunk_angvel=jnp.zeros(3),
    geom_pos=jnp.zeros((4, 3)),
    geom_low=jnp.zeros(4),
    body=ModularSensed(
        com=jnp.zeros(3),
        momentum=jnp.zeros(3),
        water_force=jnp.zeros(3),
        limit_excess=jnp.float32(0.01),
        depth=jnp.float32(-1.0),
    ),
)
"""Three hinges and four blocks at rest."""


def moment(own: dict[str, Any] | None = None, **common: Any) -> Sensed:
    """`CALM` with other values, `own` of those that only modular bodies have."""
    return dataclasses.replace(CALM, body=dataclasses.replace(CALM.body, **own or {}), **common)
