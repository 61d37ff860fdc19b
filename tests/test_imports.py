"""Imports go one way, so that a part can be replaced."""

import ast
import fnmatch
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "mjxgait"

FLOORS = (
    ("__init__",),
    ("__main__",),
    ("cli",),
    ("gym_envs",),
    ("api",),
    ("experiments",),
    ("distributed",),
    ("web",),
    ("importer",),
    ("animation", "hardware"),
    ("rendering",),
    ("inspect", "controllers/*/report"),
    ("environments",),
    ("training",),
    ("plugins", "controllers/expressions/written", "tasks/walk/targets"),
    ("certification", "tasks/*/*criteria"),
    (
        "reference",
        "controllers/*/reference",
        "certification/config",
        "tasks/*/thresholds",
    ),
    ("simulation",),
    ("tasks", "controllers"),
    ("evolution",),
    (
        "champion",
        "physics",
        "controllers/observations",
        "controllers/*/serialize",
        "controllers/expressions/text",
        "controllers/expressions/parse",
        "controllers/sims_brain/reference_*",
    ),
    ("creature/body",),
    ("creature",),
    ("config", "controllers/config", "controllers/*/config", "tasks/*/*config", "tasks/walk/gaits"),
    ("creature/ground", "animation/clips"),
    ("types", "processes", "kinds"),
    ("cache",),
    ("files", "lru", "output", "extras"),
    ("errors",),
)
"""Patterns of modules and packages, from the top down: each may import from its own or lower ones.

The longest matching pattern decides, so one package has files on several floors.
"""
JAX_FREE = (
    "certification/*",
    "champion/*",
    "reference/*",
    "controllers/*/reference*",
    "controllers/*/serialize",
    "tasks/*/*criteria",
    "tasks/*/thresholds",
)
"""Modules that lead to no JAX, as their names show."""


def name_of(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").as_posix()


def floor(path: Path) -> int:
    parts = name_of(path).split("/")
    fits = {
        pattern.count("/"): number
        for number, patterns in enumerate(FLOORS)
        for pattern in patterns
        if fnmatch.fnmatchcase("/".join(parts[: pattern.count("/") + 1]), pattern)
    }
    assert fits, f"{name_of(path)} has no floor"
    return fits[max(fits)]


def imports(path: Path) -> Iterator[str]:
    """All imports anywhere in a file, as dotted names."""
    return imports_in(ast.parse(path.read_text(encoding="utf-8")))


def imports_in(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def files() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_down(path: Path):
    for name in imports(path):
        for found in modules_of(name):
            if name.startswith("mjxgait.") and not is_bare(found):
                assert floor(found) >= floor(path), f"{name_of(path)} must not import {name}"


def is_bare(path: Path) -> bool:
    """Whether a file is an `__init__` without imports."""
    return path.name == "__init__.py" and not list(imports(path))


@pytest.mark.parametrize("pattern", JAX_FREE)
def test_files_named_as_free_of_jax_lead_to_no_jax(pattern: str):
    found = [p for p in files() if fnmatch.fnmatchcase(name_of(p), pattern)]
    assert found
    for path in found:
        module = f"mjxgait.{name_of(path).replace('/', '.')}".removesuffix(".__init__")
        assert not leads_to(module, "jax"), module


def modules_of(name: str) -> Iterator[Path]:
    place = PACKAGE.parent / Path(*name.split("."))
    yield from (path for path in (place.with_suffix(".py"), place / "__init__.py") if path.exists())


def at_import(node: ast.AST) -> Iterator[ast.AST]:
    """Statements that run when a module is imported."""
    for one in getattr(node, "body", []):
        typing = isinstance(one, ast.If) and "TYPE_CHECKING" in ast.dump(one.test)
        if not typing and not isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef):
            yield one
            yield from at_import(one)


def packages_of(path: Path) -> set[Path]:
    """The `__init__` of each package around a file."""
    inits = {folder / "__init__.py" for folder in path.parents if folder.is_relative_to(PACKAGE)}
    return inits - {path}


def needs(path: Path) -> set[Path]:
    """Files that run during the import of a file, except those of its own packages."""
    tree = ast.Module(list(at_import(ast.parse(path.read_text(encoding="utf-8")))), [])
    found = {f for name in imports_in(tree) for f in modules_of(name) if name.startswith("mjxgait")}
    return {g for f in found for g in (f, *packages_of(f))} - {path} - packages_of(path)


def test_any_module_may_be_imported_first():
    """No file needs itself, nor does the `__init__` of a package."""
    arrows = {path: needs(path) for path in files()}
    while arrows:
        free = {path for path, below in arrows.items() if not below & set(arrows)}
        assert free, f"a circle among {sorted(name_of(p) for p in arrows)}"
        arrows = {path: below for path, below in arrows.items() if path not in free}


def reached(name: str) -> set[str]:
    """All direct and indirect imports of a module, inside the package and outside."""
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


@pytest.mark.parametrize("module", ["mjxgait.evolution.evolution", "mjxgait.evolution.variation"])
def test_evolution_does_not_depend_on_what_a_genome_controls(module: str):
    for forbidden in (
        "mujoco",
        "mjxgait.creature.creature",
        "mjxgait.controllers.base",
        "mjxgait.simulation",
    ):
        assert not leads_to(module, forbidden)


@pytest.mark.parametrize("own", ["controllers", "tasks", "evolution", "simulation"])
def test_compiled_code_leaves_mujoco_to_the_physics(own: str):
    """Controllers, tasks and operators use arrays; only physics and creatures use a model."""
    reference = "controllers/sims_brain/reference_*"
    for path in (PACKAGE / own).rglob("*.py"):
        if fnmatch.fnmatchcase(name_of(path), reference):
            continue
        assert "mujoco" not in {name.split(".")[0] for name in imports(path)}, path.name


def test_only_one_file_calls_jit():
    """A run has one program: a second jit elsewhere would be a second compilation.

    Random keys and initial conditions are drawn before, once for a run. Without a program of their
    own, each of their 60 operations would be compiled alone.
    """
    ours = [
        PACKAGE / name for name in ("controllers", "tasks", "evolution", "simulation", "training")
    ]
    calls = {
        name_of(path)
        for folder in ours
        for path in folder.rglob("*.py")
        if "jax.jit" in path.read_text(encoding="utf-8")
    }
    assert calls <= {"training/stages", "evolution/chance", "tasks/starts"}
