"""Progress output of a run: a live line in a terminal, elsewhere one plain line per generation."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.status import Status
from rich.table import Table

from mjxgait.certification import Certificate
from mjxgait.certification.acceptance import acceptance_of
from mjxgait.certification.advice import ADVICE
from mjxgait.certification.describe import in_words
from mjxgait.config.schema import Config
from mjxgait.creature.ground.spec import FLAT
from mjxgait.output import LOG, Output, duration
from mjxgait.tasks.walk.target_criteria import in_the_way
from mjxgait.training.folder import CHAMPION, CONFIG, CREATURE, METRICS, PLOT, command
from mjxgait.training.logs import Line


class Screen(Output):
    """Prints the progress of one run.

    listeners: called with the line of each generation, once that is in `metrics.jsonl`.
    """

    def __init__(
        self,
        console: Console | None = None,
        quiet: bool = False,
        listeners: tuple[Callable[[Line], object], ...] = (),
    ) -> None:
        super().__init__(console, quiet)
        self.listeners = listeners
        self._status: Status | None = None
        self._walls: list[float] = []
        self._first: tuple[float, int] | None = None

    @contextmanager
    def compiling(self, what: str, config: Config) -> Iterator[None]:
        """Show that the program is being compiled, and the time it takes."""
        self.say(
            f"{what}: population {config.evolution.population}, {config.rollout.starts} starts of "
            f"{config.rollout.seconds:g} s, seed {config.seed}"
        )
        began = time.perf_counter()
        LOG.info("Compiling…")
        if self.progress.is_terminal:
            columns = (SpinnerColumn(), TextColumn("Compiling…"), TimeElapsedColumn())
            with Progress(*columns, console=self.progress, transient=True) as progress:
                progress.add_task("compile")
                yield
        else:
            self.progress.print("Compiling…")
            yield
        self.say(f"Compiled in {time.perf_counter() - began:.1f} s")

    def generation(self, line: Line, config: Config) -> None:
        """Show a generation of a run with these settings; see `metrics_line`."""
        last, sooner = config.evolution.generations, what_ends_sooner(config)
        if not self._walls:
            self.say(
                "best, mean: fitness; alive: the share of the episodes that end without a fall"
            )
            if sooner:
                self.say(f"time left: up to generation {last}; the run ends sooner {sooner}")
        left = duration((last - line["generation"]) * self._seconds(line))
        best, mean = (
            f"{line[key]:.3f}" if line[key] is not None else "none" for key in ("best", "mean")
        )
        episodes = max(line["episodes"], 1)
        text = (
            f"generation {line['generation']:>3}/{last}  best {best}  mean {mean}  "
            f"alive {1 - line['failures'] / episodes:>4.0%}  {line['steps_per_second']:>7,} "
            f"steps/s  {'at most ' if sooner else ''}{left} left"
            + ("  forced evolution" if line["forced"] else "")
        )
        if self.progress.is_terminal:
            LOG.info("%s", text)
            if self._status is None:
                self._status = self.progress.status(text)
                self._status.start()
            self._status.update(text)
        else:
            self.say(text)
        for listener in self.listeners:
            listener(line)

    def _seconds(self, line: Line) -> float:
        """Return the expected time of a generation in s.

        It is the larger of two means: the latest logged times, and the time since the first line,
        which includes the examinations that the log leaves out.
        """
        self._walls = [*self._walls[-4:], line["wall_s"]]
        now = time.perf_counter(), int(line["generation"])
        self._first = self._first or now
        since = (now[0] - self._first[0]) / max(now[1] - self._first[1], 1)
        return max(since, sum(self._walls) / len(self._walls))

    def close(self) -> None:
        """End the live line, if there is one."""
        if self._status:
            self._status.stop()
            self._status = None

    def certificate(self, certificate: Certificate) -> None:
        """Print the result, measure by measure."""
        table = Table(*("criterion", "measure", "value", "threshold", ""), box=None, pad_edge=False)
        for row in certificate.rows():
            table.add_row(*row, style="bold" if row[-1] == "FAIL" else None)
        self.console.print(table)
        report, does = certificate.report, acceptance_of(certificate.task).verdict
        found = certificate.verdict
        verdict = f"Certified: {does}" if found.certified else "Not certified"
        if found.passed and found.reservation:
            verdict = f"Not certified; it passes {found.reservation}"
        ground = report.get("ground", FLAT)
        where = "" if ground == FLAT else f" on {ground}"
        if certificate.attempts > 1:
            self.console.print(f"This was examination {certificate.attempts} of its run.")
        crossed = any(c.name == "parts" and not c.passed for c in certificate.criteria)
        if crossed and (worst := report["overlap"]):
            one, other = worst["parts"]
            self.console.print(
                f"{other} stands up to {1000 * worst['depth']:.0f} mm deep in {one}, "
                f"and in it in {worst['share']:.0%} of the frames."
            )
        if said := in_the_way(certificate.criteria):
            self.console.print(said)
        # The other numbers mean little for a motion that makes no headway.
        if stopped := report.get("obstacle"):
            self.console.print(f"{verdict}: it {stopped}{where}; {certificate.seconds:.0f} s.")
        else:
            self._numbers(certificate, f"{verdict} (margin {certificate.margin:.2f})", where)
        for sentence in report.get(ADVICE, ()):
            self.console.print(sentence)

    def _numbers(self, certificate: Certificate, verdict: str, where: str) -> None:
        """Print the verdict with the numbers of a motion. where: its ground, in words."""
        report = certificate.report
        self.console.print(f"{verdict}. {report['summary']}{where}; {certificate.seconds:.0f} s.")
        if like := in_words(report):
            self.console.print(like)
        self.console.print(
            "The margin is that of the tightest measure: 0 just passes, 1 is far from its "
            "threshold."
        )

    def report(self, folder: Path, why: str, last: Line, seconds: float, interrupted: bool) -> None:
        """Print the final table: results and file locations.

        last: the last line of the metrics.
        """
        self.close()
        self.console.print(f"{why[0].upper()}{why[1:]}; {seconds:.0f} s.")
        table = Table(box=None, show_header=False, pad_edge=False)
        rows = {
            "best fitness": _best(last),
            "outcome": _outcome(last),
            "champion": f"{folder / CHAMPION}, the best individual",
            "metrics": f"{folder / METRICS}, {folder / PLOT}",
            "settings": f"{folder / CONFIG}, {folder / CREATURE}/",
        }
        for name, value in rows.items():
            table.add_row(name, value)
        self.console.print(table)
        if interrupted:
            again = command("train", "--resume", folder, run=folder)
            self.console.print(f"To go on: {again}", markup=False)

    def next_steps(self, folder: Path, certified: bool) -> None:
        """Print commands that use the result of a run."""
        steps: dict[tuple[object, ...], str] = {
            ("render", folder, "--out", "walk.webp"): "films it",
            ("share", folder, "--out", "walk.html"): "makes a page to give away",
            ("export", folder, "--out", "walk.glb"): "writes it for animation tools",
        }
        if not certified:
            steps["inspect", folder] = "tells how evolution went; another --seed may do better"
        self.say("Next:")
        for words, what in steps.items():
            self.progress.print(f"  {command(*words, run=folder)}   {what}", markup=False)


def what_ends_sooner(config: Config) -> str:
    """Return what can end a run before its last generation, in words; empty if nothing can."""
    evolution, look = config.evolution, config.examination
    reasons = {
        f"once a look at its best, every {look.every} generations, leads to a certificate": bool(
            look.every and look.candidates
        ),
        f"at a fitness of {evolution.target}": evolution.target is not None,
        "when forced evolution no longer pays": evolution.forced.enabled
        and bool(evolution.forced.patience),
    }
    return ", or ".join(reason for reason, holds in reasons.items() if holds)


def _best(last: Line) -> str:
    """Return the best fitness in words; none if no individual could be evaluated."""
    if last["best"] is None:
        return f"none: no individual had a finite fitness in generation {last['generation']}"
    return f"{last['best']:.3f} in generation {last['generation']}"


def _outcome(last: Line) -> str:
    """Return the metrics of the best in m, s or counts, as text."""
    prefix = "outcome_"
    named = {k.removeprefix(prefix): v for k, v in last.items() if k.startswith(prefix)}
    values = (f"{name} {'-' if value is None else f'{value:.2f}'}" for name, value in named.items())
    return ", ".join(values) + " per episode, mean of the starts"
