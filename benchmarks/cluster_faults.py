"""Fault tolerance of a Ray cluster, on simulated machines of one core each on this machine.

    python benchmarks/cluster_faults.py study    # random kills of workers, machines and the command
    python benchmarks/cluster_faults.py islands  # the same in a run on four islands
    python benchmarks/cluster_faults.py blocks   # the same in one population, judged in blocks
    python benchmarks/cluster_faults.py disk     # full disks (mounts one: needs root)

One undisturbed run, then others until there were `--kills` kills; a killed command is called again
with `--resume`. All must give the same results, and no finished champion may be written again.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "cluster"))

from simulated import machines, workers

from mjxgait.processes import python_command
from mjxgait.training.logs import read_metrics

STOOL = Path(__file__).parents[1] / "tests" / "data" / "stool"
STUDY = f"""question = "Who is killed?"
env = "{STOOL}"
seeds = 4
generations = 60
rows = 1
base = {{ evolution = {{ population = 6 }}, rollout = {{ seconds = 0.4, starts = 2, lanes = 4 }} }}

[[variant]]
name = "base"

[[variant]]
name = "slow"
settings = {{ evolution = {{ mutation_rate = 0.1 }} }}
"""
TRAIN = f"""--env {STOOL} --generations 60 --rollout.seconds 0.4 --rollout.starts 2
--rollout.lanes 4 --examination.candidates 0 --no-plots"""
RUNS = {
    "islands": "--population 6 --evolution.islands.count 4 --evolution.islands.every 2",
    "blocks": "--population 16 --rollout.block 4",
}
TIMES = ("wall_s", "steps_per_second")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("study", *RUNS, "disk"))
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    # The faults do not depend on how fast the programs run.
    os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")
    with tempfile.TemporaryDirectory() as scratch:
        found = (
            disk(Path(scratch))
            if options.what == "disk"
            else kills(Path(scratch), options.what, options.kills, random.Random(options.seed))
        )
    print(json.dumps(found, indent=2))


def kills(scratch: Path, what: str, count: int, chance: random.Random) -> dict[str, Any]:
    with machines(2) as made:
        spare, killed, ends = [made.add()], Counter[str](), Counter[str]()
        again, chatter = list[str](), 0
        quiet = Command(what, scratch / "quiet", made.address)
        quiet.wait()
        while killed.total() < count:
            folder = scratch / str(ends.total())
            command = Command(what, folder, made.address)
            while command.runs_for(chance.uniform(1, 6)) and killed.total() < count:
                kind = chance.choices(("worker", "machine", "command"), (5, 3, 2))[0]
                if kind == "command":
                    written = stamps(folder)
                    command = command.killed_and_resumed()
                    again += [name for name in written if stamps(folder)[name] != written[name]]
                elif kind == "machine":
                    made.kill(spare.pop())
                    spare.append(made.add())
                elif found := workers():
                    chance.choice(found).kill()
                else:
                    continue
                killed[kind] += 1
                say(f"{killed.total()} of {count}: {kind}")
            command.wait()
            chatter += command.log.read_text().count("raylet")
            ends["same" if results(folder) == results(scratch / "quiet") else "other"] += 1
    return {
        "killed": killed,
        "ended as the quiet one": ends,
        "written again": again,
        "words of Ray": chatter,
    }


class Command:
    """`mjxgait` as a process; its output goes into a file beside the folder."""

    def __init__(self, what: str, folder: Path, address: str, resume: bool = False) -> None:
        self.what, self.folder, self.address = what, folder, address
        name = "ablate" if what == "study" else "train"
        given = ["--resume", folder] if resume else ["--out", folder]
        if what == "study" and not resume:
            (study := folder.with_suffix(".toml")).write_text(STUDY)
            given = [study, *given]
        elif not resume:
            given = [*f"{TRAIN} {RUNS[what]}".split(), *given]
        self.log = folder.with_suffix(".log")
        with self.log.open("a") as log:
            self.process = subprocess.Popen(
                python_command("mjxgait", name, *map(str, given), "--cluster", address),
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def runs_for(self, seconds: float) -> bool:
        """Return True if the process is still running after so many seconds."""
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            return True
        return False

    def wait(self) -> None:
        if code := self.process.wait(timeout=400):
            raise SystemExit(f"ended with {code}:\n{self.log.read_text()[-3000:]}")

    def killed_and_resumed(self) -> "Command":
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        begun = (self.folder / "creature").exists()
        return Command(self.what, self.folder, self.address, resume=begun)


def results(folder: Path) -> dict[str, Any]:
    """All results of a study or a run on islands, except times."""
    champions = [*folder.glob("champions/*.json"), *folder.glob("champion.json")]
    logs = [*folder.glob("groups/*/metrics.jsonl"), *folder.glob("islands/*/metrics.jsonl")]
    found: dict[str, Any] = {str(path.relative_to(folder)): path.read_text() for path in champions}
    for path in (*logs, *folder.glob("*.jsonl")):
        lines = read_metrics(path)
        found[str(path.relative_to(folder))] = [
            {key: value for key, value in line.items() if key not in TIMES} for line in lines
        ]
    return found


def stamps(folder: Path) -> dict[str, int]:
    """Modification time in ns of each champion file of a study."""
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("champions/*.json")}


def disk(scratch: Path) -> dict[str, Any]:
    """The study with two machines that lack disk space.

    One cannot store programs, the other a creature's files.
    """
    os.environ.pop("JAX_COMPILATION_CACHE_DIR", None)  # it would override the cache folder
    full = scratch / "full"
    full.mkdir()
    mounted = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(full)]
    subprocess.run(mounted, check=True)
    try:
        with machines(1) as made:
            Command("study", scratch / "quiet", made.address).wait()
            (full / "filler").write_bytes(bytes(60 * 2**10))
            made.add(env_vars={"XDG_CACHE_HOME": str(full)})
            made.add(env_vars={"TMPDIR": str(full)})
            began = time.monotonic()
            command = Command("study", scratch / "full-run", made.address)
            command.wait()
            return {
                "same": results(scratch / "quiet") == results(scratch / "full-run"),
                "said": [s for s in command.log.read_text().splitlines() if "cluster:" in s],
                "s": round(time.monotonic() - began, 1),
            }
    finally:
        subprocess.run(["umount", "-l", str(full)], check=True)


def say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
