"""A run of the smallest creature."""

import pytest
from rendering.made_up import treading, write_run


@pytest.fixture(scope="session")
def stool_run(stool, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("runs") / "stool", stool, treading(stool))
