"""Serializer for key poses by joint name and tuning genes by name."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from typing_extensions import override

from mjxgait.champion.serializers import PlainSerializer
from mjxgait.config.tables import build
from mjxgait.controllers.key_poses.config import PoseConfig, gene_names
from mjxgait.creature import Creature
from mjxgait.errors import UserError

MOST_POSES, SHORTEST = 1000, 1e-3
"""Most key poses of a cycle, and its shortest period in s; evolution stays far within both."""
LATER = {"begin": 0.0, "turn": 0.0}
"""Genes added later, with the values that reproduce older files."""


class PoseSerializer(PlainSerializer[PoseConfig]):
    """Serializer for `key_poses` [K, J] in rad and `tuning` [E] in the order of `gene_names`."""

    def document(
        self, genome: Mapping[str, np.ndarray], settings: PoseConfig, creature: Creature
    ) -> dict[str, object]:
        """Implementation of `Serializer`.

        mirrored: whether the cycle includes the mirror images of the poses.
        """
        names = gene_names(creature.corrections.steps)
        return {
            "key_poses": [
                dict(zip(creature.joints.names, map(float, pose), strict=True))
                for pose in genome["key_poses"]
            ],
            "mirrored": creature.mirror.symmetric and settings.mirror,
            "tuning": dict(zip(names, map(float, genome["tuning"]), strict=True)),
        }

    @override
    def genome(self, document: Mapping[str, Any], creature: Creature) -> dict[str, np.ndarray]:
        poses = [[pose[name] for name in creature.joints.names] for pose in document["key_poses"]]
        if not 1 <= len(poses) <= MOST_POSES:
            raise ValueError(f"{len(poses)} key poses: a cycle has 1 to {MOST_POSES}")
        genes = LATER | document["tuning"]
        tuning = [genes[name] for name in gene_names(creature.corrections.steps)]
        return {"key_poses": np.array(poses, float), "tuning": np.array(tuning, float)}

    @override
    def settings(self, table: Mapping[str, object], where: str) -> PoseConfig:
        return build(PoseConfig, table, where)

    @override
    def check(self, genome: Mapping[str, np.ndarray], creature: Creature) -> None:
        poses = genome["key_poses"]
        for place in np.argwhere(~np.isfinite(poses)):
            k, j = map(int, place)
            raise UserError(
                f'key pose {k + 1} has {poses[k, j]} rad for joint "{creature.joints.names[j]}": '
                "this champion cannot move; take one of another generation"
            )
        names = gene_names(creature.corrections.steps)
        for name, value in zip(names, genome["tuning"], strict=True):
            if not np.isfinite(value):
                raise UserError(
                    f'the tuning "{name}" is {value}: this champion cannot move; '
                    "take one of another generation"
                )
            if name == "period" and value < SHORTEST:
                raise UserError(
                    f"the period of its cycle is {value:g} s: this champion cannot move; take one "
                    "of another generation"
                )

    @override
    def shapes(self, settings: PoseConfig, creature: Creature) -> dict[str, tuple[int, ...]]:
        poses = (settings.key_poses, len(creature.joints.names))
        return {"key_poses": poses, "tuning": (len(gene_names(creature.corrections.steps)),)}
