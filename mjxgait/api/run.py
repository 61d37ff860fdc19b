"""A run folder as an object."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjxgait.certification import judged, outdated, read_certificate
from mjxgait.champion import Champion
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.training.folder import (
    CERTIFICATE,
    CHAMPION,
    METRICS,
    open_champion,
    open_run,
    read_metrics,
)

if TYPE_CHECKING:  # it leads to all that draws
    from mjxgait.animation.keys.departure import Departure

Place = str | Path


@dataclasses.dataclass(frozen=True)
class Run:
    """A run folder.

    folder: where everything of it lies (the README says what).
    """

    folder: Path

    @property
    def creature(self) -> Creature:
        """The champion's body: where bodies evolve its own, else that which the run was given."""
        if (self.folder / CHAMPION).exists():
            return open_champion(self.folder)[0]
        return open_run(self.folder)[0]

    @property
    def config(self) -> Config:
        """The settings, every key."""
        return open_run(self.folder)[1]

    @property
    def champion(self) -> Champion:
        """The best individual: its genome by name, its settings, its fitness.

        Raises:
          UserError: there is none yet.
        """
        return open_champion(self.folder)[1]

    @property
    def certificate(self) -> dict[str, Any] | None:
        """What the examiner said, as `certificate.json` has it; None before an examination."""
        return read_certificate(self.folder / CERTIFICATE)

    @property
    def certified(self) -> bool:
        """Whether its champion has passed every criterion, by the shipped rules, on its ground."""
        document = self.certificate
        if document is None or not judged(document).certified:
            return False
        return outdated(document, self.champion, self.creature) is None

    @property
    def departure(self) -> "Departure":
        """How far the champion is from the cycle that the run stays near, in numbers and in words.

        Raises:
          UserError: the run was not made by `refine`, or has no champion.
        """
        from mjxgait.animation.keys.departure import departure_of

        return departure_of(self.folder)

    def metrics(self) -> dict[str, np.ndarray]:
        """Each number of `metrics.jsonl` over generations [G], NaN where there was none; `mothers` [G, P]
        where it tells of them.
        """
        lines = read_metrics(self.folder / METRICS)
        names = dict.fromkeys(name for line in lines for name in line)
        return {
            name: np.array([np.nan if line.get(name) is None else line[name] for line in lines])
            for name in names
        }


def open(folder: Place) -> Run:
    """A run that is there already.

    Raises:
      UserError: it is not a run folder.
    """
    run = Run(Path(folder))
    open_run(run.folder)
    return run
