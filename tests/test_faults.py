"""The list of faults is valid, and the script that plants them names the test that catches each."""

import ast
import importlib.util
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


def _script() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "plant_faults", ROOT / "scripts" / "plant_faults.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


script = _script()
FAULTS = {fault.name: fault for fault in script.read_faults()}


def test_the_list_is_long_and_names_each_fault_once():
    assert len(FAULTS) == len(script.read_faults()) >= 30


def test_the_docs_list_every_fault():
    """docs/research/faults.md has a row with the file of each; docs/testing.md has their number."""
    rows = (ROOT / "docs" / "research" / "faults.md").read_text(encoding="utf-8")
    text = (ROOT / "docs" / "testing.md").read_text(encoding="utf-8")
    places = {name: fault.file.removeprefix("mjxgait/") for name, fault in FAULTS.items()}
    missing = [name for name, place in places.items() if f"| {name} | `{place}` | " not in rows]
    assert not missing
    assert f"All {len(FAULTS)} are caught" in text


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_can_be_planted(name: str):
    """Its text occurs exactly once, the result is valid if Python, and the named tests exist."""
    fault = FAULTS[name]
    assert fault.why
    planted = script.planted(fault)
    if fault.file.endswith(".py"):
        ast.parse(planted)
    assert fault.tests
    for test in fault.tests:
        file, _, function = test.partition("::")
        assert f"def {function.partition('[')[0]}" in (ROOT / file).read_text(), test


TOY = {
    "toy.py": "def double(x):\n    return 2 * x\n\n\ndef half(x):\n    return x / 2\n",
    "tests/test_toy.py": "import toy\n\n\ndef test_double():\n    assert toy.double(3) == 6\n",
    "tests/test_rest.py": "def test_nothing():\n    pass\n",
    "pytest.ini": "[pytest]\nmarkers = slow\n",
}
CAUGHT = ("wrong factor", "return 2 * x", "return 3 * x", "tests/test_toy.py")
BY_THE_REST = ("found late", "return 2 * x", "return 0", "tests/test_rest.py")
MISSED = ("wrong divisor", "return x / 2", "return x / 3", "tests/test_toy.py")
ROTTEN = ("gone", "return 4 * x", "return 5 * x", "tests/test_toy.py")


def test_a_copy_omits_only_generated_files(tmp_path: Path):
    """A package may have the name of a folder of results."""
    kept, left = ("toy/runs/loop.py", "tests/a.py"), ("runs/x/config.toml", ".git/HEAD")
    for name in (*kept, *left):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    with script.copied(tmp_path) as tree:
        assert {n for n in (*kept, *left) if (tree / n).exists()} == set(kept)


@pytest.fixture
def few_plugins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Load only what `-n 0` needs: tests of a toy tree start pytest a dozen times."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setenv("PYTEST_PLUGINS", "xdist.plugin")


def planting(folder: Path, *faults: tuple[str, str, str, str]) -> list[str]:
    """Arguments for the script to plant these faults in a toy tree."""
    for name, text in TOY.items():
        (folder / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "tree" / name).write_text(text)
    rows = [
        f'[[fault]]\nname = "{name}"\nfile = "toy.py"\nold = "{old}"\nnew = "{new}"\n'
        f'tests = ["{test}"]\nwhy = "it is wrong"\n'
        for name, old, new, test in faults
    ]
    (folder / "faults.toml").write_text("\n".join(rows))
    return ["--list", str(folder / "faults.toml"), "--root", str(folder / "tree")]


@pytest.mark.usefixtures("few_plugins")
def test_the_test_that_catches_a_fault_is_named(tmp_path: Path, capsys: pytest.CaptureFixture):
    assert script.main(planting(tmp_path, CAUGHT, BY_THE_REST)) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    assert len(rows) == 3
    assert all("`tests/test_toy.py::test_double` | `assert " in row for row in rows[1:])
    assert (tmp_path / "tree" / "toy.py").read_text() == TOY["toy.py"]


@pytest.mark.usefixtures("few_plugins")
def test_the_script_fails_if_nothing_catches_a_fault(tmp_path: Path, capsys: pytest.CaptureFixture):
    assert script.main([*planting(tmp_path, MISSED), "--trust"]) == 1
    assert "0 of 1 caught" in capsys.readouterr().out


@pytest.mark.usefixtures("few_plugins")
def test_a_test_that_fails_anyway_has_caught_nothing(tmp_path: Path, capsys: pytest.CaptureFixture):
    """No fault names it, so the first run without a fault omits it."""
    arguments = [*planting(tmp_path, MISSED), "--trust"]
    (tmp_path / "tree/tests/test_rest.py").write_text("def test_nothing():\n    assert False\n")
    assert script.main(arguments) == 1
    said = capsys.readouterr().out
    assert "fails without the fault too" in said
    assert "0 of 1 caught" in said


def test_a_page_keeps_its_other_rows(tmp_path: Path):
    reason = f"E | 1 in {Path(tempfile.gettempdir()) / 'one' / 'two' / 'x.xml'}"
    found = script.Finding(script.Fault("b", "mjxgait/x.py", "", "", (), "w"), "t::u", 1.0, reason)
    page = f"# Title\n\n{script.HEAD}\n| c | `y.py` | v | `t` | |\n| b | `x.py` | old | `t` | |\n"
    lines = script.table([found], page, ["b", "c"]).splitlines()
    assert lines[0] == "# Title"
    assert lines[-2:] == [
        "| b | `x.py` | w | `t::u` | `E   1 in …/x.xml` |",
        "| c | `y.py` | v | `t` | |",
    ]


def test_a_fault_without_its_old_text_is_refused(tmp_path: Path):
    with pytest.raises(SystemExit, match=r'"gone": its old text is 0 times in toy\.py'):
        script.main(planting(tmp_path, ROTTEN))


@pytest.mark.usefixtures("few_plugins")
def test_the_script_refuses_to_start_if_tests_fail_anyway(tmp_path: Path):
    arguments = planting(tmp_path, CAUGHT)
    (tmp_path / "tree" / "toy.py").write_text("def double(x):\n    return 2 * x + 1\n")
    (tmp_path / "faults.toml").write_text(
        (tmp_path / "faults.toml").read_text().replace("return 2 * x", "return 2 * x + 1", 1)
    )
    with pytest.raises(SystemExit, match="fail without a fault"):
        script.main(arguments)
