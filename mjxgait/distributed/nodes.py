"""Machines: processor, installed versions, and whether they may work with this one."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True)
class Machine:
    """A machine of the cluster.

    versions: of all that determines what a program computes. kind: of processor; `tag` is its hash.
    """

    versions: Mapping[str, str]
    kind: str
    tag: str


def look() -> dict[str, Any]:
    """Return the fields of `Machine` for the machine that runs this.

    It uses only Python's own library: it is sent by value, to machines that may lack mjxgait.
    """
    import hashlib
    import importlib.metadata
    import importlib.util
    import platform
    from pathlib import Path

    versions = {"python": platform.python_version()}
    for name in ("mjxgait", "jax", "jaxlib", "mujoco", "mujoco-mjx"):
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "none"
    code, spec = hashlib.sha256(), importlib.util.find_spec("mjxgait")
    for place in (spec and spec.submodule_search_locations) or ():
        for path in sorted(Path(place).rglob("*.py")):
            code.update(path.read_bytes())
    versions["code of mjxgait"] = code.hexdigest()[:8]
    model, flags = platform.processor(), ""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            key, _, value = (part.strip() for part in line.partition(":"))
            model, flags = (value, flags) if key == "model name" else (model, flags)
            flags = value if key in ("flags", "Features") else flags
    except OSError:
        pass  # not Linux
    kind = f"{platform.machine()} {model}"
    tag = hashlib.sha256(f"{kind} {' '.join(sorted(flags.split()))}".encode()).hexdigest()[:8]
    return {"versions": versions, "kind": kind, "tag": tag}


@functools.cache
def this() -> Machine:
    """Return this machine."""
    return Machine(**look())


def mismatch(where: str, there: Machine) -> str | None:
    """Name the first difference between another machine's versions and this one's, or None."""
    here = this().versions
    for name, version in here.items():
        if there.versions[name] != version:
            return (
                f"{where} has {name} {there.versions[name]}, this machine has {version}; "
                "install the same on both"
            )
    return None


def require_same(where: str, there: Machine) -> None:
    """Refuse a machine with other versions.

    Raises:
      UserError: names the first difference, and both versions.
    """
    if said := mismatch(where, there):
        raise UserError(said)
