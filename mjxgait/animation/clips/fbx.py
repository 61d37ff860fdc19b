"""FBX in and out: a Blender, in a process of its own, turns FBX into GLB and back.

FBX has no open specification, and Blender reads and writes most of it.
"""

import contextlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from mjxgait.animation.clips.clip import Clip, Rig, read_bytes, written
from mjxgait.animation.clips.read_glb import read_glb, rig_of_glb
from mjxgait.errors import UserError
from mjxgait.files import replaced, write_bytes, writing
from mjxgait.processes import safe_environment

FBX = ".fbx"
VARIABLE = "MJXGAIT_BLENDER_PYTHON"
"""Environment variable with the path of a Python that has `bpy`, or of a Blender."""
WAYS = (
    f"install bpy in this Python, name a Python that has bpy (or a Blender) in {VARIABLE}, or put "
    "blender on the PATH"
)
BY_HAND = "or use glTF binary (.glb) instead of FBX"
SCRIPT = Path(__file__).with_name("in_blender.py")
PATIENCE = 600.0
"""Longest time for one file, s."""
Mode = Literal["ACTIONS", "ACTIVE_ACTIONS"]
"""Animations that Blender reads: all, or the first."""


def find_blender() -> list[str]:
    """Return the words before a script's own that run it in a Blender; none if there is none."""
    if named := os.environ.get(VARIABLE):
        return _as_program(named) if Path(named).stem.lower() == "blender" else [named]
    if importlib.util.find_spec("bpy") is not None:
        return [sys.executable]
    found = shutil.which("blender")
    return _as_program(found) if found else []


def _as_program(path: str) -> list[str]:
    return [path, "--background", "--factory-startup", "--python-exit-code", "1", "--python"]


def require_blender(path: Path) -> None:
    """Check that a file to be read or written is no FBX file, or that there is a Blender.

    Raises:
      UserError: names the ways to have one.
    """
    if path.suffix.lower() == FBX and not find_blender():
        raise UserError(f"{path}: FBX takes a Blender, and none is here: {WAYS}; {BY_HAND}")


@contextlib.contextmanager
def opened(path: Path, mode: Mode = "ACTIONS") -> Iterator[Path]:
    """Yield the path of a GLB file with the content of a file: the file itself, unless it is FBX.

    Bones and animations keep their names; units are m, and Y is up. Errors in the block name the
    user's file. mode: all animations, or only the first.

    Raises:
      UserError: there is no Blender, or it cannot read the file.
    """
    if path.suffix.lower() != FBX:
        yield path
        return
    read_bytes(path)  # that it is a file of a bearable size
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.glb"
        _run(path, "read", ["read", str(path.resolve()), str(made), mode], made)
        try:
            yield made
        except UserError as error:
            raise UserError(str(error).replace(str(made), str(path))) from None


def rig_of_fbx(path: Path) -> Rig:
    """Return the bones of a file's largest skin; see `opened` and `rig_of_glb` for errors."""
    with opened(path) as file:
        return rig_of_glb(file)


def read_fbx(path: Path) -> Clip:
    """Return the first animation of a file; see `opened` and `read_glb` for errors."""
    with opened(path, "ACTIVE_ACTIONS") as file:
        return read_glb(file)


def write_animated(
    path: Path, data: bytes, rate: int, name: str = "", character: Path | None = None
) -> None:
    """Write the bytes of an animated GLB file, as FBX if the path ends so.

    Args:
      rate: frames/s. name: of the animation. character: the file onto which it was put; of an FBX
        file everything else is taken from there, not from the bytes.

    Raises:
      UserError: there is no Blender, or the file cannot be written.
    """
    with writing(path):
        if path.suffix.lower() != FBX:
            write_bytes(path, data)
            return
        with tempfile.TemporaryDirectory() as folder, replaced(path) as beside:
            source, made = Path(folder) / "walk.glb", Path(folder) / "made.fbx"
            source.write_bytes(data)
            words = ["write", str(source), str(made), str(rate)]
            if character is not None and character.suffix.lower() == FBX:
                words += [name, str(character.resolve())]
            _run(path, "write", words, made)
            shutil.copyfile(made, beside)


def _run(path: Path, verb: str, words: Sequence[str], made: Path) -> None:
    """Run the script in Blender. verb: what is done with the user's file, for messages."""
    require_blender(path)
    command = find_blender()
    try:
        done = subprocess.run(
            [*command, str(SCRIPT), "--", *words],
            env=safe_environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PATIENCE,
        )
    except OSError as error:
        reason = error.strerror or str(error)
        raise UserError(f"{command[0]}: cannot be started ({reason}); {WAYS}") from None
    except subprocess.TimeoutExpired:
        reason = f"it did not end within {PATIENCE:.0f} s"
    else:
        if done.returncode == 0 and made.is_file():
            return
        reason = _reason(done.stderr) or f"exit code {done.returncode}"
        if "No module named 'bpy'" in reason:
            raise UserError(f"{command[0]}: has no bpy; {WAYS}")
    raise UserError(f"{path}: Blender cannot {verb} it ({reason})")


def _reason(said: str) -> str:
    """Return the last line of what Blender said, which names the error."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    return written(lines[-1]) if lines else ""
