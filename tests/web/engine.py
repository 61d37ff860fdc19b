"""Where tests find Node and MuJoCo's WebAssembly build, which are no part of the package."""

import shutil
import subprocess
from pathlib import Path

import pytest

from mjxgait.web.wasm import CHECKSUMS, PACKAGE, VERSION, cache_folder


def engine_folder() -> Path:
    """Folder of the build: the user's cache or npm's global packages; skips without it."""
    for folder in (cache_folder(), _global_package()):
        if folder is not None and all((folder / name).is_file() for name in CHECKSUMS):
            return folder
    pytest.skip(f"needs MuJoCo's WebAssembly build: npm install --global {PACKAGE}@{VERSION}")


def node() -> str:
    """The program; skips without it."""
    found = shutil.which("node")
    if found is None:
        pytest.skip("needs Node")
    return found


def _global_package() -> Path | None:
    npm = shutil.which("npm")
    if npm is None:
        return None
    found = subprocess.run([npm, "root", "--global"], capture_output=True, text=True, check=False)
    return Path(found.stdout.strip()) / PACKAGE if found.returncode == 0 else None
