"""Backend of this process: one worker, which works during `wait`."""

from mjxgait.distributed.jobs import Job
from mjxgait.distributed.programs import Programs
from mjxgait.distributed.recipe import Recipe
from mjxgait.distributed.scheduler import Report, Worker


class Here:
    """See `Hands`. programs: those that this process has already compiled."""

    def __init__(self, programs: Programs | None = None) -> None:
        self._programs = programs or Programs()
        self._coming = [Worker(0, "here")]
        self._work: tuple[Worker, Recipe, Job] | None = None

    def arrivals(self) -> list[Worker]:
        """See `Hands`."""
        coming, self._coming = self._coming, []
        return coming

    def start(self, worker: Worker, recipe: Recipe, job: Job) -> None:
        """See `Hands`."""
        self._work = worker, recipe, job

    def wait(self, seconds: float) -> list[Report]:
        """See `Hands`. An error of the job is raised unchanged."""
        if self._work is None:
            return []
        (worker, recipe, job), self._work = self._work, None
        return [Report(worker, job.do(self._programs, recipe))]
