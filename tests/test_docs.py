"""Documentation: every link has a target, and the index links every page."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import mjxgait

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), *ROOT.glob("*.md")])
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]*))?\)")


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path):
    for path, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), path
        if anchor and target.suffix == ".md":
            assert anchor in anchors(target), f"{path}#{anchor}"


def test_every_page_is_found_from_the_index():
    index = (DOCS / "README.md").read_text(encoding="utf-8")
    linked = {(DOCS / path).resolve() for path, _ in LINK.findall(index) if path}
    assert {page for page in DOCS.rglob("*.md") if page.name != "README.md"} <= linked


def test_every_page_is_in_the_navigation_of_the_site():
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    listed = re.findall(r"^ +- (?:[^:#]+: )?(\S+\.md)$", site, re.M)
    assert len(listed) == len(set(listed))
    assert set(listed) == {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")}


def test_the_site_is_built_without_a_warning(tmp_path: Path):
    """Such as a link without a target, or a docstring that describes no argument."""
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", tmp_path]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert not done.returncode, done.stderr
    pages = {page.relative_to(DOCS).with_suffix("") for page in DOCS.rglob("*.md")}
    addresses = {page.parent if page.name == "README" else page for page in pages}
    assert all((tmp_path / address / "index.html").is_file() for address in addresses)


def test_no_page_links_out_of_the_site():
    """GitHub would follow such a link; the site has no target for it."""
    for page in DOCS.rglob("*.md"):
        for path, _ in LINK.findall(page.read_text(encoding="utf-8")):
            assert (page.parent / path).resolve().is_relative_to(DOCS), f"{page.name}: {path}"


def test_the_page_about_python_shows_every_public_name():
    page = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^::: mjxgait\.(\w+)$", page, re.M)) == sorted(mjxgait.__all__)


@pytest.mark.parametrize(
    "folder", ["mjxgait", "scripts", "benchmarks", "configs", "envs", "tests", "addons"]
)
def test_pages_that_files_name_exist(folder: str):
    for file in (ROOT / folder).rglob("*"):
        if file.suffix in (".py", ".toml", ".md", ".c"):
            for name in re.findall(r"\bdocs/[\w/-]+\.md", file.read_text(encoding="utf-8")):
                assert (ROOT / name).exists(), f"{file.relative_to(ROOT)}: {name}"
