"""A search for the standing pose that is short enough for tests."""

import pytest

from mjxgait.importer import stance


@pytest.fixture
def a_short_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """The standing pose is sought a sixth as long, where it is not what a test looks at."""
    monkeypatch.setattr(stance, "FIRST", 60)
    monkeypatch.setattr(stance, "ROUNDS", 4)
