import os
from pathlib import Path

os.environ.setdefault(
    "JAX_COMPILATION_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache" / "jax")
)

import jax
import pytest
from helpers import STOOL

from mjxgait.creature import Creature, load_creature
from mjxgait.settings.shipped import data_folder

jax.config.update("jax_num_cpu_devices", 2)

SHIPPED = sorted(path.parent.name for path in data_folder("envs").glob("*/creature.toml"))


@pytest.fixture(scope="session")
def stool() -> Creature:
    """The smallest creature: a plate on four one-joint legs."""
    return load_creature(STOOL)


@pytest.fixture(scope="session", params=SHIPPED)
def shipped(request: pytest.FixtureRequest) -> Creature:
    """Each creature that the program ships."""
    return load_creature(data_folder("envs") / request.param)
