"""MuJoCo's own WebAssembly build, which a page with physics contains: where it comes from.

It is the npm package `@mujoco/mujoco` (Apache-2.0), of one version with known checksums. It is no
part of this package: npm fetches it once into the user's cache, or the user names its folder.
"""

import contextlib
import dataclasses
import hashlib
import os
import shutil
import subprocess
import tarfile
import tempfile
from collections.abc import Mapping
from pathlib import Path

from mjxgait import files
from mjxgait.errors import UserError
from mjxgait.processes import safe_environment

PACKAGE, VERSION = "@mujoco/mujoco", "3.14.0"
CHECKSUMS = {
    "mujoco.js": "bc6980e4bc5ee5f809a6cabde0743798637e113d333f9e85124714d42be1ccae",
    "mujoco.wasm": "2d380f1070a556c3003b4a7c7c10c98a5f61db4e91815de1075ec478e9487e76",
}
"""SHA-256 of the two files that a page needs."""
MAX_BYTES = 100_000_000
"""Largest size of a file in bytes."""
PATIENCE = 300.0
"""s; npm waits for the network."""
BY_HAND = (
    f"fetch the npm package {PACKAGE} {VERSION} elsewhere, unpack it, and name its folder with "
    "--wasm"
)


@dataclasses.dataclass(frozen=True)
class Engine:
    """The two files of MuJoCo's WebAssembly build. script: a JavaScript module."""

    script: str
    binary: bytes


def engine_from(folder: Path | None) -> Engine:
    """Return the build in a folder; without one, from the cache, where npm puts it once.

    Raises:
      UserError: the folder holds another build, or npm is missing or cannot fetch it.
    """
    if folder is not None:
        return _read(folder)
    kept = cache_folder()
    if not all((kept / name).is_file() for name in CHECKSUMS):
        _fetch(kept)
    return _read(kept)


def cache_folder() -> Path:
    """Return the folder of this version in the user's cache."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "mjxgait" / f"mujoco-wasm-{VERSION}"


def _read(folder: Path) -> Engine:
    """Return the build in a folder."""
    found = {name: files.read_bytes(folder / name, MAX_BYTES) for name in CHECKSUMS}
    _check(found, folder)
    return Engine(found["mujoco.js"].decode("utf-8"), found["mujoco.wasm"])


def _check(found: Mapping[str, bytes], folder: Path) -> None:
    """Refuse another build. found: contents by name."""
    for name, data in found.items():
        if hashlib.sha256(data).hexdigest() != CHECKSUMS[name]:
            raise UserError(
                f"{folder / name}: not the file of {PACKAGE} {VERSION}; take it away, or name the "
                "unpacked package with --wasm"
            )


def _fetch(kept: Path) -> None:
    """Let npm fetch the package, and keep its two files."""
    npm = shutil.which("npm")
    if npm is None:
        raise UserError(
            f"--physics needs MuJoCo's WebAssembly build, and npm, which fetches it once, is not "
            f"installed; install npm, or {BY_HAND}"
        )
    with tempfile.TemporaryDirectory() as work, files.writing(kept):
        _pack(npm, work)
        found = _unpacked(next(Path(work).glob("*.tgz")))
        _check(found, kept)
        kept.mkdir(parents=True, exist_ok=True)
        for name, data in found.items():
            files.write_bytes(kept / name, data)


def _pack(npm: str, work: str) -> None:
    """Download the package's archive into a folder."""
    try:
        done = subprocess.run(
            [npm, "pack", f"{PACKAGE}@{VERSION}"],
            cwd=work,
            env=safe_environment(),
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        reason = f"no answer in {PATIENCE:.0f} s"
    else:
        if done.returncode == 0 and any(Path(work).glob("*.tgz")):
            return
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
        reason = lines[0] if lines else f"exit code {done.returncode}"
    raise UserError(
        f"npm could not fetch {PACKAGE} {VERSION} ({reason}); try again with a network, or "
        f"{BY_HAND}"
    )


def _unpacked(archive: Path) -> dict[str, bytes]:
    """Content of the two files by name; nothing is written. What is missing is empty."""
    found = dict.fromkeys(CHECKSUMS, b"")
    with contextlib.suppress(tarfile.TarError, KeyError, EOFError), tarfile.open(archive) as packed:
        for name in found:
            if member := packed.extractfile(f"package/{name}"):
                found[name] = member.read(MAX_BYTES)
    return found
