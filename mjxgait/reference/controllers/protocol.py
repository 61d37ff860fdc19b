"""What the examiner asks of a controller: the contract that all twins share.

`S` simulations, `J` actuated joints.
"""

from collections.abc import Mapping
from typing import Literal, Protocol

import numpy as np

Command = Literal["pose", "torque"]
Memory = Mapping[str, np.ndarray]
"""What a controller keeps from one moment to the next: arrays [S, ...] by name."""


class Twin(Protocol):
    """A champion's controller as the examiner moves it. It holds constants only."""

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the senses that `act` reads."""
        ...

    @property
    def command(self) -> Command:
        """Whether `act` sends joint angles in rad or torques in N·m."""
        ...

    @property
    def every(self) -> int:
        """Control steps from one command to the next; in between the last one holds."""
        ...

    def init(self, count: int) -> Memory:
        """The memory at the start of `count` simulations."""
        ...

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """The command [S, J] of this moment, and the memory of the next."""
        ...

    def phase(self, memory: Memory) -> np.ndarray:
        """Where [S] in its own cycle, in [0, 1); NaN for a controller without one."""
        ...
