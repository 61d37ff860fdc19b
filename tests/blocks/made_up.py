"""What the tests of blocks share."""

import dataclasses
from typing import Any

import jax
import numpy as np

from mjxgait.blocks.genotype import Graph


def one(tree: Any, place: int) -> Any:
    """One of many, in NumPy."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[place], tree)


def genome_of(graph: Graph) -> dict[str, np.ndarray]:
    """A graph's arrays as a champion has them."""
    names = [field.name for field in dataclasses.fields(graph)]
    return {f"graph.{name}": np.asarray(getattr(graph, name)) for name in names}
