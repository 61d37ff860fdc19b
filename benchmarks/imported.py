"""Import and train third-party models, each in its own processes, and print a table of their walks.

    python benchmarks/imported.py --models "laikago" "gym ant" --out runs/imported

Names are those of `tests/importer/packages.py`, with files from the package index; `--files` takes
others, such as the rigs that `benchmarks/rig_of_blender.py` writes. Options after `--` go to
`train`. Columns: wall time of both commands together and of the import alone; whether the champion
is certified, and the margin of its worst criterion; speed over the certificate's 20 s; generations;
failed measures with their values.
"""

import argparse
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / "tests"))
import numpy as np
from importer.packages import MODELS, model_file

from mjxgait.certification import verdict_of
from mjxgait.processes import python_command
from mjxgait.training.folder import CERTIFICATE, METRICS
from mjxgait.training.logs import read_metrics

HEADER = (
    "model",
    "wall",
    "import",
    "certified",
    "margin",
    "m/s",
    "lengths/s",
    "gait",
    "gens",
    "fails",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--models", nargs="+", choices=MODELS, default=list(MODELS), metavar="NAME")
    parser.add_argument("--files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--out", type=Path, default=Path("runs/imported"))
    parser.add_argument("more", nargs="*", help="options of train, after --")
    options = parser.parse_args()
    print(*HEADER, sep=" | ")
    for name in [] if options.files else options.models:
        path, search = model_file(name)
        print(*walk(name, path, search, options.out, options.more), sep=" | ", flush=True)
    for file in options.files or ():
        print(*walk(file.name, file, (), options.out, options.more), sep=" | ", flush=True)


def walk(name: str, path: Path, search: Sequence[Path], out: Path, more: list[str]) -> list[str]:
    """Return a row of the table; if import or training is refused, its last column says why."""
    env, run = (out / kind / name.replace(" ", "_") for kind in ("envs", "runs"))
    for folder in (env, run):
        shutil.rmtree(folder, ignore_errors=True)
    began = time.perf_counter()
    searches = [word for folder in search for word in ("--search", str(folder))]
    imported = _mjxgait(env.with_suffix(".log"), "import", str(path), "--out", str(env), *searches)
    between = time.perf_counter()
    trained = imported or _mjxgait(
        run.with_suffix(".log"), "train", "--env", str(env), "--out", str(run), "--no-plots", *more
    )
    seconds = [f"{time.perf_counter() - began:.0f} s", f"{between - began:.0f} s"]
    if trained or not (run / CERTIFICATE).exists():
        return [name, *seconds, *[""] * 6, trained or "never moved"]
    certificate = json.loads((run / CERTIFICATE).read_text(encoding="utf-8"))
    return [name, *seconds, *_findings(certificate, read_metrics(run / METRICS)[-1]["generation"])]


def _mjxgait(log: Path, *command: str) -> str:
    """Run a command, log its output; return its last line of errors if it fails, else nothing."""
    log.parent.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(
        python_command("mjxgait", *command), capture_output=True, text=True, check=False
    )
    log.write_text(done.stdout + done.stderr, encoding="utf-8")
    return done.stderr.strip().splitlines()[-1] if done.returncode else ""


def _findings(certificate: dict[str, Any], generations: int) -> list[str]:
    verdict = verdict_of(certificate)
    measures = [m for c in verdict.failed for m in c.measures if not m.passed]
    values = ["none" if np.isnan(m.value) else f"{m.value:.3g}" for m in measures]
    report, margin = certificate["report"], certificate["margin"]
    return [
        "yes" if verdict.certified else "no",
        "none" if margin is None else f"{margin:.2f}",
        f"{report['speed'] or 0:.2f}",
        f"{report['speed_body_lengths'] or 0:.2f}",
        str(report["gait"]),
        str(generations),
        ", ".join(f"{m.name} {value}" for m, value in zip(measures, values, strict=True)) or "-",
    ]


if __name__ == "__main__":
    main()
