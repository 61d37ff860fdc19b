"""Helpers for several tests."""

import dataclasses
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjxgait.certification import (
    Certificate,
    CertificateConfig,
    Criterion,
    Measure,
)
from mjxgait.champion import Champion
from mjxgait.cli import main
from mjxgait.config.schema import Config
from mjxgait.config.tables import build
from mjxgait.controllers.config import DriveConfig
from mjxgait.controllers.key_poses.config import STEPPING, TUNING, PoseConfig, gene_names
from mjxgait.creature import Creature
from mjxgait.simulation.evaluator import completed
from mjxgait.tasks.base import in_order
from mjxgait.tasks.starts import Starts
from mjxgait.tasks.walk.config import WalkConfig
from mjxgait.tasks.walk.fitness import signed_weights, terms_under
from mjxgait.training.experiment import Batch
from mjxgait.training.simulator import SimulatorSpec
from mjxgait.types import Evaluation, RequestedTrials

STOOL = Path(__file__).parent / "data" / "stool"


def made_up_certificate(
    fingerprint: str,
    *failed: tuple[int, str],
    task: str = "walk",
    margin: float = 0.5,
    report: Mapping[str, Any] | None = None,
    config: CertificateConfig | None = None,
    **others: Any,
) -> dict[str, Any]:
    """Document of a certificate with only the failed criteria, or with one that passed."""
    sign = -1 if failed else 1
    criteria = tuple(
        Criterion(number, name, (Measure("speed", 0.5 + sign * margin, ">=", 0.5, 1.0),))
        for number, name in failed or [(2, "progress")]
    )
    told = {"ground": "flat", "summary": ""} | dict(report or {})
    settings = config or CertificateConfig()
    made = Certificate("stool", "", task, fingerprint, criteria, told, settings, 1.0)
    return made.document() | others


def small_config(**tables: dict) -> Config:
    """A config for runs of a second: few individuals, short episodes.

    It has the shape of `test_run.SMALL`, so both share a program.
    """
    table = {
        "evolution": {"population": 6, "generations": 3},
        "rollout": {"seconds": 0.4, "starts": 2, "promote": 1.0, "lanes": 4},
    }
    for name, values in tables.items():
        table[name] = {**table.get(name, {}), **values}
    return build(Config, table, "test")


def program_text(batch: Batch) -> str:
    """Text of all programs of a generation, before compilation."""
    return "\n".join(program.as_text() for _, program in batch.lower())


def altered(creature: Creature, **facts: Any) -> Creature:
    """The creature with other facts; a mapping replaces fields of a part."""
    changes = {
        name: dataclasses.replace(getattr(creature, name), **value)
        if isinstance(value, Mapping)
        else value
        for name, value in facts.items()
    }
    return dataclasses.replace(creature, **changes)


def weight_vector(config: WalkConfig, generation: jax.Array) -> jax.Array:
    """Weights [F] of the walk in the order of its terms."""
    return in_order(signed_weights(config, generation), terms_under(config.weights))


STILL = dict.fromkeys((*TUNING, *STEPPING), 0.0) | {"threshold": 0.12, "period": 0.8}
"""A blind cycle: no steering, no balance."""


def pose_champion(
    creature: Creature,
    key_poses: np.ndarray,
    tuning: Mapping[str, float],
    settings: PoseConfig | None = None,
    drive: DriveConfig | None = None,
    **others: Any,
) -> Champion:
    """Champion with these key poses [K, J]. tuning: overrides `STILL`."""
    genes, names = STILL | dict(tuning), gene_names(creature.corrections.steps)
    given: dict[str, Any] = {"fitness": 0.0, "terms": {}, "origin": {}} | others
    return Champion(
        creature=creature.name,
        digest=creature.digest,
        controller="poses",
        genome={"key_poses": key_poses, "tuning": np.array([genes[name] for name in names])},
        settings=settings or PoseConfig(key_poses=len(key_poses)),
        drive=drive or DriveConfig(),
        task="walk",
        **given,
    )


def said_by(capsys: pytest.CaptureFixture, *arguments: object, code: int) -> str:
    """Output of a command that must exit with this code; it runs in this process."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments)])
    assert ended.value.code == code
    said = capsys.readouterr()
    return said.out + said.err


SHORT = """
seconds = 3.0
warmup = 0.5
[starts]
count = 2
[pushes]
count = 2
window = [0.5, 1.0]
ladder = [0.2]
ladder_count = 2
"""
"""Examination of 3 s instead of 22 s, as a file of `certify --config`; its result means nothing."""


def short_examination() -> CertificateConfig:
    """`SHORT` as settings."""
    return build(CertificateConfig, tomllib.loads(SHORT), "short")


class Shares:
    """Pre-screening with known shares of successes by rank."""

    def __init__(self, *shares: float) -> None:
        self.known = shares

    def shares(self, state: object, ranks: list[int]) -> np.ndarray:
        return np.array([self.known[rank] for rank in ranks])

    def margin(self, share: float) -> float:
        return share - 0.9


def made_up_evaluate(
    spec: SimulatorSpec,
    numbers: object,
    settings: Config,
    starts: Starts,
    genomes: Any,
    requested: RequestedTrials | None = None,
) -> Evaluation:
    """Replacement of `training.stages.evaluate` that simulates nothing and compiles fast.

    Key poses near zero are best, the more so the larger `fitness.speed`. Poses that are not finite
    fail.
    """
    task, poses = spec.own.task, genomes.key_poses
    shape = (*poses.shape[:2], starts.friction.shape[1])
    worth = -jnp.asarray(settings.fitness.speed)[:, None] * jnp.square(poses).sum((2, 3))
    worth = worth[..., None, None] * starts.friction[:, None, :, None]
    wanted = jnp.ones(shape, bool) if requested is None else jnp.asarray(requested.wanted)
    lived = jnp.sum(wanted, axis=(1, 2), dtype=jnp.int32)
    evaluation = Evaluation(
        terms=jnp.tile(worth, len(task.terms)),
        outcome=jnp.tile(worth, len(task.outcomes)),
        failed=~jnp.isfinite(worth[..., 0]),
        sim_steps=lived,
        computed_steps=lived,
    )
    return evaluation if requested is None else completed(evaluation, requested)
