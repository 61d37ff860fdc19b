"""The rooms may import in one direction only, so that a genome that drives something else can be dropped in."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "mjxgait"


def imports(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def imported_by(module: str) -> set[str]:
    """All of the package's modules that a module leads to, itself included, and what they import from outside."""
    seen: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        place = PACKAGE.parent / Path(*name.split("."))
        for path in (place.with_suffix(".py"), place / "__init__.py"):
            if name.startswith("mjxgait") and path.exists():
                waiting += imports(path)
    return seen


def outside(module: str, name: str) -> bool:
    return any(found == name or found.startswith(f"{name}.") for found in imported_by(module))


@pytest.mark.parametrize("module", ["mjxgait.variation", "mjxgait.evolution"])
def test_evolution_does_not_know_what_a_genome_drives(module: str):
    for forbidden in ("mujoco", "mjxgait.creature", "mjxgait.gait", "mjxgait.rollout"):
        assert not outside(module, forbidden)


def test_the_examiner_shares_no_jax():
    assert not outside("mjxgait.certify", "jax")


def test_rollout_does_not_know_evolution():
    assert not outside("mjxgait.rollout", "mjxgait.evolution")


@pytest.mark.parametrize("path", sorted(PACKAGE.glob("*.py")), ids=lambda path: path.stem)
def test_nothing_below_the_run_imports_pictures(path: Path):
    leaves = {"run", "cli", "__main__"}
    if path.stem not in leaves:
        assert not any(
            name.startswith(("mjxgait.viewing", "mjxgait.animation")) for name in imports(path)
        )


def test_only_one_place_jits():
    """One program per run: a second jit elsewhere would be a second compile."""
    calls = {
        path.name for path in PACKAGE.glob("*.py") if "jax.jit(" in path.read_text(encoding="utf-8")
    }
    assert calls <= {"experiment.py", "run.py"}
