"""Plant the faults of tests/faults.toml, one at a time, and report which test catches each.

`python scripts/plant_faults.py [NAME ...]`: every fault, or those named. Each is planted in a copy
of the tree, never in the checkout. The tests named for it run first; if they pass, the other quick
tests run. Needs no network. Exits with 1 when a fault is not caught, or when its old text does not
occur exactly once. docs/testing.md describes its purpose.
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
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "faults.toml"
LEFT_OUT = (".*", "__pycache__", "*.egg-info")
AT_THE_TOP = ("build", "dist", "runs")
"""Names that a copy of the tree omits: everywhere, and at its top."""
LONGEST = 900
"""Time limit of a test run in seconds; a fault that makes tests hang counts as not caught."""
FAILURE = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)


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
    """Result of a fault. caught_by: the first test that failed, None where all passed."""

    fault: Fault
    caught_by: str | None
    seconds: float
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
    """Plant one fault in a copy of a tree and run tests until one fails."""
    begin, text = time.monotonic(), planted(fault, root)
    with copied(root) as tree:
        (tree / fault.file).write_text(text, encoding="utf-8")
        for arguments in (fault.tests, ("-m", "not slow")):
            status, output = run_tests(tree, arguments, cache)
            failed = FAILURE.search(output)
            seconds = time.monotonic() - begin
            if status == 1 and failed:
                return Finding(fault, failed.group(1), seconds)
            if status != 0:
                return Finding(fault, None, seconds, f"status {status}: {output[-2000:]}")
    return Finding(fault, None, seconds)


def check_sound(faults: list[Fault], root: Path, cache: Path) -> None:
    """Exit if the tests fail without a fault: then they would catch everything."""
    named = dict.fromkeys(test for fault in faults for test in fault.tests)
    with copied(root) as tree:  # also checks that the copy is complete
        status, output = run_tests(tree, tuple(named), cache, longest=None)
    if status != 0:
        sys.exit(f"the tests fail without a fault, with status {status}:\n{output[-3000:]}")


def table(findings: list[Finding]) -> str:
    """Return a Markdown table: every fault, its effect, and the test that caught it."""
    lines = ["| fault | where | what goes wrong | caught by |", "|---|---|---|---|"]
    for finding in findings:
        fault, caught = finding.fault, f"`{finding.caught_by}`" if finding.caught_by else "nothing"
        where = fault.file.removeprefix("mjxgait/")
        lines.append(f"| {fault.name} | `{where}` | {fault.why} | {caught.replace('|', ' ')} |")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Return the exit status: 0 when all are caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("names", nargs="*", help="of faults; all if none is given")
    parser.add_argument("--list", type=Path, default=LIST, help="the file of faults")
    parser.add_argument("--root", type=Path, default=ROOT, help="the tree to plant them in")
    parser.add_argument("--jobs", type=int, default=1, help="faults at the same time")
    parser.add_argument("--trust", action="store_true", help="that tests pass without a fault")
    parser.add_argument("--table", type=Path, help="file for the final table")
    told = parser.parse_args(arguments)
    known = read_faults(told.list)
    if unknown := set(told.names) - {fault.name for fault in known}:
        parser.error(f"no such fault: {', '.join(sorted(unknown))}")
    faults = [fault for fault in known if not told.names or fault.name in told.names]
    try:
        for fault in faults:
            planted(fault, told.root)
    except ValueError as error:
        sys.exit(str(error))
    with tempfile.TemporaryDirectory(prefix="faults-jax-") as folder:
        if not told.trust:
            check_sound(faults, told.root, Path(folder))
        findings = _examine_all(faults, told.root, Path(folder), told.jobs)
    text = table(findings)
    print(f"\n{text}")
    if told.table:
        told.table.write_text(text + "\n", encoding="utf-8")
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
