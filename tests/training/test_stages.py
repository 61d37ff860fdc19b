"""Compiler options of each program of a generation."""

import pytest

from mjxgait.creature import Creature
from mjxgait.plugins.registry import resolve_config
from mjxgait.training.experiment import build_experiment
from mjxgait.training.stages import compile_stages


class Written:
    """A program that returns its compiler options."""

    def compile(self, compiler_options: dict) -> dict:
        return compiler_options


@pytest.mark.parametrize(("long", "level"), [(False, "0"), (True, "1")])
def test_only_the_simulation_is_fully_optimized(
    monkeypatch: pytest.MonkeyPatch, long: bool, level: str
):
    """A proposal that takes long is optimized a little."""
    monkeypatch.setattr("jax.default_backend", lambda: "cpu")
    written = [(part, Written()) for part in ("propose", "evaluate", "small", "absorb")]
    stages = compile_stages(written, long=long)
    assert stages.evaluate == stages.small == {"xla_cpu_prefer_vector_width": "512"}
    assert stages.propose["xla_backend_optimization_level"] == level
    assert stages.absorb["xla_backend_optimization_level"] == "0"


def test_variation_is_long_for_expressions_and_not_for_poses(stool: Creature):
    variations = [
        build_experiment(stool, resolve_config({}, "stool", use={"controller": name}))
        for name in ("program", "poses")
    ]
    found = [
        e.simulator.controller.variation(e.config.controller, e.config.evolution).long
        for e in variations
    ]
    assert found == [True, False]


def test_other_backends_get_no_compiler_options(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("jax.default_backend", lambda: "gpu")
    stages = compile_stages(
        [("propose", Written()), ("evaluate", Written()), ("absorb", Written())]
    )
    assert stages.propose == stages.evaluate == stages.absorb == {}
