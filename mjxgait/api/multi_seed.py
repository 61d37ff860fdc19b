"""Several runs of one creature side by side, from their folder to their picture."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from mjxgait.api.progress import Progress, pace
from mjxgait.experiments.multi_seed import bests, read_seeds
from mjxgait.files import replaced
from mjxgait.output import Output
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import command, open_run
from mjxgait.training.lock import locked

if TYPE_CHECKING:
    from mjxgait.distributed.jobs import Advanced

PICTURE = "zoo.png"


def evolve_seeds(
    parent: Path,
    output: Output,
    cluster: str | None = None,
    begin: Callable[[], object] = lambda: None,
) -> bool:
    """Evolve or continue the runs of a folder; show the results; return whether they ended.

    cluster: address of the cluster to use instead of this machine. begin: makes the folder of new
    runs; called after the last check.
    """
    from mjxgait.distributed.evolve import scheduler_at
    from mjxgait.distributed.rows import Rows
    from mjxgait.experiments.ancestors import first_genomes
    from mjxgait.training.ended import examine
    from mjxgait.training.loop import interruptible
    from mjxgait.training.stages import prepare_devices

    prepare_devices(1 if cluster else None)
    began, screen = time.perf_counter(), _Screen(output)
    with interruptible() as interrupted, scheduler_at(cluster, output.progress) as scheduler:
        begin()
        with locked(parent):
            stopped, seeds = interrupted.is_set, read_seeds(parent)
            folders = seeds.folders(parent)
            creature, config = open_run(folders[0])
            again = command("train", "--resume", parent, run=folders[0])
            kept, together = config.keep_every, seeds.together
            first = first_genomes(folders, creature, output.say)
            rows = Rows(
                creature,
                folders,
                screen.evolved,
                planted=first,
                keep_every=kept,
                together=together,
            )
            ended = first is not None and rows.to_the_end(scheduler, stopped) is not None
            ended = ended and examine(parent, folders, again, screen.examined, stopped)
    if not ended:
        output.console.print(f"interrupted; go on with: {again}")
        return False
    _leave(parent, creature.name, folders, output)
    output.say(
        f"{time.perf_counter() - began:.0f} s; each is a run: "
        f"{command('inspect', parent, run=folders[0])}"
    )
    return True


def _leave(parent: Path, name: str, folders: list[Path], output: Output) -> None:
    # Matplotlib takes half a second to import.
    from mjxgait.experiments.seeds_compared import draw_seeds, found_in, size, table
    from mjxgait.rendering.curves import figure

    found = found_in(folders)
    output.console.print(table(found))
    with disk_errors(parent / PICTURE), figure(size(found)) as drawing:
        draw_seeds(drawing, name, found)
        with replaced(parent / PICTURE) as beside:
            drawing.savefig(beside)
    count = sum(one.certified for one in found)
    output.console.print(f"{count} of {len(found)} are certified: {parent / PICTURE}")
    tried = [one for one in found if one.margin is not None]
    if tried and not count:
        nearest = max(tried, key=lambda one: one.margin or 0.0)
        output.console.print(" ".join((f"{nearest.folder.name}:", *nearest.advice)))


class _Screen(Progress):
    """Progress of all runs at once."""

    def evolved(self, generation: int, last: int, done: "Advanced | None") -> None:
        if done is None:
            self.output.say("compiling")
            return
        best = bests(done.lines[-1]) if done.lines else ""
        self.output.say(
            f"generation {generation} of {last}, best fitness of each: {best}; "
            f"{pace(done.steps, done.seconds, len(done.lines), last - generation)}"
        )
