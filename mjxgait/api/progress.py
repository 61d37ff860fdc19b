"""Progress of runs side by side, as plain lines."""

from typing import TYPE_CHECKING

from mjxgait.output import Output, duration

if TYPE_CHECKING:
    from mjxgait.distributed.jobs import Advanced


class Progress:
    """Progress of work of several kinds; a subclass adds its own."""

    def __init__(self, output: Output) -> None:
        self.output = output

    def examined(self, count: int, of: int) -> None:
        """Report on the examinations of the champions."""
        self.output.say(f"examined in C MuJoCo: {count} of {of}")


def pace(done: "Advanced", generations: int) -> str:
    """Return the speed, and the time that the generations ahead may take, in words."""
    left = generations * done.seconds / max(len(done.lines), 1)
    speed = done.steps / max(done.seconds, 1e-9) / 1e6
    return f"{speed:.2f} M steps/s, {duration(left)} left"
