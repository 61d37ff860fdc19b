"""A cluster of simulated machines, all on 127.0.0.1."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil

os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"  # else Ray takes the external address
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

HERE = "127.0.0.1"
HASTY = {"health_check_period_ms": 1000, "health_check_failure_threshold": 8}
"""By default Ray gives up a silent machine only after 20 s."""


class Machines:
    """Machines with a number of cores each; the first is the head."""

    def __init__(self) -> None:
        from ray.cluster_utils import Cluster

        own = str(Path(__file__).parents[2])  # as pytest finds the package
        os.environ["PYTHONPATH"] = os.pathsep.join([own, os.environ.get("PYTHONPATH", "")])
        self.cluster = Cluster(
            initialize_head=True,
            head_node_args={
                "num_cpus": 1,
                "node_ip_address": HERE,
                "include_dashboard": False,
                "_system_config": HASTY,
                "object_store_memory": 80 * 2**20,
            },
        )
        self.address: str = self.cluster.address

    def add(self, cores: int = 1, **others: Any) -> Any:
        return self.cluster.add_node(
            num_cpus=cores, node_ip_address=HERE, object_store_memory=80 * 2**20, **others
        )

    def kill(self, node: Any) -> None:
        """Remove a machine without notice, as in a power loss."""
        self.cluster.remove_node(node, allow_graceful=False)


def workers() -> list[psutil.Process]:
    """The mjxgait workers on the machines that this process has started."""
    found = []
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            if (process.cmdline() or [""])[0].startswith("ray::RemoteWorker"):
                found.append(process)
    return found


@contextlib.contextmanager
def machines(count: int) -> Iterator[Machines]:
    made = Machines()
    try:
        for _ in range(count - 1):
            made.add()
        yield made
    finally:
        made.cluster.shutdown()


if __name__ == "__main__":
    with machines(int(sys.argv[1])) as started:
        print(started.address, flush=True)
        sys.stdin.read()
