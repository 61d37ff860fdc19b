"""Success rates per creature, task and algorithm: a file with a line per run, and its table."""

import dataclasses
import math
import statistics
from collections.abc import Iterable, Sequence
from pathlib import Path

from mjxgait.certification import outdated, read_certificate, verdict_of
from mjxgait.config.tables import STORED, Flag, Index, Number, Text
from mjxgait.errors import UserError
from mjxgait.experiments.ablation.findings import share
from mjxgait.files import writing
from mjxgait.training.folder import CERTIFICATE, METRICS, command, open_champion, open_run
from mjxgait.training.logs import read_metrics, read_records, write_lines

HEADINGS = (
    *("creature", "task", "algorithm", "machine"),
    *("certified", "95 % interval", "margin", "evaluations", "s"),
)


@dataclasses.dataclass(frozen=True)
class Entry:
    """A run on the leaderboard.

    Attributes:
      creature, body: its name and digest.
      task, algorithm, machine: the last two as stated when the run was added.
      seed: of the run.
      champion: fingerprint of the examined individual.
      certified, margin: result of the examination by the shipped rules; None for no finite margin.
      evaluations: individuals that were evaluated. seconds: of evolution, without examinations.
      version: of mjxgait, that made the champion.
    """

    __pydantic_config__ = STORED
    creature: Text
    body: Text
    task: Text
    algorithm: Text
    machine: Text
    seed: Index
    champion: Text
    certified: Flag
    margin: Number | None
    evaluations: Index
    seconds: Number
    version: Text

    @property
    def group(self) -> tuple[str, str, str, str]:
        """What shares a row of the table."""
        return self.creature, self.task, self.algorithm, self.machine


def entry_of(run: Path, algorithm: str | None, machine: str) -> Entry:
    """Return the entry of a run. algorithm: by default the name of its controller.

    Raises:
      UserError: no run, no champion, or a champion that was not examined.
    """
    creature, champion = open_champion(run)
    document = read_certificate(run / CERTIFICATE)
    again = command("certify", run, run=run)
    if document is None:
        raise UserError(f"{run}: not examined; {again} does it")
    if reason := outdated(document, champion, creature):
        raise UserError(f"{run}: {reason} {again} examines this champion")
    verdict, lines = verdict_of(document), read_metrics(run / METRICS)
    return Entry(
        creature=creature.name,
        body=creature.digest,
        task=champion.task,
        algorithm=algorithm or champion.controller,
        machine=machine,
        seed=open_run(run)[1].seed,
        champion=champion.fingerprint,
        certified=verdict.certified,
        margin=verdict.margin if math.isfinite(verdict.margin) else None,
        evaluations=int(sum(line["evaluations"] for line in lines)),
        seconds=float(sum(line["wall_s"] for line in lines)),
        version=str(champion.origin.get("versions", {}).get("mjxgait", "unknown")),
    )


def read_board(board: Path) -> list[Entry]:
    """Return the entries of a file; none if there is no file yet.

    Raises:
      UserError: the file is damaged; names the line.
    """
    if not board.exists():
        return []
    names = [field.name for field in dataclasses.fields(Entry)]
    return [Entry(**{n: line[n] for n in names}) for line in read_records(board, Entry)]


def with_new(board: Path, entries: Iterable[Entry]) -> list[Entry]:
    """Return the entries of a file, and new ones.

    Raises:
      UserError: one of them is in the file already, or twice among them, or the file is damaged.
    """
    known = read_board(board)
    for entry in entries:
        if entry in known:
            raise UserError(
                f"{board}: has seed {entry.seed} of {' '.join(entry.group[:3])} already; leave "
                "this run out"
            )
        known.append(entry)
    return known


def add(board: Path, entry: Entry) -> None:
    """Append an entry to a file.

    Raises:
      UserError: the file has it already, is damaged, or cannot be written.
    """
    entries = with_new(board, [entry])
    with writing(board):
        write_lines(board, map(dataclasses.asdict, entries))


def table(entries: Iterable[Entry]) -> str:
    """Return the entries as a Markdown table, a row for each group.

    Margin, evaluations and seconds are medians over the certified runs.
    """
    groups: dict[tuple[str, str, str, str], list[Entry]] = {}
    for entry in entries:
        groups.setdefault(entry.group, []).append(entry)
    rows = [[*group, *_numbers(groups[group])] for group in sorted(groups)]
    lines = [HEADINGS, ("---",) * len(HEADINGS), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def _numbers(entries: Sequence[Entry]) -> list[str]:
    certified = [entry for entry in entries if entry.certified]
    found = share(len(certified), len(entries))
    cells = [f"{len(certified)} of {len(entries)}", f"{found.low:.2f} to {found.high:.2f}"]
    if not certified:
        return [*cells, "", "", ""]
    margin = statistics.median(entry.margin or 0.0 for entry in certified)
    evaluations = statistics.median(entry.evaluations for entry in certified)
    seconds = statistics.median(entry.seconds for entry in certified)
    return [*cells, f"{margin:.2f}", f"{evaluations:,.0f}", f"{seconds:.0f}"]
