"""Start of the program's own processes, without code from the current folder.

Python puts the current folder, or the folder of the script, first on the path of modules; a file
`json.py` there would run in place of Python's own. `-P` leaves it out, and `PYTHONSAFEPATH` does so
for processes started further down.
"""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

SAFE_PATH = {"PYTHONSAFEPATH": "1"}


def python_command(module: str, *words: str) -> list[str]:
    """Return the command that runs a module of this package in a new process."""
    return [sys.executable, "-P", "-m", module, *words]


def safe_environment() -> dict[str, str]:
    """Return the environment of a new process."""
    return {**os.environ, **SAFE_PATH}


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for the duration of the block."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
