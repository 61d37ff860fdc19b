"""Ray backend: one worker per core of every machine with the same versions as this one.

Each worker is an actor that stays on its machine. Ray repeats nothing: losses are reported to the
scheduler, and a new worker starts if the machine still lives.
"""

import dataclasses
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import ray
from ray import cloudpickle
from ray.exceptions import RayActorError, RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy
from typing_extensions import override

from mjxgait.distributed import connect
from mjxgait.distributed.connect import Machine
from mjxgait.distributed.jobs import Job, Recipe
from mjxgait.distributed.scheduler import Backend, Report, Worker
from mjxgait.distributed.worker import RemoteWorker

EVERY = 1.0
"""Seconds between two checks for new machines."""
HOPELESS = 5
"""Workers lost in a row before they begin, after which a machine gets no new ones."""


@dataclasses.dataclass(frozen=True)
class Node:
    """A machine of the cluster.

    name: its address, with a number if the address occurred before.
    """

    id: str
    name: str
    cores: int


class RayBackend(Backend):
    """Implementation of `Backend`. tell: called with messages for the user.

    Raises:
      UserError: a machine that is there from the beginning has other versions than this one.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        # `look` must run where mjxgait may be missing.
        cloudpickle.register_pickle_by_value(sys.modules[connect.__name__])
        self._looking: dict[ray.ObjectRef, Node] = {}
        self._coming: dict[ray.ObjectRef, Worker] = {}
        self._working: dict[ray.ObjectRef, Worker] = {}
        self._actors: dict[Worker, tuple[ray.actor.ActorHandle, Node]] = {}
        self._nodes: dict[str, Node] = {}
        self._met: Counter[str] = Counter()
        self._stillborn: Counter[str] = Counter()
        self._tags: dict[str, str] = {}
        self._kinds: dict[str, str] = {}
        self._recipes: dict[str, ray.ObjectRef] = {}
        self._count, self._looked = 0, 0.0
        self.seconds: dict[str, float] = {}
        """Seconds that the workers of each machine have worked."""
        self._look_for_nodes()
        for ref in list(self._looking):
            self._meet(ref, refuse=True)

    @override
    def arrivals(self) -> list[Worker]:
        if time.monotonic() - self._looked > EVERY:
            self._look_for_nodes()
        for ref in _ready(self._looking):
            self._meet(ref)
        return [worker for ref in _ready(self._coming) if (worker := self._begun(ref))]

    def start(self, worker: Worker, recipe: Recipe, job: Job) -> None:
        """A recipe is sent to each machine once."""
        if recipe.digest not in self._recipes:
            self._recipes[recipe.digest] = ray.put(recipe)
        actor, _ = self._actors[worker]
        self._working[actor.do.remote(self._recipes[recipe.digest], job)] = worker

    @override
    def wait(self, seconds: float) -> list[Report]:
        waited = [*self._working, *self._coming, *self._looking]
        if waited:
            ray.wait(waited, num_returns=1, timeout=seconds)
        else:
            time.sleep(seconds)
        return [self._report(ref) for ref in _ready(self._working)]

    def _report(self, ref: ray.ObjectRef) -> Report:
        worker = self._working.pop(ref)
        try:
            value, seconds = ray.get(ref)
        except RayActorError as error:
            self._replace(worker)
            return Report(worker, lost=_why(error))
        except RayTaskError as error:
            cause = error.cause
            if isinstance(cause, OSError):  # the machine's fault: full disk, too many files
                ray.kill(self._actors.pop(worker)[0])
                return Report(worker, lost=str(cause))
            return Report(worker, error=cause if isinstance(cause, Exception) else error)
        except RayError as error:  # a result that was lost with its machine
            self._replace(worker)
            return Report(worker, lost=_why(error))
        self.seconds[worker.node] = self.seconds.get(worker.node, 0.0) + seconds
        return Report(worker, value)

    def _look_for_nodes(self) -> None:
        self._looked = time.monotonic()
        for row in ray.nodes():
            cores = int(row["Resources"].get("CPU", 0))
            if row["NodeID"] in self._nodes:
                if not row["Alive"]:
                    self._tell(f"{self._nodes.pop(row['NodeID']).name} has left")
            elif row["Alive"] and cores:
                self._look_at(row, cores)

    def _look_at(self, row: dict[str, Any], cores: int) -> None:
        address = row["NodeManagerAddress"]
        self._met[address] += 1
        name = address if self._met[address] == 1 else f"{address} ({self._met[address]})"
        node = self._nodes[row["NodeID"]] = Node(row["NodeID"], name, cores)
        ask = ray.remote(connect.look).options(num_cpus=0, max_retries=0, **_on(node))
        self._looking[ask.remote()] = node

    def _meet(self, ref: ray.ObjectRef, refuse: bool = False) -> None:
        """Receive a machine's description; ignore it, or refuse it, if versions differ."""
        node = self._looking.pop(ref)
        try:
            found = Machine(**ray.get(ref))
        except RayError as error:  # it may have left already
            self._tell(f"{node.name} does not say what it has ({_why(error)}); it is left alone")
            return
        if refuse:
            connect.require_same(node.name, found)
        if said := connect.mismatch(node.name, found):
            self._tell(f"{said}; it is left alone")
        else:
            self._welcome(node, found)

    def _welcome(self, node: Node, found: Machine) -> None:
        self._tell(f"{node.name}: {node.cores} core{'s'[: node.cores > 1]}, {found.kind}")
        self._tags[node.id] = found.tag
        if self._kinds and found.tag not in self._kinds:
            self._tell(
                f"{node.name} is of another kind than {next(iter(self._kinds.values()))}: the "
                "last bits then depend on which machine computes what"
            )
        self._kinds.setdefault(found.tag, node.name)
        for _ in range(node.cores):
            self._hire(node)

    def _hire(self, node: Node) -> None:
        actor = (
            ray.remote(RemoteWorker)
            .options(num_cpus=1, max_restarts=0, max_task_retries=0, **_on(node))
            .remote(self._tags[node.id])
        )
        worker, self._count = Worker(self._count, node.name), self._count + 1
        self._actors[worker] = actor, node
        self._coming[actor.ready.remote()] = worker

    def _begun(self, ref: ray.ObjectRef) -> Worker | None:
        """Return the worker once it can work.

        A worker that cannot is dropped; one that was killed meanwhile is replaced.
        """
        worker = self._coming.pop(ref)
        try:
            ray.get(ref)
        except RayTaskError as error:
            ray.kill(self._actors.pop(worker)[0])
            self._tell(f"{worker.node}: a worker cannot begin ({error.cause}); it is left alone")
            return None
        except RayError:
            _, node = self._actors[worker]
            self._stillborn[node.id] += 1
            if node.id in self._nodes and self._stillborn[node.id] < HOPELESS:
                self._replace(worker)
            else:
                del self._actors[worker]
            return None
        self._stillborn[self._actors[worker][1].id] = 0
        return worker

    def _replace(self, worker: Worker) -> None:
        actor, node = self._actors.pop(worker)
        ray.kill(actor)  # it may be alive, but out of reach
        self._hire(node)


def _on(node: Node) -> dict[str, object]:
    return {"scheduling_strategy": NodeAffinitySchedulingStrategy(node.id, soft=False)}


def _ready(refs: Mapping[ray.ObjectRef, object]) -> list[ray.ObjectRef]:
    if not refs:
        return []
    done, _ = ray.wait(list(refs), num_returns=len(refs), timeout=0)
    return list(done)


def _why(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0].partition(". ")[0][:120] if lines else type(error).__name__
