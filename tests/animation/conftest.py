"""A run of the smallest creature, and shorter walks."""

import pytest
from rendering.made_up import treading, write_run

from mjxgait.rendering import video


@pytest.fixture(scope="session")
def stool_run(stool, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("runs") / "stool", stool, treading(stool))


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Find a stride in fewer seconds; those of made-up walks are all alike."""
    monkeypatch.setattr(video, "LOOP_SECONDS", 4.0)
