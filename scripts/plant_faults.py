"""Plant the faults of tests/faults.toml, one at a time, and report which test catches each.

`python scripts/plant_faults.py [NAME ...]`: every fault, or those named. Each is planted in a copy
of the tree, never in the checkout. The tests named for it run first; if they pass, the other quick
tests run. A test that fails with the fault runs again without it: if it fails then too, it has
caught nothing. Needs no network. Exits with 1 when a fault is not caught, or when its old text does
not occur exactly once. docs/testing.md describes its purpose.
"""

import argparse
import concurrent.futures
import contextlib
import dataclasses
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "faults.toml"
LEFT_OUT = (".*", "__pycache__", "*.egg-info")
AT_THE_TOP = ("build", "dist", "runs")
"""Names that a copy of the tree omits: everywhere, and at its top."""
LONGEST = 900
"""Time limit of a test run in seconds; a fault that makes tests hang counts as not caught."""
FAILURE = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)
LONGEST_REASON = 120
"""Characters of an assertion in the table."""
ROW = re.compile(r"\| (?!fault \|)\S.* \|$")
REASON = re.compile(r"^E +(\S.*)$", re.MULTILINE)


@dataclasses.dataclass(frozen=True)
class Fault:
    """A plausible mistake.

    file: path from the root. old, new: the text and its replacement. tests: arguments of pytest
    that are likely to catch it. why: what goes wrong, in a line.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    why: str


@dataclasses.dataclass(frozen=True)
class Finding:
    """Result of a fault.

    caught_by: the first test that failed, None where all passed. reason: its assertion or
    exception.
    """

    fault: Fault
    caught_by: str | None
    seconds: float
    reason: str = ""
    trouble: str = ""


def read_faults(path: Path = LIST) -> list[Fault]:
    """Return the faults of a list, in its order."""
    rows = tomllib.loads(path.read_text(encoding="utf-8"))["fault"]
    return [Fault(**{**row, "tests": tuple(row["tests"])}) for row in rows]


def planted(fault: Fault, root: Path = ROOT) -> str:
    """Return the text of the fault's file with the fault in it.

    Raises:
      ValueError: the old text does not occur exactly once.
    """
    text = (root / fault.file).read_text(encoding="utf-8")
    if (count := text.count(fault.old)) != 1:
        raise ValueError(
            f'"{fault.name}": its old text is {count} times in {fault.file}; mend tests/faults.toml'
        )
    return text.replace(fault.old, fault.new)


def run_tests(
    tree: Path, arguments: tuple[str, ...], cache: Path, longest: float | None = LONGEST
) -> tuple[int, str]:
    """Return exit status and output of pytest in a tree, up to the first failure."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "--tb=short", *arguments]
    environment = os.environ | {
        "PYTHONPATH": str(tree),
        "PYTHONDONTWRITEBYTECODE": "1",
        "JAX_COMPILATION_CACHE_DIR": str(cache),
        "MJXGAIT_PLANTED": "1",  # tests marked `thorough` look for faults too
    }
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=longest
        )
    except subprocess.TimeoutExpired:
        return -1, f"no end within {longest} s"
    return done.returncode, done.stdout + done.stderr


@contextlib.contextmanager
def copied(root: Path) -> Iterator[Path]:
    """Yield a temporary copy of a tree."""
    everywhere = shutil.ignore_patterns(*LEFT_OUT)

    def left_out(folder: str, names: list[str]) -> set[str]:
        here = AT_THE_TOP if Path(folder) == root else ()
        return everywhere(folder, names) | {name for name in names if name in here}

    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(root, tree, ignore=left_out, symlinks=True)
        yield tree


def examine(fault: Fault, root: Path, cache: Path) -> Finding:
    """Plant one fault in a copy of a tree and run tests until one fails because of it."""
    begin, text = time.monotonic(), planted(fault, root)

    def finding(**result: Any) -> Finding:
        return Finding(fault, seconds=time.monotonic() - begin, **{"caught_by": None, **result})

    with copied(root) as tree:
        sound = (tree / fault.file).read_text(encoding="utf-8")
        (tree / fault.file).write_text(text, encoding="utf-8")
        for arguments in (fault.tests, ("-m", "not slow")):
            status, output = run_tests(tree, arguments, cache)
            if status == 0:
                continue
            failed = FAILURE.search(output)
            if status != 1 or not failed:
                return finding(trouble=f"status {status}: {output[-2000:]}")
            (tree / fault.file).write_text(sound, encoding="utf-8")
            again, output_again = run_tests(tree, (failed.group(1),), cache)
            if again != 0:
                said = f"{failed.group(1)} fails without the fault too: {output_again[-2000:]}"
                return finding(trouble=said)
            reason = REASON.search(output)
            return finding(caught_by=failed.group(1), reason=reason.group(1) if reason else "")
    return finding()


def check_sound(faults: list[Fault], root: Path, cache: Path) -> None:
    """Exit if the tests fail without a fault: then they would catch everything."""
    named = dict.fromkeys(test for fault in faults for test in fault.tests)
    with copied(root) as tree:  # also checks that the copy is complete
        status, output = run_tests(tree, tuple(named), cache, longest=None)
    if status != 0:
        sys.exit(f"the tests fail without a fault, with status {status}:\n{output[-3000:]}")


FOLDER = re.compile(re.escape(tempfile.gettempdir()) + r"/(?:[^/\s]+/)*")
HEAD = "| fault | where | what goes wrong | caught by | assertion |\n|---|---|---|---|---|"


def table(findings: list[Finding], text: str = "", order: Sequence[str] = ()) -> str:
    """Return a Markdown table: each fault, its effect, the test that caught it and how it failed.

    text, order: a page with such a table, of which all other lines are kept, and the faults' names
    in the order of its rows.
    """
    rows = {line[2:].partition(" | ")[0]: line for line in text.splitlines() if ROW.match(line)}
    for finding in findings:
        fault, caught = finding.fault, f"`{finding.caught_by}`" if finding.caught_by else "nothing"
        # Temporary folders differ from machine to machine.
        reason = FOLDER.sub("…/", finding.reason)[:LONGEST_REASON]
        reason = f"`{reason}`" if reason else ""
        cells = (fault.name, f"`{fault.file.removeprefix('mjxgait/')}`", fault.why, caught, reason)
        rows[fault.name] = f"| {' | '.join(cell.replace('|', ' ') for cell in cells)} |"
    names = [name for name in order if name in rows] or list(rows)
    before = text.partition(HEAD)[0] if HEAD in text else ""
    return "\n".join([before + HEAD, *(rows[name] for name in names)])


def main(arguments: list[str] | None = None) -> int:
    """Return the exit status: 0 when all are caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("names", nargs="*", help="of faults; all if none is given")
    parser.add_argument("--list", type=Path, default=LIST, help="the file of faults")
    parser.add_argument("--root", type=Path, default=ROOT, help="the tree to plant them in")
    parser.add_argument("--jobs", type=int, default=1, help="faults at the same time")
    parser.add_argument("--trust", action="store_true", help="that tests pass without a fault")
    parser.add_argument("--table", type=Path, help="page whose rows of these faults are rewritten")
    options = parser.parse_args(arguments)
    known = read_faults(options.list)
    if unknown := set(options.names) - {fault.name for fault in known}:
        parser.error(f"no such fault: {', '.join(sorted(unknown))}")
    faults = [fault for fault in known if not options.names or fault.name in options.names]
    try:
        for fault in faults:
            planted(fault, options.root)
    except ValueError as error:
        sys.exit(str(error))
    with tempfile.TemporaryDirectory(prefix="faults-jax-") as folder:
        if not options.trust:
            check_sound(faults, options.root, Path(folder))
        findings = _examine_all(faults, options.root, Path(folder), options.jobs)
    print(f"\n{table(findings)}")
    if options.table:
        old = options.table.read_text(encoding="utf-8") if options.table.exists() else ""
        page = table(findings, old, [fault.name for fault in known])
        options.table.write_text(page + "\n", encoding="utf-8")
    caught = sum(finding.caught_by is not None for finding in findings)
    print(f"\n{caught} of {len(findings)} caught")
    return 0 if caught == len(findings) else 1


def _examine_all(faults: list[Fault], root: Path, cache: Path, jobs: int) -> list[Finding]:
    findings = []
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for finding in pool.map(lambda fault: examine(fault, root, cache), faults):
            by = finding.caught_by or f"NOT CAUGHT {finding.trouble}"
            print(f"{finding.fault.name}: {by} ({finding.seconds:.0f} s)", flush=True)
            findings.append(finding)
    return findings


if __name__ == "__main__":
    sys.exit(main())
