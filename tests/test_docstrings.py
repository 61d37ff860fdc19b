"""Docstrings describe arguments and attributes that exist, and name what exists elsewhere."""

import ast
import functools
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "mjxgait"
SECTION = re.compile(r"^(?:Args|Attributes):\n((?: +.*\n?|\n)+)", re.MULTILINE)
ENTRY = re.compile(r"^  ([a-z_][a-z_0-9]*(?:, [a-z_][a-z_0-9]*)*): ", re.MULTILINE)
DOTTED = re.compile(r"`([A-Za-z_]\w*(?:\.\w+)+)`")
FILES = {"js", "json", "jsonl", "py", "toml", "xml"}
TABLES = {"controller", "fitness"}
"""Tables of settings whose class depends on the controller or the task."""
OTHERS = {"gymnasium", "jax", "logging", "mujoco", "optax"}
"""Packages whose names are not looked up."""


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


def strings(tree: ast.Module) -> Iterator[str]:
    """Docstrings of a module and its parts, those below attributes included."""
    for node in ast.walk(tree):
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))):
                yield text


def bound(body: list[ast.stmt]) -> set[str]:
    """Names that the statements of a module or a class bind."""
    names: set[str] = set()
    for node in body:
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
            case ast.Import(names=imported) | ast.ImportFrom(names=imported):
                names |= {(one.asname or one.name).split(".")[0] for one in imported}
            case ast.Assign() | ast.AnnAssign():
                names |= {
                    one.id
                    for one in ast.walk(node)
                    if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)
                }
            case ast.If(body=inner) | ast.Try(body=inner):
                names |= bound(inner)
    return names


def annotated(tree: ast.Module) -> Iterator[tuple[str, set[str]]]:
    """Arguments, attributes and functions, each with the words of its type."""
    for node in ast.walk(tree):
        match node:
            case ast.arg(arg=name, annotation=ast.expr() as kind):
                yield name, words(kind)
            case ast.AnnAssign(target=target, annotation=kind):
                yield ast.unparse(target).split(".")[-1], words(kind)
            case ast.FunctionDef(name=name, returns=ast.expr() as kind):
                yield name, words(kind)


def words(kind: ast.expr) -> set[str]:
    return set(re.findall(r"\w+", ast.unparse(kind)))


class Names:
    """What the package's dotted names may mean."""

    def __init__(self) -> None:
        self.modules: dict[tuple[str, ...], set[str]] = {}
        self.classes: defaultdict[str, set[str]] = defaultdict(set)
        self.bases: defaultdict[str, set[str]] = defaultdict(set)
        self.types: defaultdict[str, set[str]] = defaultdict(set)
        self.aliases: defaultdict[str, set[str]] = defaultdict(set)
        for path in PACKAGE.rglob("*.py"):
            self._read(path, ast.parse(path.read_text(encoding="utf-8")))

    def _read(self, path: Path, tree: ast.Module) -> None:
        parts, names = path.relative_to(PACKAGE.parent).with_suffix("").parts, bound(tree.body)
        if parts[-1] == "__init__":
            parts, names = parts[:-1], names | {one.stem for one in path.parent.iterdir()}
        self.modules[parts] = names
        for name, kinds in annotated(tree):
            self.types[name] |= kinds
        for node in ast.walk(tree):
            if isinstance(node, ast.alias) and node.asname:
                self.aliases[node.asname].add(node.name)
            if isinstance(node, ast.ClassDef):
                attributes = {one.attr for one in ast.walk(node) if isinstance(one, ast.Attribute)}
                self.classes[node.name] |= bound(node.body) | attributes
                self.bases[node.name] |= set().union(*map(words, node.bases)) - {node.name}

    def members(self, name: str) -> set[str]:
        """Attributes of a class, inherited ones included."""
        return self.classes.get(name, set()).union(*map(self.members, self.bases.get(name, ())))

    def in_module(self, owner: tuple[str, ...], name: str) -> bool:
        paths = [owner, *((*owner[:-1], one) for one in self.aliases.get(owner[-1], ()))]
        return any(
            module[-len(path) :] == path and name in names
            for module, names in self.modules.items()
            for path in paths
        )

    def in_class(self, owner: str, name: str) -> bool:
        """Whether a class of this name, or that of a value of this name, has the attribute."""
        kinds = {owner} | self.types.get(owner, set())
        if owner in TABLES:
            kinds |= {kind for kind in self.classes if kind.endswith("Config")}
        return any(name in self.members(kind) for kind in kinds)

    def exist(self, dotted: str) -> bool:
        *owner, name = dotted.split(".")
        known = self.in_module(tuple(owner), name) or self.in_class(owner[-1], name)
        return known or owner[0] in OTHERS


names = functools.cache(Names)


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.stem)
def test_dotted_names_exist(path: Path):
    """`module.name`, `Class.attribute` or `value.attribute`."""
    texts = strings(ast.parse(path.read_text(encoding="utf-8")))
    dotted = {one for text in texts for one in DOTTED.findall(text)}
    dotted = {one for one in dotted if one.split(".")[-1] not in FILES}
    assert not {one for one in dotted if not names().exist(one)}
