"""Progress of runs side by side, as plain lines."""

from mjxgait.output import Output, duration


class Progress:
    """Progress of work of several kinds; a subclass adds its own."""

    def __init__(self, output: Output) -> None:
        self.output = output

    def examined(self, count: int, of: int) -> None:
        """Report on the examinations of the champions."""
        self.output.say(f"examined in C MuJoCo: {count} of {of}")


def pace(steps: int, seconds: float, done: int, left: int) -> str:
    """Return the speed, and the time that the generations ahead may take, in words.

    steps: simulated in these seconds and `done` generations. left: generations ahead.
    """
    rest = left * seconds / max(done, 1)
    return f"{steps / max(seconds, 1e-9) / 1e6:.2f} M steps/s, {duration(rest)} left"
