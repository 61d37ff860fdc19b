"""`mjxgait train --runs`: several runs side by side."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from mjxgait.errors import INTERRUPTED
from mjxgait.experiments.multi_seed import read_seeds
from mjxgait.files import replaced
from mjxgait.training.folder import Line, command, open_run
from mjxgait.training.stored import disk_errors, locked

if TYPE_CHECKING:
    from mjxgait.distributed.jobs import Advanced

PICTURE = "zoo.png"


def evolve_zoo(
    zoo: Path, cluster: str | None = None, begin: Callable[[], object] = lambda: None
) -> int:
    """Evolve or continue the runs of a folder, and show the results; return the exit code.

    cluster: address of the cluster to use instead of this machine. begin: makes the folder of new
    runs; called after the last check.
    """
    from mjxgait.distributed.evolve import scheduler_at
    from mjxgait.distributed.rows import Rows
    from mjxgait.training.ended import examine
    from mjxgait.training.loop import interruptible
    from mjxgait.training.stages import prepare_devices

    prepare_devices(1 if cluster else None)
    console, began = Console(highlight=False, soft_wrap=True, markup=False), time.perf_counter()
    screen = _Screen(console)
    with interruptible() as interrupted, scheduler_at(cluster, console) as scheduler:
        begin()
        with locked(zoo):
            told, seeds = interrupted.is_set, read_seeds(zoo)
            folders = seeds.folders(zoo)
            creature, config = open_run(folders[0])
            again = command("train", "--resume", zoo, run=folders[0])
            kept, together = config.keep_every, seeds.together
            rows = Rows(creature, folders, screen.evolved, keep_every=kept, together=together)
            ended = rows.to_the_end(scheduler, told) is not None
            ended = ended and examine(zoo, folders, again, screen.examined, told)
    if not ended:
        console.print(f"interrupted; go on with: {again}")
        return INTERRUPTED
    _leave(zoo, creature.name, folders, console)
    console.print(
        f"{time.perf_counter() - began:.0f} s; each is a run: "
        f"{command('inspect', zoo, run=folders[0])}"
    )
    return 0


def _leave(zoo: Path, name: str, folders: list[Path], console: Console) -> None:
    from mjxgait.experiments.multi_seed import draw_zoo, found_in, size, table
    from mjxgait.rendering.curves import figure

    found = found_in(folders)
    console.print(table(found))
    with disk_errors(zoo / PICTURE), figure(size(found)) as drawing:
        draw_zoo(drawing, name, found)
        with replaced(zoo / PICTURE) as beside:
            drawing.savefig(beside)
    count = sum(one.certified for one in found)
    console.print(f"{count} of {len(found)} are certified: {zoo / PICTURE}")


class _Screen:
    """Progress as plain lines."""

    def __init__(self, console: Console) -> None:
        self.console = console

    def evolved(self, generation: int, last: int, done: "Advanced | None") -> None:
        if done is None:
            self.console.print("compiling")
            return
        left = (last - generation) * done.seconds / max(len(done.lines), 1)
        best = " ".join("-" if b is None else f"{b:.3g}" for b in _best(done.lines))
        self.console.print(
            f"generation {generation} of {last}, best fitness of each: {best}; "
            f"{done.steps / done.seconds / 1e6:.2f} M steps/s, {left:.0f} s left"
        )

    def examined(self, count: int, of: int) -> None:
        self.console.print(f"examined in C MuJoCo: {count} of {of}")


def _best(lines: Sequence[Sequence[Line]]) -> list[float | None]:
    return [line["best"] for line in lines[-1]] if lines else []
