"""`mjxgait view`: a local page that shows a run during training."""

import contextlib
import dataclasses
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import tyro

from mjxgait.cli.options import parsed
from mjxgait.plugins.user_code import loaded
from mjxgait.processes import python_command, safe_environment


@dataclasses.dataclass(frozen=True)
class ViewOptions:
    """Show a run, finished or in training, on a page that only this machine can reach.

    Attributes:
      run: Run folder.
      port: Port on 127.0.0.1; by default the first free one from 8765 on.
      until_input_ends: End when the standard input does; `train --view` uses it so that the page
        ends with the training, however that ends.
    """

    run: tyro.conf.Positional[Path]
    port: int | None = None
    until_input_ends: bool = False


def view_command(arguments: Sequence[str]) -> int:
    """Serve the page until interrupted; return the exit code."""
    options = parsed(ViewOptions, "view", arguments)
    from mjxgait.web.live import serve

    # Background processes of a script ignore interrupts, and Python leaves it so: without this
    # handler only a kill would end the page.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    serve(
        options.run,
        options.port,
        ready=lambda address: print(
            f"{address} (only from this machine; Ctrl-C ends it)", flush=True
        ),
        wait=sys.stdin.buffer.read if options.until_input_ends else None,
    )
    return 0


@contextlib.contextmanager
def following(run: Path) -> Iterator[None]:
    """Show a run during the block, in a process of its own that prints its address.

    The block goes on if that process fails. That process also ends if this one is killed, because
    the system then closes the pipe that it reads.
    """
    # Code named on this command line, never code named by the run folder.
    own = [word for kind, place in loaded() for word in (f"--{kind}", place)]
    command = python_command("mjxgait", "view", str(run), "--until-input-ends", *own)
    viewer = subprocess.Popen(command, stdin=subprocess.PIPE, env=safe_environment())
    try:
        yield
    finally:
        viewer.terminate()
        viewer.communicate()
