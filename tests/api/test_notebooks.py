"""The notebooks of docs/guide run to their end, on a small body and for a short time."""

import json
from collections.abc import Callable
from pathlib import Path

import matplotlib
import pytest
from helpers import STOOL, short_examination

GUIDE = Path(__file__).parents[2] / "docs" / "guide"
NOTEBOOKS = sorted(path.name for path in GUIDE.glob("*.ipynb"))
SHORT = {
    "evolution": {"population": 6, "generations": 2},
    "rollout": {"seconds": 0.4, "starts": 2, "promote": 1.0, "lanes": 4},
    "examination": {"candidates": 1, "draws": 2},
}
BLOCKS = {
    **SHORT,
    "rollout": {"seconds": 0.4, "lanes": 2},
    "controller": {"nodes": 3, "parts": 3, "links": 4},
    "fitness": {"settle": 0.1},
}
Run = Callable[..., dict[str, object]]


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Examinations of 3 s; full ones take ten times as long."""
    monkeypatch.setattr("mjxgait.certification.certificate.CertificateConfig", short_examination)
    matplotlib.use("Agg")


def cells_of(name: str) -> list[str]:
    """Return the text of each code cell."""
    cells = json.loads((GUIDE / name).read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a notebook in an empty folder; the arguments replace values of its first cell."""
    monkeypatch.chdir(tmp_path)

    def run(name: str, **values: object) -> dict[str, object]:
        first, *others = cells_of(name)
        names: dict[str, object] = {}
        exec(first, names)
        assert values.keys() <= names.keys()
        names |= values
        for cell in others:
            exec(cell, names)
        return names

    return run


def test_a_walk(run, capsys):
    run("walk.ipynb", CREATURE=STOOL, SETTINGS=SHORT)
    assert Path("runs/notebook/champion.json").exists()
    said = capsys.readouterr().out
    assert "1 stays up" in said
    assert "hips at 0.30 and 0.36 m" in said


@pytest.mark.slow
@pytest.mark.thorough("it compiles the programs of a body of its own")
def test_your_own_body(run, capsys):
    run("your-own-body.ipynb", SETTINGS=SHORT)
    assert all(Path(name).stat().st_size for name in ("walk.png", "walk.glb", "walk.html"))
    said = capsys.readouterr().out
    assert "8 joints, " in said
    assert "1 stays up" in said


@pytest.mark.slow
@pytest.mark.thorough("it compiles the programs of modular bodies")
def test_creatures_that_evolve(run, capsys):
    run("creatures-that-evolve.ipynb", SETTINGS=BLOCKS)
    assert Path("swim.png").stat().st_size
    assert "kg, joints: " in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.thorough("it compiles the programs of a task of its own")
def test_your_own_task(run):
    names = run("your-own-task.ipynb", CREATURE=STOOL, SETTINGS=SHORT)
    assert names["run"].certificate["criteria"][-1]["name"] == "squats"


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_cells_are_code_without_output(name: str):
    for number, cell in enumerate(cells_of(name)):
        compile(cell, f"{name}, cell {number}", "exec")
    assert not any(cell.get("outputs") for cell in json.loads((GUIDE / name).read_text())["cells"])


def test_every_notebook_is_run():
    ran = {
        "walk.ipynb",
        "your-own-body.ipynb",
        "creatures-that-evolve.ipynb",
        "your-own-task.ipynb",
    }
    assert set(NOTEBOOKS) == ran
