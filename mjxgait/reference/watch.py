"""Early stop of many simulations once those that cannot succeed decide the result."""

from collections.abc import Callable

import numpy as np


class Watch:
    """Lost simulations, shared by all threads that step them.

    lost: [S] whether one can no longer succeed. over: whether the result is decided.
    """

    def __init__(self, count: int, hopeless: Callable[[np.ndarray], bool]) -> None:
        """hopeless: whether the losses [S] decide the result; more losses never improve it."""
        self.lost, self.over = np.zeros(count, bool), False
        self._hopeless = hopeless

    def tell(self, rows: np.ndarray, lost: np.ndarray) -> bool:
        """Record the lost simulations among some rows; return whether all may end."""
        self.lost[rows] |= lost
        self.over = self.over or self._hopeless(self.lost)
        return self.over
