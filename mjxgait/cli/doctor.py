"""`mjxgait doctor`: whether a run would work on this machine, and what is missing."""

import dataclasses
import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

from mjxgait.animation.clips.fbx import VARIABLE, WAYS, find_blender
from mjxgait.cache import named_folder, own_folder, programs_in
from mjxgait.cli.cache import in_words
from mjxgait.cli.options import parsed
from mjxgait.extras import install_command
from mjxgait.processes import cores
from mjxgait.rendering.gl_probe import OFF, candidates, working

ROOM, MEMORY = 0.5e9, 2e9
"""Bytes of disk and of memory that a run of the default size should find free."""
SHOWN = ("jax", "mujoco")
"""Packages that a run needs and that get lines of their own."""
USES = {
    "video": "mp4 and other videos",
    "cluster": "several machines",
    "usd": "USD files",
    "peers": "benchmarks against DART",
    "pandas": "tables in Python",
    "tensorboard": "--log tensorboard",
    "wandb": "--log wandb",
    "gym": "Gymnasium",
    "robots": "robots by name, xacro files",
}
"""Extras of the package, and what each is for."""
COMPILERS = ("cc", "gcc", "clang")


@dataclasses.dataclass(frozen=True)
class DoctorOptions:
    """Tell whether a run would work on this machine: one line for each part, "ok" or the remedy.

    The exit code is 0 if a run would work, else 1. What is only optional does not count.
    """


@dataclasses.dataclass(frozen=True)
class Finding:
    """One part of the machine.

    value: what was found. remedy: what to do; empty if nothing. needed: whether a run fails
      without it.
    """

    name: str
    value: str
    remedy: str = ""
    needed: bool = False

    @property
    def line(self) -> str:
        """The finding as a line."""
        if not self.remedy:
            return f"{self.name:16} ok        {self.value}"
        kind = "MISSING" if self.needed else "optional"
        return f"{self.name:16} {kind:9} {self.value}: {self.remedy}"


def doctor_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    parsed(DoctorOptions, "doctor", arguments)
    works = True
    for finding in findings():
        print(finding.line, flush=True)
        works = works and not (finding.needed and finding.remedy)
    print("A run would work." if works else "A run would not work: see MISSING above.")
    return 0 if works else 1


def findings() -> Iterator[Finding]:
    """Yield all findings, the quick ones first."""
    yield Finding("mjxgait", f"{metadata.version('mjxgait')}, Python {platform.python_version()}")
    yield from packages()
    yield Finding("cores", str(cores()))
    yield memory(free_memory())
    yield disk(Path.cwd())
    yield cache(named_folder() or own_folder())
    yield compiler(shutil.which)
    yield blender(find_blender())
    yield accelerator()
    yield renderer(os.environ.get("MUJOCO_GL"))


def packages() -> Iterator[Finding]:
    """Yield the packages that a run needs, and the optional ones by extra."""
    needed, extras = _requirements()
    wrong = [said for one in needed if (said := _wrong(one))]
    for name in SHOWN:
        yield Finding(name, _version(name) or "not installed")
    again = f"{sys.executable} -m pip install --force-reinstall mjxgait"
    yield Finding(
        "packages",
        ", ".join(wrong) or f"{len(needed)} with the versions that are needed",
        again if wrong else "",
        needed=True,
    )
    for extra, use in USES.items():
        missing = [said for one in extras.get(extra, ()) if (said := _wrong(one))]
        names = ", ".join(f"{one.name} {_version(one.name)}" for one in extras.get(extra, ()))
        remedy = f"for {use}: {install_command(extra)}" if missing else ""
        yield Finding(extra, ", ".join(missing) or names, remedy)


def memory(free: float | None) -> Finding:
    """Return the finding about free memory in bytes; None if the system does not tell."""
    if free is None:
        return Finding("memory", "unknown")
    remedy = "close other programs, or lower --population" if free < MEMORY else ""
    return Finding("memory", f"{free / 1e9:.1f} GB free", remedy)


def disk(folder: Path) -> Finding:
    """Return the finding about the disk that runs are written to."""
    free = shutil.disk_usage(folder).free
    value = f"{free / 1e9:.1f} GB free in {folder}"
    if not os.access(folder, os.W_OK):
        remedy = "this folder cannot be written; name another with --out"
    else:
        remedy = "make room, or name a folder on another disk with --out" if free < ROOM else ""
    return Finding("disk", value, remedy, needed=True)


def cache(folder: Path) -> Finding:
    """Return the finding about the folder of compiled programs."""
    there = next(place for place in (folder, *folder.parents) if place.exists())
    written = os.access(there, os.W_OK)
    remedy = "" if written else "cannot be written; every run compiles anew: set XDG_CACHE_HOME"
    return Finding("compiled", f"{in_words(programs_in(folder))} in {folder}", remedy)


def compiler(find: Callable[[str], str | None]) -> Finding:
    """Return the finding about a C compiler. find: from a name to a path."""
    found = next((path for name in COMPILERS if (path := find(name))), None)
    remedy = "" if found else "only for benchmarks: install gcc or clang"
    return Finding("C compiler", found or "none found", remedy)


def blender(command: Sequence[str]) -> Finding:
    """Return the finding about Blender. command: words that run a script in it; none without one."""
    if not command:
        return Finding("Blender", "none found", f"only for FBX files: {WAYS}")
    there = shutil.which(command[0])
    remedy = "" if there else f"cannot be started: correct {VARIABLE}"
    return Finding("Blender", command[0], remedy)


def accelerator() -> Finding:
    """Return the finding about the devices that JAX sees."""
    # A GPU keeps its memory for the runs beside this command.
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
    try:
        import jax

        devices = jax.devices()
    except Exception as error:  # JAX raises errors of many kinds where a driver is broken
        reason = str(error).strip().splitlines() or [type(error).__name__]
        return Finding("devices", reason[0][:100], "set JAX_PLATFORMS=cpu", needed=True)
    kinds = ", ".join(dict.fromkeys(device.device_kind for device in devices))
    where = "no accelerator; runs use the CPU" if devices[0].platform == "cpu" else kinds
    return Finding("devices", where)


def renderer(wanted: str | None) -> Finding:
    """Return the finding about MuJoCo's renderer. wanted: value of MUJOCO_GL."""
    if wanted and wanted.lower() in OFF:
        return Finding("GL", f"off, as MUJOCO_GL={wanted} says; the painter draws")
    found = working(candidates(wanted))
    remedy = "" if found else "videos are drawn without it; for it install libegl1 or libosmesa6"
    return Finding("GL", ", ".join(found) or "no backend works", remedy)


def free_memory() -> float | None:
    """Return the free memory in bytes; None if the system does not tell."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="utf-8").splitlines()
        free = dict(line.split(":", 1) for line in lines)["MemAvailable"]
        return 1024.0 * int(free.split()[0])
    except (OSError, KeyError, ValueError):
        return None


def _requirements() -> tuple[list[Requirement], dict[str, list[Requirement]]]:
    """Return the requirements of this package: those always needed, and the others by extra."""
    needed: list[Requirement] = []
    extras: dict[str, list[Requirement]] = {}
    for text in metadata.requires("mjxgait") or ():
        one = Requirement(text)
        marker = str(one.marker or "")
        if "extra ==" in marker:
            extras.setdefault(marker.split("extra ==")[1].strip(" '\""), []).append(one)
        else:
            needed.append(one)
    return needed, extras


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _wrong(one: Requirement) -> str:
    """Return what is wrong with an installed package; empty if nothing."""
    version = _version(one.name)
    if version is None:
        return f"{one.name} is not installed"
    if one.specifier.contains(version, prereleases=True):
        return ""
    return f"{one.name} is {version}, not {one.specifier}"
