"""Kill, interrupt and starve the commands that run for minutes, and report what each leaves behind.

    python benchmarks/interruptions.py --kills 20 --stops 3 --table FILE

Each command runs once to its end on the smallest creature. Then it is killed (SIGKILL, its children
too) or stopped (Ctrl-C, SIGINT) at random moments of that time and goes on as its message says,
until it ends. The result must be the whole run's to the last digit, no output may hold a traceback,
and no half-written file may stay. At last each command runs in a folder that cannot be written, on
one core, and without a network (which needs root on Linux). `--python PATH` runs everything with
the interpreter of another environment. docs/testing.md has the table. Exit code 1: something broke.
"""

import argparse
import dataclasses
import hashlib
import json
import math
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STOOL = ROOT / "tests" / "data" / "stool"
TIMES = re.compile(r'"(?:wall_s|steps_per_second|computed_steps|seconds|written)": ?[^,}]*,?')
"""What differs between two runs that are the same."""
HALF_WRITTEN = re.compile(r"\.(?:tmp|part|partial)$|~$")
LONGEST = 600.0
"""Time in s after which a command counts as stuck."""
SMALL = ["--population", "6", "--generations", "4"]
STUDY = """
question = "Does plain PD do as well?"
env = "{env}"
seeds = 2
generations = 2
[base]
evolution = {{ population = 6 }}
rollout = {{ seconds = 0.4, starts = 2, lanes = 4 }}
[[variant]]
name = "stable PD"
[[variant]]
name = "plain PD"
settings = {{ drive = {{ law = "pd" }} }}
"""


@dataclasses.dataclass(frozen=True)
class Command:
    """A command to interrupt.

    begin, resume: arguments for an output folder. results: files below it that must be the same.
    """

    begin: Callable[[Path], Sequence[str]]
    resume: Callable[[Path], Sequence[str]]
    results: tuple[str, ...]


def commands(folder: Path) -> dict[str, Command]:
    """The five commands, with their inputs written into a folder."""
    study, cycle, settings = folder / "study.toml", folder / "cycle.csv", folder / "small.toml"
    study.write_text(STUDY.format(env=STOOL.as_posix()))
    cycle.write_text(_cycle())
    settings.write_text("[rollout]\nseconds = 1.0\nlanes = 4\n[examination]\ncandidates = 1\n")
    stool = ["--env", str(STOOL), "--config", str(settings)]
    evolved = ("champion.json", "metrics.jsonl", "certificate.json")

    def examined(out: Path) -> list[str]:
        if not out.exists():
            shutil.copytree(folder / "train", out)
            (out / "certificate.json").unlink()
        return ["certify", str(out)]

    return {
        "train": Command(
            lambda out: ["train", *stool, *SMALL, "--no-plots", "--out", str(out)],
            lambda out: ["train", "--resume", str(out)],
            evolved,
        ),
        "refine": Command(
            lambda out: [
                *("refine", *stool, *SMALL, "--keys", str(cycle), "--tolerance", "20"),
                *("--out", str(out)),
            ],
            lambda out: ["refine", "--resume", str(out)],
            evolved,
        ),
        "repertoire": Command(
            lambda out: [
                *("repertoire", "--env", str(STOOL), *SMALL, "--speeds", "0.2", "0.4"),
                *("--turns", "10", "--no-blends", "--out", str(out)),
            ],
            lambda out: ["repertoire", "--resume", str(out)],
            ("*/champion.json", "*/certificate.json"),
        ),
        "ablate": Command(
            lambda out: ["ablate", str(study), "--out", str(out)],
            lambda out: ["ablate", "--resume", str(out)],
            ("results.csv", "generations.parquet"),
        ),
        "certify": Command(examined, lambda out: ["certify", str(out)], ("certificate.json",)),
    }


def _cycle() -> str:
    """A second of the stool's hips as a trot swings them, at 30 frames per second."""
    hips = ("front_left_hip", "front_right_hip", "hind_left_hip", "hind_right_hip")
    lines = [",".join(("time", *hips))]
    for frame in range(31):
        angle = 0.3 * math.sin(2 * math.pi * frame / 30)
        lines.append(",".join(f"{v:.6f}" for v in (frame / 30, angle, -angle, -angle, angle)))
    return "\n".join(lines) + "\n"


@dataclasses.dataclass(frozen=True)
class Ended:
    """Exit code of a command (None: it was killed) and all that it said."""

    code: int | None
    said: str

    @property
    def broken(self) -> bool:
        """Whether a traceback or an exit code that no command has was seen."""
        return "Traceback" in self.said or self.code not in (None, 0, 1, 2, 130)


class Interrupter:
    """Runs commands with one interpreter, and sends them signals."""

    def __init__(self, python: str) -> None:
        self.start = [python, "-P", "-m", "mjxgait"]

    def run(
        self,
        arguments: Sequence[str],
        after: float | None = None,
        by: signal.Signals = signal.SIGKILL,
        under: Sequence[str] = (),
    ) -> Ended:
        """Run a command, under another program if wanted, and signal its group seconds later."""
        environment = os.environ | {"PYTHONPATH": str(ROOT), "TERM": "dumb"}
        process = subprocess.Popen(
            [*under, *self.start, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
            start_new_session=True,
        )
        try:
            said, _ = process.communicate(timeout=LONGEST if after is None else after)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL if after is None else by)
            said, _ = process.communicate(timeout=LONGEST)
            if after is None:
                return Ended(-1, f"{said}\nno end within {LONGEST} s")
            return Ended(None if by == signal.SIGKILL else process.returncode, said)
        return Ended(process.returncode, said)


def digest(folder: Path, patterns: Sequence[str]) -> str:
    """Hash of the result, without times."""
    total = hashlib.sha256()
    for path in sorted(path for pattern in patterns for path in folder.glob(pattern)):
        data = path.read_bytes()
        if path.suffix in (".json", ".jsonl"):
            data = TIMES.sub("", data.decode()).encode()
        total.update(str(path.relative_to(folder)).encode() + data)
    return total.hexdigest()


def interrupted(
    command: Command, out: Path, machine: Interrupter, after: float, by: signal.Signals
) -> str:
    """Interrupt a command once, let it go on to its end, and say in a word what came of it."""
    first = machine.run(command.begin(out), after, by)
    last = first
    if not first.broken and first.code not in (0, 1):
        last = machine.run(command.resume(out)) if out.exists() else Ended(2, "")
        if last.code == 2:  # nothing was there to go on with
            last = machine.run(command.begin(out))
    if first.broken or last.broken:
        worse = first if first.broken else last
        begin = max(worse.said.find("Traceback"), 0)
        return f"broken: exit code {worse.code}: {worse.said[begin:][:3000]}"
    if last.code not in (0, 1):
        return f"stuck: {last.said[-1500:]}"
    if left := [path.name for path in out.rglob("*") if HALF_WRITTEN.search(path.name)]:
        return f"left behind: {', '.join(left)}"
    return "ended before" if first is last else "went on"


def conditions(command: Command, folder: Path, machine: Interrupter) -> dict[str, str]:
    """Run a command where it may not write, on one core, and without a network."""
    found, locked = {}, folder / "locked"
    locked.mkdir()
    seal = 'mount --bind "$0" "$0" && mount -o remount,ro,bind "$0" && exec "$@"'
    under: Sequence[str] = ("unshare", "--mount", "sh", "-c", seal, str(locked))
    if os.geteuid() != 0:
        locked.chmod(0o555)
        under = ()
    ended = machine.run(command.begin(locked / "out"), under=under)
    refused = ended.code == 2 and not ended.broken
    found["a folder that cannot be written"] = "refused" if refused else f"broken: {ended.said}"
    for name, program in {
        "one core": ("taskset", "--cpu-list", "0"),
        "no network": ("unshare", "--net"),
    }.items():
        if program[0] == "unshare" and os.geteuid() != 0:
            found[name] = "not tried (needs root)"
            continue
        out = folder / name.replace(" ", "-")
        ended = machine.run(command.begin(out), under=program)
        fine = ended.code in (0, 1) and not ended.broken
        found[name] = "ended" if fine else f"broken: {ended.said[-1500:]}"
    return found


def tried(
    name: str, command: Command, folder: Path, machine: Interrupter, options: argparse.Namespace
) -> dict[str, str]:
    """A row of the table: what came of a command's kills, stops and conditions."""
    whole = folder / name
    begin = time.monotonic()
    ended = machine.run(command.begin(whole))
    seconds = time.monotonic() - begin
    if ended.code not in (0, 1) or ended.broken:
        return {"whole run": f"broken: {ended.said[-3000:]}"}
    row, wanted = {"s": f"{seconds:.0f}"}, digest(whole, command.results)
    chance = random.Random(f"{options.seed} {name}")
    for word, count, by in (
        ("kills", options.kills, signal.SIGKILL),
        ("Ctrl-C", options.stops, signal.SIGINT),
    ):
        found: Counter[str] = Counter()
        for _ in range(count):
            out = folder / "out"
            after = chance.uniform(0.3, 1.0) * seconds
            result = interrupted(command, out, machine, after, by)
            if ":" not in result and digest(out, command.results) != wanted:
                result = f"another result: after {after:.2f} s"
            print(f"{name}, {word} after {after:.2f} s: {result}", flush=True)
            found[result.partition(":")[0]] += 1
            shutil.rmtree(out, ignore_errors=True)
        row[word] = ", ".join(f"{count} {what}" for what, count in sorted(found.items()))
    if options.conditions:
        (folder / "conditions").mkdir()
        for condition, result in conditions(command, folder / "conditions", machine).items():
            print(f"{name}, {condition}: {result}", flush=True)
            row[condition] = result.partition(":")[0]
        shutil.rmtree(folder / "conditions")
    return row


def markdown(rows: dict[str, dict[str, str]]) -> str:
    """The rows as a table."""
    columns = list(dict.fromkeys(key for row in rows.values() for key in row))
    lines = [f"| command | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for name, row in rows.items():
        lines.append(f"| `{name}` | {' | '.join(row.get(key, '') for key in columns)} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--commands", nargs="*", help="all five if none is given")
    parser.add_argument("--kills", type=int, default=20, help="SIGKILLs per command")
    parser.add_argument("--stops", type=int, default=3, help="Ctrl-Cs per command")
    parser.add_argument("--conditions", action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument("--python", default=sys.executable, help="interpreter of the commands")
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    parser.add_argument("--table", type=Path, help="file for the table")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="mjxgait-interrupted-") as name:
        folder, machine, rows = Path(name), Interrupter(options.python), {}
        known = commands(folder)
        if unknown := set(options.commands or ()) - known.keys():
            parser.error(f"no such command: {', '.join(sorted(unknown))}")
        wanted = options.commands or list(known)
        if "certify" in wanted and "train" not in wanted:  # it examines a run of train's
            machine.run(known["train"].begin(folder / "train"))
        for each in wanted:
            rows[each] = tried(each, known[each], folder, machine, options)
    table = markdown(rows)
    print(f"\n{table}")
    if options.table:
        options.table.write_text(table, encoding="utf-8")
    cells = " ".join(json.dumps(row) for row in rows.values())
    return int(any(word in cells for word in ("broken", "stuck", "left behind", "another result")))


if __name__ == "__main__":
    sys.exit(main())
