"""Islands that exchange their best, in this process: the work of a cluster on one worker.

Nothing is simulated here; `test_blocks` simulates a worker's part.
"""

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers import STOOL, made_up_evaluate, said_by, small_config
from rich.console import Console

import mjxgait
from mjxgait.champion import read_champion
from mjxgait.creature import Creature
from mjxgait.distributed import islands
from mjxgait.distributed.jobs import Programs
from mjxgait.distributed.scheduler import LocalBackend, Scheduler
from mjxgait.inspect.sections import island_facts
from mjxgait.training import stages
from mjxgait.training.folder import create_run
from mjxgait.training.logs import Numbered, read_metrics, read_records
from mjxgait.training.screen import Screen
from mjxgait.training.stored import stored_generations

PROGRAMS = Programs()


@pytest.fixture(scope="module", autouse=True)
def nothing_is_simulated() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "evaluate", made_up_evaluate)
        yield


def config(**of_islands: Any):
    given = {"count": 3, "every": 2, "migrants": 1} | of_islands
    return small_config(
        evolution={"generations": 5, "islands": given}, examination={"candidates": 0}
    )


class Interrupted(Scheduler):
    """A scheduler that stops after `left` jobs."""

    left = 4

    def next(self, stopped: Callable[[], bool]) -> Any:
        self.left -= 1
        return super().next(lambda: self.left < 0)


def run(
    folder: Path, stool: Creature, settings: Any, kind: type[Scheduler] = Scheduler, resume=False
) -> bool:
    if not resume:
        create_run(folder, stool, settings)
    screen = Screen(Console(file=io.StringIO()))
    return islands.train(folder, stool, settings, screen, kind(LocalBackend(PROGRAMS)), resume)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, stool: Creature) -> Path:
    folder = tmp_path_factory.mktemp("islands") / "run"
    assert run(folder, stool, config())
    return folder


def exchanges(folder: Path) -> list[dict]:
    return read_records(folder / "migrations.jsonl", Numbered)


def without_times(path: Path) -> list[dict]:
    timed, lines = ("wall_s", "steps_per_second"), read_records(path, Numbered)
    return [{k: v for k, v in line.items() if k not in timed} for line in lines]


def test_the_run_folder_contains_each_islands_folder(finished: Path, stool: Creature):
    lines = read_metrics(finished / "metrics.jsonl")
    assert [line["generation"] for line in lines] == list(range(6))
    each = [read_metrics(finished / "islands" / str(i) / "metrics.jsonl") for i in range(3)]
    for line, *own in zip(lines, *each, strict=True):
        assert line["best"] == max(one["best"] for one in own)
        assert line["evaluations"] == sum(one["evaluations"] for one in own)
    champion = read_champion(finished / "champion.json", stool)
    assert champion.fitness == pytest.approx(lines[-1]["best"])
    for i in range(3):
        assert stored_generations(finished / "islands" / str(i))[-1] == 5


def test_islands_begin_with_different_populations_on_the_same_starts(finished: Path):
    first = [read_metrics(finished / f"islands/{i}/metrics.jsonl")[0]["best"] for i in range(3)]
    assert len(set(first)) == 3


def test_the_first_island_begins_like_a_run_without_islands(
    finished: Path, tmp_path: Path, stool: Creature
):
    assert run(tmp_path / "one", stool, config(count=1))
    one = without_times(tmp_path / "one/islands/0/metrics.jsonl")
    assert without_times(finished / "islands/0/metrics.jsonl")[:3] == one[:3]
    assert not exchanges(tmp_path / "one")


def test_each_exchange_is_logged(finished: Path):
    told = exchanges(finished)
    assert [(line["generation"], line["from"], line["to"]) for line in told] == [
        (generation, (to - 1) % 3, to) for generation in (2, 4) for to in range(3)
    ]
    best = [line["best"] for line in read_metrics(finished / "islands/0/metrics.jsonl")]
    assert told[1]["fitness"] == [pytest.approx(best[2])]


def test_migrants_are_present_in_the_next_generation(finished: Path):
    sent = next(line for line in exchanges(finished) if line["to"] == 1)
    after = read_metrics(finished / "islands/1/metrics.jsonl")[3]
    assert after["best"] >= sent["fitness"][0]


def test_a_run_stopped_between_exchanges_reaches_the_same_champion(
    finished: Path, tmp_path: Path, stool: Creature
):
    folder = tmp_path / "stopped"
    assert not run(folder, stool, config(), Interrupted)
    assert stored_generations(folder / "islands/0")[-1] == 2
    assert run(folder, stool, config(), resume=True)
    for name in ("metrics.jsonl", "migrations.jsonl", "islands/2/metrics.jsonl"):
        assert without_times(folder / name) == without_times(finished / name), name
    assert (folder / "champion.json").read_text() == (finished / "champion.json").read_text()


def test_without_exchanges_islands_are_independent_runs(
    finished: Path, tmp_path: Path, stool: Creature
):
    folder = tmp_path / "apart"
    assert run(folder, stool, config(every=0))
    assert not exchanges(folder)
    together = without_times(finished / "islands/1/metrics.jsonl")
    apart = without_times(folder / "islands/1/metrics.jsonl")
    assert apart[:3] == together[:3]
    assert apart[3:] != together[3:]


def test_inspect_lists_each_island_and_its_migrants(finished: Path, capsys: pytest.CaptureFixture):
    said = said_by(capsys, "inspect", finished, code=0)
    assert "how many migrants came to each" in said
    rows = island_facts(finished, 5)
    assert [row["arrived"] for row in rows] == [2, 2, 2]
    assert [row["from"] for row in rows] == [[2], [0], [1]]
    told, own = (
        exchanges(finished),
        read_metrics(finished / "islands/1/metrics.jsonl"),
    )
    better = [
        line["fitness"][0] > own[line["generation"]]["best"] for line in told if line["to"] == 1
    ]
    assert rows[1]["ahead"] == sum(better)
    assert island_facts(finished, 2)[0]["arrived"] == 0


def test_islands_run_from_python_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    ran = []
    monkeypatch.setattr(
        islands, "train", lambda folder, creature, config, *others: ran.append(config)
    )
    given = {"evolution": {"islands": {"count": 3}}}
    mjxgait.train(STOOL, out=tmp_path / "run", settings=given, quiet=True)
    assert [config.evolution.islands.count for config in ran] == [3]


def test_a_checkpoint_of_islands_cannot_be_chosen(finished: Path, capsys: pytest.CaptureFixture):
    said = said_by(capsys, "train", "--resume", finished, "--generation", "2", code=2)
    assert "latest checkpoints, not --generation" in said
