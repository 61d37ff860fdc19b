"""Compilation of a cleaned model, in this process or in one with limited time and memory."""

import copy
import dataclasses
import json
import math
import os
import pickle
import re
import signal
import subprocess
import sys
import time
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.errors import UserError
from mjxgait.importer.meshes import convert, misfit, with_y_up
from mjxgait.importer.source import leave_out
from mjxgait.processes import python_command, safe_environment

SECONDS, GIGABYTES = 10.0, 2.0
"""Default limits of processor time in s and memory in GB for compiling a model."""
PATIENCE = 6.0
"""Seconds to wait per second of processor time, because other programs may use the cores."""
MOST_REPAIRS = 40
FITS = 0.5
"""Share of the meshes' distance from the joints below which a turn of them is an improvement."""
OPTIONAL = ("actuator", "sensor", "keyframe", "tendon", "contact")
"""Sections that are dropped if the model does not compile with them."""
UNKNOWN_ATTRIBUTE = re.compile(r"unrecognized attribute: '([^']+)'.*?Element '([^']+)'", re.DOTALL)
ASSET = re.compile(r"(asset[0-9]+)(?=\.(?:stl|obj|msh|dae|glb|ply)|')")
IMPOSSIBLE = (
    "inertia must satisfy",
    "mass and inertia of moving bodies",
    "inertia must be positive",
)
"""MuJoCo's words about masses and inertias that it does not accept."""


def compile_apart(
    tree: ET.Element,
    assets: dict[str, bytes],
    missing: dict[str, str] | None = None,
    seconds: float = SECONDS,
    gigabytes: float = GIGABYTES,
) -> tuple[mujoco.MjModel, list[tuple[str, str]]]:
    """Run `compile_here` in a separate process, which cannot take this one down.

    Raises:
      UserError: it does not compile, or takes too long or too much memory.
    """
    order = pickle.dumps((ET.tostring(tree), assets, missing, seconds, gigabytes))
    slow = UserError(
        f"MuJoCo did not compile the model within {seconds:g} s; simplify its meshes, take out "
        "what is not its body, or allow more with --seconds"
    )
    try:
        done = subprocess.run(
            python_command(__name__),
            env=safe_environment(),
            input=order,
            capture_output=True,
            timeout=PATIENCE * seconds + PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise slow from None
    if os.name == "posix" and done.returncode == -signal.SIGXCPU:
        raise slow
    head, _, body = done.stdout.partition(b"\n")
    if done.returncode or not head:
        raise UserError(_abnormal(gigabytes))
    answer = json.loads(head)
    if "error" in answer:
        raise UserError(answer["error"])
    return mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": body}), [
        (w, y) for w, y in answer["changes"]
    ]


def compile_here(
    tree: ET.Element, assets: dict[str, bytes], missing: dict[str, str] | None = None
) -> tuple[mujoco.MjModel, list[tuple[str, str]]]:
    """Return the compiled model, and the changes needed to compile it with their reasons.

    The up axis of COLLADA files counts only if links fit together better for it.

    Args:
      missing: meshes that are not in `assets`, see `leave_out`.

    Raises:
      UserError: with MuJoCo's own words.
    """
    lying = with_y_up(assets)
    as_written = _compiled(copy.deepcopy(tree), assets, missing or {}, ())
    if not lying:
        return as_written
    upright, changes = _compiled(tree, assets, missing or {}, lying)
    if misfit(upright) < FITS * misfit(as_written[0]):
        what = f"{len(lying)} meshes turned so that their y is up"
        return upright, [(what, "as their files state; so they reach the joints"), *changes]
    return as_written


def _compiled(
    tree: ET.Element, assets: dict[str, bytes], missing: dict[str, str], upright: Collection[str]
) -> tuple[mujoco.MjModel, list[tuple[str, str]]]:
    """Compile a tree, which is changed where it must be; see `compile_here` and `convert`."""
    repairs, assets = _Repairs(tree, dict(missing)), dict(assets)
    convert(assets, repairs.leave_out, upright)
    for _ in range(MOST_REPAIRS):
        try:
            spec = mujoco.MjSpec.from_string(ET.tostring(tree, encoding="unicode"), assets=assets)
            spec.compiler.fusestatic = False
            spec.compiler.discardvisual = False
            leave_out(spec, repairs.missing)
            for edit in repairs.edits:
                edit(spec)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about the file's style
                return spec.compile(), repairs.changes
        except (ValueError, TypeError, RuntimeError, mujoco.FatalError) as error:
            message = " ".join(str(error).split())
        if not repairs.repair(message, assets):
            raise UserError(f"MuJoCo cannot read the model: {message[:400]}")
    raise UserError(f"MuJoCo cannot read the model after {MOST_REPAIRS} repairs: {message[:400]}")


def _raise_masses(spec: mujoco.MjSpec) -> None:
    spec.compiler.balanceinertia = True
    spec.compiler.boundmass, spec.compiler.boundinertia = 1e-4, 1e-6


def _take_hulls(spec: mujoco.MjSpec) -> None:
    for mesh in spec.meshes:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX


@dataclasses.dataclass
class _Repairs:
    """Repairs so far: of the tree, meshes to leave out, edits of the model that has been read."""

    tree: ET.Element
    missing: dict[str, str]
    changes: list[tuple[str, str]] = dataclasses.field(default_factory=list)
    edits: list[Callable[[mujoco.MjSpec], None]] = dataclasses.field(default_factory=list)
    optional: list[str] = dataclasses.field(default_factory=lambda: list(OPTIONAL))

    def repair(self, message: str, assets: Collection[str]) -> bool:
        """Add a repair that avoids this message; return False if nothing is left to try."""
        if found := UNKNOWN_ATTRIBUTE.search(message):
            return self._drop_attribute(*found.groups())
        reason = message[:160]
        if any(words in message for words in IMPOSSIBLE):
            if _raise_masses in self.edits:
                return False
            self.edits.append(_raise_masses)
            what = "masses and inertias raised to 1e-4 kg and 1e-6 kg m² and balanced"
            self.changes.append((f"{what} where they were less", reason))
            return True
        if key := self._damaged(message, assets):
            self.leave_out(key, reason)
            return True
        inertia = any(word in message for word in ("volume", "orientation", "inertia"))
        if "mesh" in message and inertia and _take_hulls not in self.edits:
            self.edits.append(_take_hulls)
            self.changes.append(("mesh inertias taken from the convex hulls", reason))
            return True
        return self._drop_section(reason)

    def leave_out(self, key: str, reason: str) -> None:
        """Leave out a mesh that cannot be read, with its shapes."""
        self.missing[key] = ""
        self.changes.append((f"a mesh and its shapes dropped ({key})", reason))

    def _drop_attribute(self, name: str, tag: str) -> bool:
        hit = [e for e in self.tree.iter(tag) if name in e.attrib]
        for element in hit:
            del element.attrib[name]
        what = f'attribute "{name}" of <{tag}> dropped'
        self.changes.append((what, "this version of MuJoCo does not know it"))
        return bool(hit)

    def _damaged(self, message: str, assets: Collection[str]) -> str:
        """Key of the mesh that the message names, if it is not left out already; else ""."""
        found = ASSET.search(message)
        keys = [key for key in assets if found and key.startswith(f"{found.group(1)}.")]
        return "".join(key for key in keys if key not in self.missing)

    def _drop_section(self, reason: str) -> bool:
        while self.optional:
            section = self.optional.pop(0)
            parts = self.tree.findall(section)
            for part in parts:
                self.tree.remove(part)
            if parts:
                why = f"the model does not compile with it: {reason}"
                self.changes.append((f"<{section}> dropped", why))
                return True
        return False


def _bound(seconds: float, gigabytes: float) -> None:
    """Limit further processor time and memory of this process, where the system can."""
    try:
        import resource

        last = math.ceil(time.process_time() + seconds)
        resource.setrlimit(resource.RLIMIT_CPU, (last, last + 1))
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + int(gigabytes * 1e9)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    except (ImportError, ValueError, OSError):
        pass


def _abnormal(gigabytes: float) -> str:
    return (
        "MuJoCo ended abnormally or ran out of memory while it compiled the model "
        f"({gigabytes:g} GB); simplify its meshes, or allow more with --gigabytes"
    )


def _reason(error: Exception, gigabytes: float) -> str:
    if "unknown exception" in str(error):  # some of MuJoCo's parts say so without memory
        return _abnormal(gigabytes)
    short = isinstance(error, MemoryError) or "allocate memory" in str(error)
    return (
        f"compiling the model takes more than {gigabytes:g} GB of memory; simplify its meshes, or "
        "allow more with --gigabytes"
        if short
        else str(error)
    )


def _serve() -> None:
    """Read an order, written by `compile_apart`, from standard input; answer on standard output."""
    text, assets, missing, seconds, gigabytes = pickle.loads(sys.stdin.buffer.read())
    _bound(seconds, gigabytes)
    try:
        model, changes = compile_here(ET.fromstring(text), assets, missing)
    except (UserError, MemoryError) as error:
        sys.stdout.buffer.write(json.dumps({"error": _reason(error, gigabytes)}).encode() + b"\n")
        return
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    sys.stdout.buffer.write(json.dumps({"changes": changes}).encode() + b"\n" + buffer.tobytes())


if __name__ == "__main__":
    _serve()
