"""Commands that install missing extras, for a package and for a checkout."""

import sys
import tomllib
from pathlib import Path

import pytest

from mjxgait.animation.export import export_usd
from mjxgait.config import layers
from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.training.trackers import KINDS

ROOT = Path(__file__).parents[2]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package in a folder without a project file."""
    monkeypatch.setattr(layers.resources, "files", lambda name: tmp_path / "src" / name)
    (tmp_path / "src" / "mjxgait").mkdir(parents=True)
    return tmp_path / "src"


def test_an_installed_package_is_named(checkout: Path):
    assert install_command("video") == 'pip install "mjxgait[video]"'


def test_a_checkout_is_installed_from_its_folder(checkout: Path, monkeypatch):
    (checkout / "pyproject.toml").write_text("")
    assert install_command("video") == f'pip install -e "{checkout}[video]"'
    monkeypatch.chdir(checkout)
    assert install_command("video") == 'pip install -e ".[video]"'


def test_named_extras_exist():
    known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    used = {
        text.partition("install_command('")[2].partition("'")[0]
        for folder in ("mjxgait", "benchmarks")
        for file in (ROOT / folder).rglob("*.py")
        for text in file.read_text(encoding="utf-8").splitlines()
        if "install_command('" in text
    }
    assert used == {"video", "usd", "cluster", "peers", "pandas", "gym", "robots"}
    assert used | set(KINDS) <= known.keys()


def test_usd_without_the_extra_is_one_sentence(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(UserError, match=r"walk\.usda: USD needs an extra: pip install") as said:
        export_usd(None, Path("walk.usda"))
    assert install_command("usd") in str(said.value)
