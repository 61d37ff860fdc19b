"""Who of many simulations can no longer succeed, so that the rest of them may be left out."""

from collections.abc import Callable

import numpy as np


class Watch:
    """Kept by all threads that step the simulations.

    lost: [S] who can no longer do what is asked. over: whether that decides it.
    """

    def __init__(self, count: int, hopeless: Callable[[np.ndarray], bool]) -> None:
        """hopeless: whether it is decided once these [S] are lost; more are never better."""
        self.lost, self.over = np.zeros(count, bool), False
        self._hopeless = hopeless

    def tell(self, rows: np.ndarray, lost: np.ndarray) -> bool:
        """Hears which of some rows are lost by now; whether all may end."""
        self.lost[rows] |= lost
        self.over = self.over or self._hopeless(self.lost)
        return self.over
