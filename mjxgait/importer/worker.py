"""Compilation of a cleaned model, in this process or in one with limited time and memory."""

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
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.errors import UserError
from mjxgait.importer.source import leave_out, lost, put_stand_in
from mjxgait.processes import python_command, safe_environment

SECONDS, GIGABYTES = 10.0, 1.0
"""Default limits of processor time in s and memory in GB for compiling a model."""
PATIENCE = 6.0
"""Seconds to wait per second of processor time, because other programs may use the cores."""
MOST_REPAIRS = 40
OPTIONAL = ("actuator", "sensor", "keyframe", "tendon", "contact")
"""Sections that are dropped if the model does not compile with them."""
UNKNOWN_ATTRIBUTE = re.compile(r"unrecognized attribute: '([^']+)'.*?Element '([^']+)'", re.DOTALL)
ASSET = re.compile(r"asset[0-9]+\.(?:stl|obj|msh)|(?<=')asset[0-9]+(?=')")


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
        f"MuJoCo did not compile the model within {seconds:g} s; simplify its meshes, take out what "
        "is not its body, or allow more with --seconds"
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
        raise UserError(
            "MuJoCo ended abnormally or ran out of memory while it compiled the model "
            f"({gigabytes:g} GB); simplify its meshes, or allow more with --gigabytes"
        )
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

    Args:
      missing: meshes that small ones stand in for, see `leave_out`.

    Raises:
      UserError: with MuJoCo's own words.
    """
    changes: list[tuple[str, str]] = []
    gone = dict(missing or {})
    left_out = list(OPTIONAL)
    for _ in range(MOST_REPAIRS):
        try:
            spec = mujoco.MjSpec.from_string(ET.tostring(tree, encoding="unicode"), assets=assets)
            spec.compiler.fusestatic = False
            spec.compiler.discardvisual = False
            leave_out(spec, gone)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about the file's style
                return spec.compile(), changes
        except (ValueError, TypeError, RuntimeError, mujoco.FatalError) as error:
            message = " ".join(str(error).split())
        if not _repair(tree, message, changes, left_out, gone):
            raise UserError(f"MuJoCo cannot read the model: {message[:400]}")
    raise UserError(f"MuJoCo cannot read the model after {MOST_REPAIRS} repairs: {message[:400]}")


def _repair(
    tree: ET.Element,
    message: str,
    changes: list[tuple[str, str]],
    left_out: list[str],
    gone: dict[str, str],
) -> bool:
    """Change the tree to avoid this message; return False if nothing is left to try."""
    if found := UNKNOWN_ATTRIBUTE.search(message):
        name, tag = found.groups()
        hit = [e for e in tree.iter(tag) if name in e.attrib]
        for element in hit:
            del element.attrib[name]
        changes.append(
            (f'attribute "{name}" of <{tag}> dropped', "this version of MuJoCo does not know it")
        )
        return bool(hit)
    if any(
        word in message
        for word in (
            "inertia must satisfy",
            "mass and inertia of moving bodies",
            "inertia must be positive",
        )
    ):
        compiler = _compiler(tree)
        if compiler.get("boundmass"):
            return False
        compiler.attrib.update(balanceinertia="true", boundmass="1e-4", boundinertia="1e-6")
        changes.append(
            (
                "masses and inertias raised to 1e-4 kg and 1e-6 kg m² and balanced where they were "
                "less",
                message[:160],
            )
        )
        return True
    if (found := ASSET.search(message)) and _drop_mesh(tree, found.group(), gone):
        changes.append((f"a mesh and its shapes dropped ({found.group()})", message[:160]))
        return True
    if "mesh" in message and (
        "volume" in message or "orientation" in message or "inertia" in message
    ):
        meshes = [m for m in tree.iter("mesh") if m.get("inertia") != "convex"]
        if meshes and tree.tag != "robot":
            for mesh in meshes:
                mesh.set("inertia", "convex")
            changes.append(("mesh inertias taken from the convex hulls", message[:160]))
            return True
    while left_out:
        section = left_out.pop(0)
        parts = tree.findall(section)
        for part in parts:
            tree.remove(part)
        if parts:
            changes.append(
                (f"<{section}> dropped", f"the model does not compile with it: {message[:160]}")
            )
            return True
    return False


def _drop_mesh(tree: ET.Element, key: str, gone: dict[str, str]) -> bool:
    """Remove the meshes of an asset and the shapes that use them; return False if there are none.

    gone: meshes replaced by small ones; those removed from MJCF are added.
    """
    stem = key.split(".")[0]
    hit = [m for m in tree.iter("mesh") if m.get("file", "").split(".")[0] == stem]
    for mesh in hit:
        gone[mesh.get("name", "")] = f"{mesh.get('name')} (it is there, but not as MuJoCo wants it)"
        put_stand_in(mesh)
    for link in tree.findall("link"):
        for shape in list(link):
            mesh_of = shape.find("geometry/mesh")
            if mesh_of is None or mesh_of.get("filename", "").split(".")[0] != stem:
                continue
            if shape.tag == "collision" and link.find("inertial") is None:
                raise lost("", link.get("name", ""), stem)
            link.remove(shape)
            hit.append(mesh_of)
    return bool(hit)


def _compiler(tree: ET.Element) -> ET.Element:
    home = tree
    if tree.tag == "robot":
        home = tree.find("mujoco")  # type: ignore[assignment]
    found = home.findall("compiler")
    return found[-1] if found else ET.SubElement(home, "compiler")


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


def _reason(error: Exception, gigabytes: float) -> str:
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
