"""Run of one population or of several, on this machine or on a cluster."""

import contextlib
from collections.abc import Callable
from pathlib import Path

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.distributed import islands
from mjxgait.distributed.chunks import Blocks
from mjxgait.distributed.dashboard import crew_at
from mjxgait.errors import UserError
from mjxgait.training import loop
from mjxgait.training.lock import locked
from mjxgait.training.screen import Screen


def evolve(
    folder: Path,
    creature: Creature,
    config: Config,
    screen: Screen,
    resume: bool = False,
    generation: int | None = None,
    cluster: str | None = None,
    begin: Callable[[], object] = lambda: None,
) -> bool:
    """Start or resume the evolution in a run folder; return whether it reached its end.

    Args:
      resume: continue from a checkpoint, the latest or that of `generation`.
      cluster: address of the cluster that computes it, if not this machine.
      begin: makes the folder of a new run; called after the last check that can refuse the run.

    Raises:
      UserError: see `connected`; a single checkpoint was named, and there are islands; or another
        process works on the run.
    """
    several = config.evolution.islands.count > 1
    if several and generation is not None:
        raise UserError(f"{folder}: islands go on from their latest checkpoints, not --generation")
    with contextlib.ExitStack() as held:
        if resume:
            held.enter_context(locked(folder))

        def begin_new() -> None:
            begin()
            if not resume:
                held.enter_context(locked(folder))

        crew = held.enter_context(crew_at(cluster, screen.console))
        if several:
            return islands.train(folder, creature, config, screen, crew, resume, begin_new)
        evaluator = Blocks(crew, creature, config) if cluster else None
        return loop.train(
            folder, creature, config, screen, resume, generation, evaluator, begin_new
        )
