"""Connection to the cluster that the user names, and to no other."""

import contextlib
import dataclasses
import functools
import logging
import os
import socket
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from mjxgait.distributed.scheduler import Scheduler
from mjxgait.errors import UserError
from mjxgait.extras import install_command


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


LOOPBACK = ("127.0.0.1", "localhost")
AUTO = "auto"
NEVER_LEAVE_LOOPBACK = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}
"""Read when Ray is imported. Without it Ray replaces 127.0.0.1 by this machine's outer address."""
QUIET = {"RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0", "RAY_DEDUP_LOGS_SKIP_REGEX": "."}
"""Read when Ray is imported. Without it Ray announces changes of a later version and prints a
paragraph for every lost worker.
"""
PATIENCE = 5.0
"""Seconds for the head to answer."""


@contextlib.contextmanager
def connected(
    address: str,
    tell: Callable[[str], object],
    watch: Callable[[Scheduler], object] = lambda scheduler: None,
) -> Iterator[Scheduler]:
    """Connect to a Ray cluster and yield its scheduler; its work for us ends with the block.
    Args:
      address: HOST:PORT, or auto for the cluster that this machine belongs to.
      tell, watch: see `Scheduler`.

    Raises:
      UserError: Ray is not installed, no head answers, or a machine has other versions than this.
    """
    place = _place(address)
    host, _, port = place.rpartition(":")
    _must_answer(address, host, port)
    if host in LOOPBACK:
        os.environ.update(NEVER_LEAVE_LOOPBACK)
    ray = _ray()
    try:
        ray.init(address=place, log_to_driver=False, logging_level=logging.CRITICAL)
    except (ConnectionError, RuntimeError, ValueError) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise UserError(
            f"--cluster {address}: {reason} (is this machine a part of it, by `ray start`? "
            "Has it the token, if there is one?)"
        ) from None
    from mjxgait.distributed.ray_backend import RayBackend

    try:
        yield Scheduler(RayBackend(tell), tell, watch)
    finally:
        ray.shutdown()


def _ray() -> ModuleType:
    os.environ.update({name: os.environ.get(name, value) for name, value in QUIET.items()})
    try:
        import ray
    except ImportError:
        raise UserError(
            f"--cluster needs Ray: {install_command('cluster')}, on every machine of the cluster"
        ) from None
    # `RayBackend` reports lost machines; Ray's threads need not.
    logging.getLogger("ray").setLevel(logging.CRITICAL)
    return ray


def _place(address: str) -> str:
    """Return HOST:PORT of the cluster; look it up if the address is auto."""
    if address == AUTO:
        running = Path(os.environ.get("RAY_TMPDIR", "/tmp")) / "ray" / "ray_current_cluster"
        address = os.environ.get("RAY_ADDRESS") or (
            running.read_text().strip() if running.is_file() else ""
        )
        if not address:
            raise UserError(
                "--cluster auto: this machine is no part of a cluster; start one with "
                "`ray start --head --node-ip-address 127.0.0.1 --port 6379` (docs/guide/cluster.md)"
            )
    host, colon, port = address.rpartition(":")
    if not (host and colon and port.isdigit()):
        raise UserError(f"--cluster {address}: give auto or HOST:PORT, such as 10.0.0.5:6379")
    return address


def _must_answer(address: str, host: str, port: str) -> None:
    """Fail early if the head does not answer; Ray itself would try for minutes."""
    try:
        socket.create_connection((host, int(port)), PATIENCE).close()
    except (OSError, OverflowError, UnicodeError) as error:
        raise UserError(
            f"--cluster {address}: no answer from {host}:{port} ({error}); is the head running, "
            "and the port open for this machine?"
        ) from None
