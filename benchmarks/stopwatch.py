"""`mjxgait train` in this process, and how long each of its parts has held it up.

    python benchmarks/stopwatch.py parts.json --env tall_quadruped --seed 0

All after the first argument is handed on to `train`. What is timed are the functions that the run's
own loop calls, one after the other in the main thread; what is left goes to `rest`.
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
        """The same function, whose calls count for a part."""

        @functools.wraps(function)
        def run(*args: Any, **kwargs: Any) -> Any:
            began = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                self.add(part, time.perf_counter() - began)

        return run

    def watch(self, owner: object, name: str, part: str) -> None:
        """Times the calls of what an object or a module knows by a name."""
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
    from mjxgait.training import (
        validation as looks,
    )

    watch = Stopwatch()
    watch.add("imports", time.perf_counter() - BEGAN)
    watch.watch(loop, "build_experiment", "body and starts")
    watch.watch(stages, "lowered", "tracing")
    watch.watch(experiment, "compile_stages", "compiling")
    watch.watch(loop, "_generation", "evolution")
    # What goes on beside evolution holds it up only where it is waited for.
    watch.watch(looks.Looks, "found", "waiting for looks")
    watch.watch(examination.Examiner, "best", "examination at the end")
    watch.watch(checkpoint.Checkpoints, "save", "checkpoints")
    watch.watch(checkpoint.Checkpoints, "close", "checkpoints")
    code = 0
    try:
        command(["train", *arguments])
    except SystemExit as end:
        code = int(end.code or 0)
    whole = time.perf_counter() - BEGAN
    # What is traced meanwhile holds up nobody twice.
    watch.add("compiling", -watch.seconds.get("tracing", 0.0))
    watch.add("rest", whole - sum(watch.seconds.values()))
    Path(path).write_text(json.dumps(watch.seconds, indent=2) + "\n", encoding="utf-8")
    sys.exit(code)


if __name__ == "__main__":
    main()
