"""What several tests need."""

from pathlib import Path

import jax
import pytest

from mjxgait.cli import main
from mjxgait.settings.config import Config, FitnessConfig
from mjxgait.settings.tables import build
from mjxgait.tasks.score import in_order
from mjxgait.tasks.walk.fitness import TERMS, signed_weights

STOOL = Path(__file__).parent / "data" / "stool"


def small_config(**tables: dict) -> Config:
    """A config for runs of a second: few individuals, short episodes.

    Of the same shape as `test_run.SMALL`, and with MJX as the study of `test_ablate`: they share
    its program.
    """
    table = {
        "evolution": {"population": 6, "generations": 3},
        "rollout": {"seconds": 0.4, "starts": 2, "lanes": 4},
    }
    for name, values in tables.items():
        table[name] = {**table.get(name, {}), **values}
    return build(Config, table, "test")


def weight_vector(config: FitnessConfig, generation: jax.Array) -> jax.Array:
    """The weights [F] of walking in the order of its terms."""
    return in_order(signed_weights(config, generation), TERMS)


def said_by(capsys: pytest.CaptureFixture, *arguments: object, code: int) -> str:
    """What a command says that ends with this code, in this process: none needs to be started."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments)])
    assert ended.value.code == code
    said = capsys.readouterr()
    return said.out + said.err
