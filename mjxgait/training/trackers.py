"""Logs for the field's experiment trackers: TensorBoard, and Weights & Biases offline.

They follow `metrics.jsonl` and nothing reads them back, so a run and its result are the same with
and without them.
"""

import importlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from mjxgait.config.tables import read_toml
from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import CONFIG, METRICS
from mjxgait.training.logs import Line, read_metrics
from mjxgait.training.screen import Screen

GROUPS = {"term_": "term/", "outcome_": "outcome/"}
"""Beginnings of names in `metrics.jsonl`, and the groups that trackers show them in."""
FITNESS = ("best", "mean", "median", "lower_quartile", "upper_quartile", "worst", "spread")
EVENTS = "tensorboard"
"""Folder of the event files in a run folder."""


FLUSH = 10
"""s until TensorBoard sees a generation."""


class Tracker(Protocol):
    """A log of one run."""

    def write(self, line: Line) -> None:
        """Add a generation, already in `metrics.jsonl`."""
        ...

    def close(self) -> None:
        """Bring the log to the state of `metrics.jsonl`, and close it."""
        ...


def scalars(line: Line) -> dict[str, float]:
    """Return the numbers of a line of `metrics.jsonl`, under the names that trackers show."""
    numbers = {k: v for k, v in line.items() if isinstance(v, int | float) and k != "generation"}
    return {shown(name): float(value) for name, value in numbers.items()}


def shown(name: str) -> str:
    """Return a metric's name with its group."""
    for start, group in GROUPS.items():
        if name.startswith(start):
            return group + name.removeprefix(start)
    return ("fitness/" if name in FITNESS else "run/") + name


class TensorBoard:
    """Event files in a run folder.

    A session begins by declaring what is there void, and writes the whole log again: a resumed run
    has each generation once, whatever was dropped, and also those before it was tracked.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._latest = folder, -1
        self._file: Any = None
        self._x = _package("tensorboardX", "tensorboard")
        self._events = importlib.import_module("tensorboardX.proto.event_pb2")
        self._summaries = importlib.import_module("tensorboardX.proto.summary_pb2")

    def write(self, line: Line) -> None:
        """See `Tracker`."""
        generation = line["generation"]
        if self._file is None:
            with disk_errors(self._folder):
                self._file = self._x.FileWriter(str(self._folder / EVENTS), flush_secs=FLUSH)
            self._void_from(0)
            for known in read_metrics(self._folder / METRICS):
                if known["generation"] < generation:
                    self._add(known)
        elif generation <= self._latest:
            self._void_from(generation)
        self._add(line)

    def close(self) -> None:
        """See `Tracker`; an examination may have discarded the latest generations."""
        if self._file is None:
            return
        lines = read_metrics(self._folder / METRICS)
        last = lines[-1]["generation"] if lines else -1
        if last < self._latest:
            self._void_from(last + 1)
        self._file.close()

    def _add(self, line: Line) -> None:
        one = self._summaries.Summary
        values = [one.Value(tag=tag, simple_value=value) for tag, value in scalars(line).items()]
        self._file.add_summary(one(value=values), line["generation"])
        self._latest = line["generation"]

    def _void_from(self, generation: int) -> None:
        """Declare earlier events void from this generation on."""
        start = self._events.SessionLog(status=self._events.SessionLog.START)
        self._file.add_event(self._events.Event(step=generation, session_log=start))


class WandB:
    """An offline run of Weights & Biases, written at once when the run stops.

    So it is that of `metrics.jsonl`, and a resumed run writes a whole one anew.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._began = folder, False
        self._wandb = _package("wandb", "wandb")

    def write(self, line: Line) -> None:
        """See `Tracker`."""
        self._began = True

    def close(self) -> None:
        """See `Tracker`."""
        if not self._began:
            return
        run = self._wandb.init(
            mode="offline",
            dir=str(self._folder),
            project="mjxgait",
            name=self._folder.name,
            config=dict(read_toml(self._folder / CONFIG)),
        )
        for line in read_metrics(self._folder / METRICS):
            run.log(scalars(line), step=line["generation"])
        run.finish()


KINDS: dict[str, type[TensorBoard] | type[WandB]] = {"tensorboard": TensorBoard, "wandb": WandB}


def _package(name: str, extra: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise UserError(f"--log {extra} needs an extra: {install_command(extra)}") from None


@contextmanager
def tracked(folder: Path, names: Sequence[str], quiet: bool = False) -> Iterator[Screen]:
    """Yield a screen whose generations the named trackers log, and close these at the end.

    Raises:
      UserError: a tracker's package is not installed.
    """
    trackers = [KINDS[name](folder) for name in dict.fromkeys(names)]
    try:
        yield Screen(quiet=quiet, listeners=tuple(tracker.write for tracker in trackers))
    finally:
        for tracker in trackers:
            tracker.close()
