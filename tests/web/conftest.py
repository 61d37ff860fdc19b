"""A run of the smallest creature, and a browser."""

import pytest
from rendering.made_up import treading, write_run
from web.browser import launch

from mjxgait.rendering import video
from mjxgait.web import page


@pytest.fixture(scope="session")
def stool_run(stool, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("runs") / "stool", stool, treading(stool))


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium; needs the apt package chromium and the Python package playwright.

    Closed after each file: an open animated page takes more than a core.
    """
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="needs the Python package playwright"
    )
    with playwright.sync_playwright() as play:
        chromium = launch(play)
        yield chromium
        chromium.close()


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Show fewer seconds of a walk."""
    for module in (video, page):
        monkeypatch.setattr(module, "LOOP_SECONDS", 5.0)
