"""`mjxgait view`: a local page that shows a run as it learns."""

import contextlib
import dataclasses
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import tyro

from mjxgait.parts.own import loaded


@dataclasses.dataclass(frozen=True)
class ViewOptions:
    """Show a run, finished or still learning, on a page that only this machine can reach.

    Attributes:
      run: Run folder.
      port: Port on 127.0.0.1; by default the first free one from 8765 on.
    """

    run: tyro.conf.Positional[Path]
    port: int | None = None


def view_command(arguments: Sequence[str]) -> int:
    """Returns the exit code; runs until interrupted."""
    options = tyro.cli(ViewOptions, args=list(arguments), prog="mjxgait view")
    from mjxgait.web.live import serve

    # What a script starts in the background ignores interrupts, and Python leaves it so: without
    # this nothing but a kill would end it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    serve(
        options.run,
        options.port,
        ready=lambda address: print(
            f"{address} (only from this machine; Ctrl-C ends it)", flush=True
        ),
    )
    return 0


@contextlib.contextmanager
def following(run: Path) -> Iterator[None]:
    """Show a run as long as the block lasts, in a process of its own that prints its address;
    if it fails, the block goes on.
    """
    # What was named on this command line, not what the run folder says.
    own = [word for kind, place in loaded() for word in (f"--{kind}", place)]
    command = [sys.executable, "-m", "mjxgait", "view", str(run), *own]
    viewer = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    try:
        yield
    finally:
        viewer.terminate()
        viewer.wait()
