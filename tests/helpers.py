"""What several tests need."""

from pathlib import Path

from mjxgait.settings.config import Config
from mjxgait.settings.tables import build

STOOL = Path(__file__).parent / "data" / "stool"


def small_config(**tables: dict) -> Config:
    """A config for runs of a second: few individuals, short episodes."""
    table = {
        "evolution": {"population": 6, "generations": 3},
        "rollout": {"seconds": 0.4, "starts": 2, "lanes": 4, "physics": "mjx"},
    }
    for name, values in tables.items():
        table[name] = {**table.get(name, {}), **values}
    return build(Config, table, "test")
