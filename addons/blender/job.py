"""Commands that run one after the other in processes of their own. Runs without Blender.

Nothing here waits: `poll` takes what the process has printed, and starts the next command.
"""

import contextlib
import os
import queue
import signal
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path

from .commands import Progress, Step, began, progress_after

LOG = "mjxgait.log"
LAST = 3
"""Number of printed lines that an error shows, if the program has none of its own."""
OWN_ERROR = "mjxgait: "


class Job:
    """Steps under way; everything printed is in the folder's log.

    progress: so far. error: why it ended too soon. running, cancelled: as they say.
    """

    def __init__(self, steps: Sequence[Step], folder: Path) -> None:
        self.folder, self.progress, self.error = folder, Progress(), ""
        self.cancelled = False
        self._waiting, self._lines = list(steps), list[str]()
        self._step: Step | None = None
        self._process: subprocess.Popen[str] | None = None
        self._printed: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._next()

    @property
    def running(self) -> bool:
        """Whether there is a process."""
        return self._process is not None

    @property
    def done(self) -> bool:
        """Whether all steps succeeded."""
        return not (self.running or self.error or self.cancelled)

    def poll(self) -> None:
        """Read what was printed since, and go on to the next step if one has ended."""
        while self.running:
            try:
                line = self._printed.get_nowait()
            except queue.Empty:
                return
            if line is None:
                self._ended()
            elif self._step is not None:
                with open(self.folder / LOG, "a", encoding="utf-8") as log:
                    log.write(line)
                self._lines.append(line.rstrip())
                self.progress = progress_after(self.progress, self._step, line)

    def cancel(self) -> None:
        """End the process and those that it started."""
        if self._process is None:
            return
        end_tree(self._process)
        self.cancelled, self._process = True, None

    def _next(self) -> None:
        if not self._waiting:
            self._process = None
            return
        self._step, self._lines = self._waiting.pop(0), []
        self.progress = began(self.progress, self._step)
        try:
            self._process = started(self._step.words)
        except OSError as error:
            self._fail(f"{self._step.words[0]}: cannot be started ({error.strerror or error})")
            return
        threading.Thread(target=_read, args=(self._process, self._printed), daemon=True).start()

    def _ended(self) -> None:
        assert self._process is not None
        if self._process.wait():
            self._fail(error_in(self._lines) or f"ended with code {self._process.returncode}")
        else:
            self._next()

    def _fail(self, why: str) -> None:
        self.error, self._process = why, None


def error_in(lines: Sequence[str]) -> str:
    """Return the error that the program printed, or its last lines."""
    if own := [line for line in lines if line.startswith(OWN_ERROR)]:
        return own[-1].removeprefix(OWN_ERROR)
    return " ".join([line.strip() for line in lines if line.strip()][-LAST:])


def started(words: Sequence[str]) -> "subprocess.Popen[str]":
    """Start a program with its output as text; it heads a group that `end_tree` ends.

    Raises:
      OSError: it cannot be started.
    """
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONHOME", "PYTHONPATH")}
    environment |= {"PYTHONUNBUFFERED": "1", "PYTHONSAFEPATH": "1", "PYTHONUTF8": "1"}
    return subprocess.Popen(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding="utf-8",
        errors="replace",
        env=environment,
        start_new_session=os.name != "nt",
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )


def end_tree(process: "subprocess.Popen[str]") -> None:
    """Kill a process that `started` made, and its children."""
    if os.name == "nt":
        command = ["taskkill", "/F", "/T", "/PID", str(process.pid)]
        subprocess.run(command, capture_output=True, check=False)
    else:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _read(process: "subprocess.Popen[str]", printed: "queue.SimpleQueue[str | None]") -> None:
    """Pass the lines on, and None at their end."""
    assert process.stdout is not None
    with process.stdout:
        for line in process.stdout:
            printed.put(line)
    printed.put(None)
