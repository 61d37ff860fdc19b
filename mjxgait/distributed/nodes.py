"""What a machine is and what is installed on it, and whether it may work with this one."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True)
class Machine:
    """versions: of all that decides what a program computes. kind: of processor; `tag` is its hash."""

    versions: Mapping[str, str]
    kind: str
    tag: str


def look() -> dict[str, Any]:
    """The fields of a `Machine`, of the one that this runs on.

    It travels as it is, to machines where mjxgait is missing too: it needs nothing but Python's own
    library.
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
        pass  # no Linux
    kind = f"{platform.machine()} {model}"
    tag = hashlib.sha256(f"{kind} {' '.join(sorted(flags.split()))}".encode()).hexdigest()[:8]
    return {"versions": versions, "kind": kind, "tag": tag}


@functools.cache
def this() -> Machine:
    """This machine."""
    return Machine(**look())


def mismatch(where: str, there: Machine) -> str | None:
    """One sentence on what another machine has of another version than this one; None if nothing."""
    here = this().versions
    for name, version in here.items():
        if there.versions[name] != version:
            return (
                f"{where} has {name} {there.versions[name]}, this machine has {version}; "
                "install the same on both"
            )
    return None


def require_same(where: str, there: Machine) -> None:
    """Refuses a machine of other versions.

    Raises:
      UserError: names the first difference, and both.
    """
    if said := mismatch(where, there):
        raise UserError(said)
