"""Docstrings describe arguments and attributes that exist."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "mjxgait"
SECTION = re.compile(r"^(?:Args|Attributes):\n((?: +.*\n?|\n)+)", re.MULTILINE)
ENTRY = re.compile(r"^  ([a-z_][a-z_0-9]*(?:, [a-z_][a-z_0-9]*)*): ", re.MULTILINE)


def described(docstring: str) -> Iterator[str]:
    """Names in the sections `Args` and `Attributes`."""
    for section in SECTION.findall(docstring):
        for names in ENTRY.findall(section):
            yield from names.split(", ")


def arguments(function: ast.FunctionDef) -> set[str]:
    given = function.args
    return {one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)}


def known(node: ast.FunctionDef | ast.ClassDef) -> set[str]:
    """Arguments of a function; attributes of a class, and arguments of its `__init__`."""
    if isinstance(node, ast.FunctionDef):
        return arguments(node)
    inner = list(ast.walk(node))
    fields = {one.target.id for one in node.body if isinstance(one, ast.AnnAssign)}
    stored = {one.attr for one in inner if isinstance(one, ast.Attribute)}
    init = [one for one in inner if isinstance(one, ast.FunctionDef) and one.name == "__init__"]
    return fields | stored | set().union(*map(arguments, init))


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.stem)
def test_described_names_exist(path: Path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            unknown = set(described(ast.get_docstring(node) or "")) - known(node)
            assert not unknown, f"{node.name}: {unknown}"
