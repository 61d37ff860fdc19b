"""`mjxgait train` in this process, with the time that each of its parts delayed it.

    python benchmarks/stopwatch.py parts.json --env tall_quadruped --seed 0

Arguments after the first go to `train`. Timed are the functions that the run's own loop calls, one
after the other in the main thread; the remainder is `rest`.
"""

import functools
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

BEGAN = time.perf_counter()


class Stopwatch:
    """Seconds by part."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def add(self, part: str, seconds: float) -> None:
        self.seconds[part] = self.seconds.get(part, 0.0) + seconds

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the same function, with its calls timed for a part."""

        @functools.wraps(function)
        def run(*args: Any, **kwargs: Any) -> Any:
            began = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                self.add(part, time.perf_counter() - began)

        return run

    def watch(self, owner: object, name: str, part: str) -> None:
        """Time the calls of a function, given by its name in an object or a module."""
        setattr(owner, name, self.timed(part, getattr(owner, name)))


def main() -> None:
    path, *arguments = sys.argv[1:]
    from mjxgait.cli import main as command
    from mjxgait.training import (
        checkpoint,
        examination,
        experiment,
        loop,
        stages,
    )
    from mjxgait.training import examination as looks

    watch = Stopwatch()
    watch.add("imports", time.perf_counter() - BEGAN)
    watch.watch(loop, "build_experiment", "body and starts")
    watch.watch(stages, "lowered", "tracing")
    watch.watch(experiment, "compile_stages", "compiling")
    watch.watch(loop, "_generation", "evolution")
    # Validation runs in parallel: it delays evolution only where the loop waits.
    watch.watch(looks.Validation, "found", "waiting for looks")
    # With pre-screening it runs here.
    watch.watch(looks.Validation, "begin", "waiting for looks")
    watch.watch(examination.Examiner, "best", "examination at the end")
    watch.watch(checkpoint.Checkpoints, "save", "checkpoints")
    watch.watch(checkpoint.Checkpoints, "close", "checkpoints")
    code = 0
    try:
        command(["train", *arguments])
    except SystemExit as end:
        code = int(end.code or 0)
    whole = time.perf_counter() - BEGAN
    # Tracing happens during compiling: count it once.
    watch.add("compiling", -watch.seconds.get("tracing", 0.0))
    watch.add("rest", whole - sum(watch.seconds.values()))
    Path(path).write_text(json.dumps(watch.seconds, indent=2) + "\n", encoding="utf-8")
    sys.exit(code)


if __name__ == "__main__":
    main()
