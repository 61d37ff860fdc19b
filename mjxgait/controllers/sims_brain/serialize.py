"""Serializer for genomes of growing bodies and brains; it also builds the grown body."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from typing_extensions import override

from mjxgait.champion.serializers import PlainSerializer
from mjxgait.config.tables import build
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.reference_body import (
    FRICTION,
    GRAVITY,
    grow,
    opponent_genome,
)
from mjxgait.controllers.sims_brain.reference_files import body_files
from mjxgait.creature import Creature
from mjxgait.creature.load import creature_of
from mjxgait.kinds import in_water


class GraphSerializer(PlainSerializer[BrainConfig]):
    """Implementation of `Serializer`: arrays as nested lists under their names."""

    def settled(
        self, genome: Mapping[str, np.ndarray], creature: Creature
    ) -> dict[str, np.ndarray]:
        """Numbers as stored in a file, so that the same body grows from it."""
        return {
            name: array.astype(float) if np.issubdtype(array.dtype, np.floating) else array
            for name, array in genome.items()
        }

    @override
    def document(
        self, genome: Mapping[str, np.ndarray], settings: BrainConfig, creature: Creature
    ) -> dict[str, object]:
        return {name: np.asarray(array).tolist() for name, array in genome.items()}

    @override
    def genome(self, document: Mapping[str, Any], creature: Creature) -> dict[str, np.ndarray]:
        return {name: np.array(values) for name, values in document.items()}

    @override
    def settings(self, table: Mapping[str, object], where: str) -> BrainConfig:
        return build(BrainConfig, table, where)

    @override
    def shapes(self, settings: BrainConfig, creature: Creature) -> dict[str, tuple[int, ...]]:
        each = (settings.nodes, settings.connections)
        return {"graph.half": (settings.nodes, 3), "graph.target": each}

    def embodied(
        self,
        genome: Mapping[str, np.ndarray],
        settings: BrainConfig,
        task: str,
        creature: Creature,
    ) -> Creature:
        """The grown body, in the water or on the ground of its task, with its opponent if any."""
        wet, theirs = in_water(task), opponent_genome(genome)
        files = body_files(
            grow(genome, settings.parts, settings.links),
            creature.name,
            float(creature.model.opt.timestep),
            gravity=0.0 if wet else GRAVITY,
            friction=None if wet else FRICTION,
            around="in water" if wet else "on land",
            opponent=grow(theirs, settings.parts, settings.links) if theirs else (),
        )
        return creature_of(files)
