"""Which of a generation's programs is worth the compiler's best."""

import pytest

from mjxgait.runs.stages import compile_stages


class Written:
    """A program that tells what the compiler was told."""

    def compile(self, compiler_options: dict) -> dict:
        return compiler_options


def test_only_what_simulates_is_optimized(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("jax.default_backend", lambda: "cpu")
    stages = compile_stages([(part, Written()) for part in ("propose", "judge", "absorb")])
    assert stages.judge == {"xla_cpu_prefer_vector_width": "512"}
    assert stages.propose == stages.absorb
    assert stages.propose["xla_backend_optimization_level"] == "0"


def test_other_machines_have_their_own_compilers(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("jax.default_backend", lambda: "gpu")
    stages = compile_stages([("propose", Written()), ("judge", Written()), ("absorb", Written())])
    assert stages.propose == stages.judge == stages.absorb == {}
