"""A run folder as an object."""

import dataclasses
import html
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjxgait.certification import outdated, read_certificate, verdict_of
from mjxgait.certification.verdict import Document
from mjxgait.champion import Champion
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.files import path_of
from mjxgait.training.folder import CERTIFICATE, CHAMPION, METRICS, open_champion, open_run
from mjxgait.training.logs import PARENTS, columns, read_metrics

if TYPE_CHECKING:  # all drawing code; an extra
    import pandas

    from mjxgait.animation.keys.refine import Departure

Place = str | Path


@dataclasses.dataclass(frozen=True)
class Run:
    """A run folder.

    Attributes:
      folder: its path.
    """

    folder: Path

    @property
    def creature(self) -> Creature:
        """The champion's body: its own if bodies evolve, else the one given to the run."""
        if (self.folder / CHAMPION).exists():
            return open_champion(self.folder)[0]
        return open_run(self.folder)[0]

    @property
    def config(self) -> Config:
        """The settings, with every key."""
        return open_run(self.folder)[1]

    @property
    def champion(self) -> Champion:
        """The best individual: its genome by name, its settings, its fitness.

        Raises:
          UserError: no champion yet.
        """
        return open_champion(self.folder)[1]

    @property
    def certificate(self) -> Document | None:
        """Contents of `certificate.json`; None before an examination."""
        return read_certificate(self.folder / CERTIFICATE)

    @property
    def certified(self) -> bool:
        """True if the champion passed every criterion of the shipped rules on its ground."""
        document = self.certificate
        if document is None or not verdict_of(document).certified:
            return False
        return outdated(document, self.champion, self.creature) is None

    @property
    def departure(self) -> "Departure":
        """Difference between the champion and the cycle given to `refine`, in numbers and words.

        Raises:
          UserError: the run was not made by `refine`, or has no champion.
        """
        from mjxgait.animation.keys.refine import departure_of

        return departure_of(self.folder)

    def metrics(self) -> dict[str, np.ndarray]:
        """Return each metric of `metrics.jsonl` over generations [G], NaN where it is missing.

        `mothers` and `fathers`, if logged, are [G, P].
        """
        lines = read_metrics(self.folder / METRICS)
        found = columns(lines)
        for name in PARENTS:
            places = [line[name] for line in lines if name in line]
            if 0 < len(places) == len(lines):
                found[name] = np.array(places)
        return found

    def _repr_html_(self) -> str:
        """Show the result and the walk in a notebook."""
        place = f"<code>{html.escape(str(self.folder))}</code>"
        if not (self.folder / CHAMPION).exists():
            return f"<p>{place}: no champion yet</p>"
        from mjxgait.rendering.notebook import walk_image

        verdict = "certified" if self.certified else "not certified"
        words = f"{html.escape(self.creature.name)}, {verdict}"
        fitness = f"fitness {self.champion.fitness:.3f}"
        return f"<p>{place}: {words}, {fitness}</p>{walk_image(self.folder)}"

    def frame(self) -> "pandas.DataFrame":
        """Return `metrics.jsonl` as a table, a row per generation; without those of parents.

        Raises:
          UserError: pandas is not installed, or the log is damaged.
        """
        lines = read_metrics(self.folder / METRICS)
        rows = [
            {name: value for name, value in line.items() if name not in PARENTS} for line in lines
        ]
        columns = None if rows else ["generation"]
        return _pandas().DataFrame(rows, columns=columns).set_index("generation")


def runs_of(given: Run | Place | Iterable[Run | Place]) -> Iterable[Run | Place]:
    """Return the runs that are given as one or several."""
    return [given] if isinstance(given, Run | str | os.PathLike) else given


def frames(runs: Run | Place | Iterable[Run | Place]) -> "pandas.DataFrame":
    """Return the metrics of several runs as one table; see `Run.frame`.

    The index has the levels `run`, the folder, and `generation`; a column `seed` comes first.

    Raises:
      UserError: see `Run.frame`; a folder is no run, or there is none.
    """
    known = {str(run.folder): run for run in map(opened, runs_of(runs))}
    if not known:
        raise UserError("frames: there is no run; name at least one run folder")
    tables = {name: run.frame() for name, run in known.items()}
    for name, run in known.items():
        tables[name].insert(0, "seed", run.config.seed)
    return _pandas().concat(tables, names=["run"])


def _pandas() -> Any:
    try:
        import pandas
    except ImportError:
        raise UserError(f"tables need pandas: {install_command('pandas')}") from None
    return pandas


def opened(run: Run | Place) -> Run:
    """Return a run, opened if it is a folder; raises as `open`."""
    return run if isinstance(run, Run) else open(run)


def open(folder: Place) -> Run:
    """Open an existing run.

    Raises:
      UserError: not a run folder.
    """
    run = Run(path_of(folder))
    open_run(run.folder)
    return run
