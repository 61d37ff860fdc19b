"""A real Ray cluster of simulated machines with one core each, some of which are lost."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers import STOOL
from simulated import workers

from mjxgait.config.tables import dump_toml
from mjxgait.creature import Creature
from mjxgait.distributed.connect import connected
from mjxgait.errors import INTERRUPTED, UserError
from mjxgait.experiments.ablation.plan import (
    Plan,
    Study,
    VariantTable,
    make_plan,
)
from mjxgait.experiments.ablation.rows import run_study
from mjxgait.training.logs import read_metrics

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason='needs Ray: pip install "mjxgait[cluster]"'
)

SMALL = {
    "evolution": {"population": 6},
    "rollout": {"seconds": 0.4, "starts": 2, "promote": 1.0, "lanes": 4},
}
STUDY = Study(
    question="Does plain PD do as well?",
    env=str(STOOL),
    seeds=2,
    generations=4,
    rows=1,
    base=SMALL,
    variant=(
        VariantTable("stable PD"),
        VariantTable("slow", {"evolution": {"mutation_rate": 0.1}}),
    ),
)


@pytest.fixture(scope="module")
def simulated() -> Iterator[Any]:
    """One machine, the head."""
    from simulated import machines

    with machines(1) as made:
        yield made


@pytest.fixture(scope="module")
def plan(stool: Creature) -> Plan:
    return make_plan(STUDY, stool, "test")


def results(folder: Path) -> dict[str, str]:
    """The logs and champions that a study leaves, by path."""
    paths = [*folder.glob("groups/*/metrics.jsonl"), *folder.glob("champions/*.json")]
    return {str(path.relative_to(folder)): path.read_text() for path in paths}


def study(
    folder: Path, stool: Creature, plan: Plan, address: str, at_first: Callable[[], Any] = bool
) -> list[str]:
    """Run a study and return the cluster's messages. at_first: called at the first result."""
    said: list[str] = []
    todo = [at_first]

    def tell(group: int, count: int, news: dict[str, Any]) -> None:
        if "generation" in news and todo:
            todo.pop()()

    with connected(address, said.append) as scheduler:
        assert run_study(folder, stool, plan, tell, scheduler)
    return said


@pytest.fixture(scope="module")
def alone(
    simulated: Any, stool: Creature, plan: Plan, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, str]:
    """The results of the study on one machine."""
    folder = tmp_path_factory.mktemp("study") / "alone"
    study(folder, stool, plan, simulated.address)
    found = results(folder)
    assert len(found) == 4 + 4
    return found


def wait_until(true: Callable[[], Any], seconds: float = 240) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_machines_that_leave_and_join_do_not_change_a_bit_of_the_results(
    simulated: Any, alone: dict[str, str], stool: Creature, plan: Plan, tmp_path: Path
):
    """One machine loses power, the other its worker, and a third joins."""
    second = simulated.add()

    def happen() -> None:
        simulated.kill(second)
        workers()[0].kill()
        third.append(simulated.add())

    third: list[Any] = []
    said = study(tmp_path / "two", stool, plan, simulated.address, happen)
    simulated.kill(third[0])
    assert results(tmp_path / "two") == alone
    assert any("127.0.0.1 (2): 1 core" in line for line in said)
    assert any("a worker is lost" in line for line in said)


def test_a_study_killed_and_resumed_ends_the_same_and_leaves_no_workers(
    simulated: Any, alone: dict[str, str], stool: Creature, plan: Plan, tmp_path: Path
):
    """Ctrl-C, then a kill of the command, then the rest on two machines instead of one."""
    folder, file = tmp_path / "study", tmp_path / "study.toml"
    file.write_text(dump_toml(STUDY))
    mjxgait = [sys.executable, "-m", "mjxgait", "ablate"]
    log = folder / "groups/0/metrics.jsonl"
    first = subprocess.Popen(
        [*mjxgait, str(file), "--out", str(folder), "--cluster", simulated.address],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    wait_until(lambda: log.exists() and read_metrics(log))
    first.send_signal(signal.SIGINT)
    said = first.communicate(timeout=240)[0]
    assert first.returncode == INTERRUPTED, said
    assert f"go on with: mjxgait ablate --resume {folder}" in said
    wait_until(lambda: not workers())
    second = subprocess.Popen(
        [*mjxgait, "--resume", str(folder), "--cluster", simulated.address],
        stdout=subprocess.DEVNULL,
    )
    wait_until(workers)
    os.kill(second.pid, signal.SIGKILL)
    second.wait()
    wait_until(lambda: not workers())
    joined = simulated.add()
    study(folder, stool, plan, simulated.address)
    simulated.kill(joined)
    assert results(folder) == alone


def test_a_machine_with_another_version_is_named_and_not_used(simulated: Any, tmp_path: Path):
    (tmp_path / "jaxlib-0.0.1.dist-info").mkdir()
    (tmp_path / "jaxlib-0.0.1.dist-info/METADATA").write_text("Name: jaxlib\nVersion: 0.0.1\n")
    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    said: list[str] = []
    end = time.monotonic() + 240
    with connected(simulated.address, said.append) as scheduler:
        odd = simulated.add(env_vars={"PYTHONPATH": path})
        scheduler.next(lambda: any("jaxlib" in line for line in said) or time.monotonic() > end)
    assert any("has jaxlib 0.0.1, this machine has" in line for line in said)
    with pytest.raises(UserError, match=r"has jaxlib 0.0.1, this machine has .*same on both"):
        connected(simulated.address, said.append).__enter__()
    simulated.kill(odd)
