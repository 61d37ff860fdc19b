"""A run of one population or of several, by this machine or by a cluster."""

from pathlib import Path

from mjxgait.cluster import islands
from mjxgait.cluster.blocks import Blocks
from mjxgait.cluster.board import crew_at
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.runs import loop
from mjxgait.runs.screen import Screen
from mjxgait.settings.config import Config


def evolve(
    folder: Path,
    creature: Creature,
    config: Config,
    screen: Screen,
    resume: bool = False,
    generation: int | None = None,
    cluster: str | None = None,
) -> bool:
    """Runs, or goes on with, the evolution in a run folder; returns whether it came to its end.

    Args:
      resume: go on from a checkpoint, the latest or that of `generation`.
      cluster: address of the one that does it, if not this machine.

    Raises:
      UserError: see `connected`; or a single checkpoint was named, and there are islands.
    """
    several = config.evolution.islands.count > 1
    if several and generation is not None:
        raise UserError(f"{folder}: islands go on from their latest checkpoints, not --generation")
    with crew_at(cluster, screen.console) as crew:
        if several:
            return islands.train(folder, creature, config, screen, crew, resume)
        evaluator = Blocks(crew, creature, config) if cluster else None
        return loop.train(folder, creature, config, screen, resume, generation, evaluator)
