"""Disturbances of criterion 4 that evolution lacks, by settings (docs/reference/certificate.md)."""

import dataclasses
from pathlib import Path

import pytest
from importer.test_manner import BIPED

from mjxgait.api import load_creature
from mjxgait.certification import CertificateConfig
from mjxgait.config.schema import Config, RolloutConfig
from mjxgait.importer.train_table import few_feet, four_feet
from mjxgait.plugins import resolve_config
from mjxgait.tasks.walk.targets import WalkTargets, configured

EXAMINED = CertificateConfig().starts
WALK = {"masses", "late torques", "slopes"}
"""New by default. The softness of the floor is always new: no setting changes it."""


def new(rollout: RolloutConfig) -> set[str]:
    """Disturbances of the examination that are weaker or missing in evolution."""
    known = {
        "gains": rollout.gains >= EXAMINED.gains,
        "masses": rollout.masses >= EXAMINED.masses,
        "late torques": rollout.latency >= EXAMINED.latency,
        "slopes": rollout.slope >= EXAMINED.slope,
        "friction": rollout.friction[0] <= EXAMINED.friction[0],
        "joints": rollout.joint_noise >= EXAMINED.joints,
        "joint speeds": rollout.velocity_noise >= EXAMINED.velocities,
    }
    if rollout.starts == 1:
        return set(known)
    return {name for name, disturbed in known.items() if not disturbed}


def config_of(name: str, file: str | None = None, **targets: str) -> Config:
    creature = load_creature(name)
    if targets:
        return configured(creature, None, {}, WalkTargets(**targets))
    return resolve_config(creature.settings.train, creature.name, Path(file) if file else None)


@pytest.mark.parametrize("name", ["tall_quadruped", "short_quadruped", "crab", "alien"])
def test_new_disturbances_of_a_walk(name: str):
    assert new(config_of(name).rollout) == WALK


def test_new_disturbances_of_other_settings():
    for name in ("luxo", "duck"):
        assert new(config_of(name).rollout) == WALK - {"late torques"}
    anywhere = config_of("tall_quadruped", certificate="anywhere").rollout
    assert new(anywhere) == {"masses"}
    assert not anywhere.masses
    for name in ("wilson", "gritz_hahn"):
        creature = "luxo" if name == "gritz_hahn" else "tall_quadruped"
        assert new(config_of(creature, name).rollout) > WALK | {"gains", "friction"}
    blocks = load_creature("blocks").settings.train
    starts = {
        task: resolve_config(blocks, "blocks", use={"task": task}).rollout.starts
        for task in ("swim", "walk", "jump", "follow", "follow-on-land")
    }
    assert starts == {"swim": 2, "walk": 2, "jump": 2, "follow": 4, "follow-on-land": 4}


def test_new_disturbances_of_imported_bodies():
    for robot in (few_feet(BIPED)[0], four_feet(BIPED)[0]):
        assert robot["rollout"]["latency"] >= EXAMINED.latency
        assert not {"masses", "slope"} & set(robot["rollout"])
    ant = dataclasses.replace(BIPED, rotor=30.0)
    assert "rollout" not in four_feet(ant)[0]
