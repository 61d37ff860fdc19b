"""Imports between the rooms of the package go one way, so that a part can be taken out and another put in."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "mjxgait"

FLOORS = (
    ("__init__",),
    ("__main__",),
    ("cli",),
    ("commands",),
    ("library",),
    ("bench",),
    ("ablation", "repertoire", "zoo"),
    ("cluster",),
    ("web",),
    ("animation",),
    ("importing",),
    ("keys",),
    ("viewing",),
    ("inspect",),
    ("runs",),
    ("parts",),
    ("certify",),
    ("simulation",),
    ("tasks", "control"),
    ("blocks",),
    ("search",),
    ("champion", "physics", "senses"),
    ("body",),
    ("creature",),
    ("settings",),
    ("ground", "clips"),
    ("types", "cores"),
    ("files", "processes"),
    ("errors",),
)
"""The rooms, from the top down: each may import from the floors below it, and from itself."""

RANK = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imports(path: Path) -> Iterator[str]:
    """All that a file imports, wherever in it, as dotted names."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def files() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def test_every_room_has_its_floor():
    assert {room(path) for path in files()} == set(RANK)


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_down(path: Path):
    own = room(path)
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "mjxgait" and len(parts) > 1 and parts[1] in RANK and parts[1] != own:
            assert RANK[parts[1]] > RANK[own], f"{own} must not import {name}"


def modules_of(name: str) -> Iterator[Path]:
    place = PACKAGE.parent / Path(*name.split("."))
    yield from (path for path in (place.with_suffix(".py"), place / "__init__.py") if path.exists())


def test_no_file_imports_itself_in_a_circle():
    arrows = {
        path: {found for name in imports(path) for found in modules_of(name)} - {path}
        for path in files()
        if path.name != "__init__.py"
    }
    while arrows:
        free = {path for path, below in arrows.items() if not below & set(arrows)}
        assert free, f"a circle among {sorted(str(p.relative_to(PACKAGE)) for p in arrows)}"
        arrows = {path: below for path, below in arrows.items() if path not in free}


def reached(name: str) -> set[str]:
    """All that a module leads to, inside the package and outside."""
    seen: set[str] = set()
    waiting = [name]
    while waiting:
        found = waiting.pop()
        if found not in seen:
            seen.add(found)
            if found.startswith("mjxgait"):
                waiting += (inner for path in modules_of(found) for inner in imports(path))
    return seen


def leads_to(name: str, package: str) -> bool:
    return any(found == package or found.startswith(f"{package}.") for found in reached(name))


def test_the_examiner_shares_no_jax():
    assert not leads_to("mjxgait.certification", "jax")


@pytest.mark.parametrize("module", ["mjxgait.evolution.evolution", "mjxgait.evolution.variation"])
def test_evolution_does_not_know_what_a_genome_drives(module: str):
    for forbidden in ("mujoco", "mjxgait.creature", "mjxgait.controllers", "mjxgait.simulation"):
        assert not leads_to(module, forbidden)


@pytest.mark.parametrize("own", ["control", "tasks", "search", "simulation"])
def test_what_is_compiled_leaves_mujoco_to_the_physics(own: str):
    """Controllers, tasks and operators compute with arrays; a model is the physics' and the creature's."""
    for path in (PACKAGE / own).rglob("*.py"):
        assert "mujoco" not in {name.split(".")[0] for name in imports(path)}, path.name


def test_only_one_place_jits():
    """One program per run: a second jit elsewhere would be a second compile."""
    ours = [PACKAGE / name for name in ("control", "tasks", "search", "simulation", "runs")]
    calls = {
        path.name
        for folder in ours
        for path in folder.rglob("*.py")
        if "jax.jit" in path.read_text(encoding="utf-8")
    }
    assert calls <= {"stages.py"}
