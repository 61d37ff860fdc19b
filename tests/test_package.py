"""The package that is released: it has one version and every file that a checkout has."""

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import mjxgait

ROOT = Path(__file__).parents[1]
SHIPPED = {"mjxgait": "mjxgait", "envs": "mjxgait/data/envs", "configs": "mjxgait/data/configs"}
"""Folders of the checkout, and where each lies in a wheel."""


def files(folder: str) -> set[str]:
    """Return the paths within a folder of the checkout, without compiled Python."""
    paths = (path for path in (ROOT / folder).rglob("*") if path.is_file())
    return {path.relative_to(ROOT / folder).as_posix() for path in paths if path.suffix != ".pyc"}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build both without isolation, so that nothing is fetched."""
    pytest.importorskip("hatchling", reason="needs hatchling, of the extra `test`")
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-P", "-m", "hatchling", "build", "--directory", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return folder


def test_a_wheel_has_every_creature_config_and_page(built: Path):
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    expected = {f"{place}/{path}" for folder, place in SHIPPED.items() for path in files(folder)}
    assert names == expected
    for path in (
        "data/envs/crab/creature.xml",
        "data/configs/default.toml",
        "web/assets/page.html",
    ):
        assert f"mjxgait/{path}" in names


def test_a_source_archive_can_be_tested_and_built_again(built: Path):
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        names = {name.partition("/")[2] for name in opened.getnames()}
    for folder in (*SHIPPED, "tests"):
        assert {f"{folder}/{path}" for path in files(folder)} <= names, folder
    assert {"pyproject.toml", "constraints.txt", "README.md", "LICENSE", ".ci/run"} <= names


def test_what_else_lies_in_a_checkout_is_not_released(tmp_path: Path):
    builder = pytest.importorskip("hatchling.builders.sdist", reason="needs hatchling")
    for folder in ("mjxgait", "runs", "shared"):
        (tmp_path / folder).mkdir()
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for path in ("README.md", "LICENSE", "notes.txt", "runs/champion.json", "shared/data.json"):
        (tmp_path / path).write_text("")
    shutil.copy(ROOT / "mjxgait" / "__init__.py", tmp_path / "mjxgait")
    (built,) = builder.SdistBuilder(str(tmp_path)).build(directory=str(tmp_path / "dist"))
    with tarfile.open(built) as opened:
        names = {name.partition("/")[2] for name in opened.getnames()}
    assert names == {"mjxgait/__init__.py", "pyproject.toml", "README.md", "LICENSE", "PKG-INFO"}


def test_the_version_stands_in_one_place(built: Path):
    (wheel,) = built.glob("*.whl")
    assert wheel.name.split("-")[1] == mjxgait.__version__
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["dynamic"] == ["version"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert not re.search(r"^version:", citation, re.M)


def test_the_changelog_keeps_its_form():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^## (\[Unreleased\]|\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d)$", text, re.M)
    assert len(blocks) == text.count("\n## ")
    assert blocks[0] == "[Unreleased]" or blocks[0].startswith(f"[{mjxgait.__version__}]")
    sections = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.+)$", text, re.M)) <= sections


def workflow(name: str) -> dict:
    """Return a workflow of GitHub."""
    yaml = pytest.importorskip("yaml")
    return yaml.safe_load((ROOT / ".github" / "workflows" / name).read_text(encoding="utf-8"))


def test_github_runs_what_the_check_runs():
    steps = workflow("ci.yml")["jobs"]["check"]["steps"]
    commands = {step["run"] for step in steps if "run" in step}
    check = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for command in ("ruff check .", "ruff format --check .", "mypy", "python -m pytest -n 2"):
        assert command in commands
        assert re.search(rf"^{re.escape(command)}( &)?$", check, re.M)
    extra = '--editable ".[test]" --constraint constraints.txt'
    assert f"uv pip install {extra}" in commands
    assert extra in check


def test_a_release_is_published_without_a_token():
    jobs = workflow("release.yml")["jobs"]
    assert jobs["publish"]["permissions"] == {"id-token": "write"}
    assert jobs["publish"]["needs"] == "build"
    text = (ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8")
    assert "secrets." not in text
