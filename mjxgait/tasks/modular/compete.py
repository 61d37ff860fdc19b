"""Compete task for modular bodies: be nearer to a cube than an opponent is (Sims 1994).

All individuals meet the same opponent, the best of an earlier generation. Both face the cube at the
start, and observe its direction in the axes of each block.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.controllers.sims_brain.controller import directions
from mjxgait.tasks.modular.base import LITTLE, modular_sensed, share_lost
from mjxgait.tasks.modular.config import CompeteConfig, CompeteWeights
from mjxgait.tasks.modular.roam import Roam, RoamStats, shaken
from mjxgait.types import Sensed, pytree


@pytree
class CompeteStats(RoamStats):
    """Extension of `RoamStats`.

    nearness: [] sum over the steps that count of the opponent's distance from the cube over the sum
    of both distances.
    """

    nearness: jax.Array


class Compete(Roam):
    """Implementation of `Task`. The share of the cube is the mean nearness; half is a draw."""

    Settings: ClassVar[type] = CompeteConfig
    terms = tuple(field.name for field in dataclasses.fields(CompeteWeights))
    outcomes: ClassVar[tuple[str, ...]] = ("share", "seconds", "since")
    adds: ClassVar[tuple[str, ...]] = ("light", "opponent")

    @override
    def init(self) -> CompeteStats:
        known = vars(super().init()) | {"since": jnp.zeros((), jnp.int32)}
        return CompeteStats(**known, nearness=jnp.zeros(()))

    def observations(self, goal: Any, sensed: Sensed) -> Mapping[str, jax.Array]:
        """Direction [G, 3] of the cube in the axes of each block."""
        return {"light": directions(self._cube(sensed), sensed)}

    @override
    def update(
        self, stats: Any, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: Any
    ) -> CompeteStats:
        mine, its = self._gaps(sensed)
        nearness = its / jnp.maximum(mine + its, LITTLE)
        counted = jnp.where(stats.steps < params, 0.0, stats.nearness + nearness)
        after: Any = super().update(stats, sensed, torque, params, goal)
        found: CompeteStats = dataclasses.replace(after, nearness=counted, since=params)
        return found

    def evaluate(self, stats: Any, settings: Any) -> Mapping[str, jax.Array]:
        """The share of the cube; its loss by overlap, and of the rest by vibration."""
        share = self._share(stats)
        inside = share_lost(stats.overlap / settings.overlap)
        vibrates = (1 - inside) * shaken(stats, settings.vibration)
        return {"share": share, "overlap": share * inside, "vibration": share * vibrates}

    @override
    def outcome(self, stats: Any) -> Mapping[str, jax.Array]:
        """Share of the cube, duration and uncounted time in s."""
        return {
            "share": self._share(stats),
            "seconds": stats.steps * self.step,
            "since": stats.since * self.step,
        }

    def _share(self, stats: CompeteStats) -> jax.Array:
        """Return the mean nearness []; 0 for a body that does not move.

        Time after an early end counts as none.
        """
        assert stats.since is not None
        mean = stats.nearness / jnp.maximum(self.horizon - stats.since, 1)
        return jnp.where(stats.moved > 0, mean, 0.0)

    def _cube(self, sensed: Sensed) -> jax.Array:
        cube = modular_sensed(sensed).cube
        assert cube is not None
        return cube

    def _gaps(self, sensed: Sensed) -> jax.Array:
        gaps = modular_sensed(sensed).gaps
        assert gaps is not None
        return gaps
