"""Reference controllers: one per kind, in NumPy and float64, for many simulations at once.

Letters: `S` simulations, `J` actuated joints.
"""

from collections.abc import Mapping
from typing import Literal, Protocol

import numpy as np

from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.kinds import controller_kind

Command = Literal["pose", "torque"]
Memory = Mapping[str, np.ndarray]
"""State that a controller keeps between control steps: arrays [S, ...] by name."""


class ReferenceController(Protocol):
    """Reference controller of a champion. It holds constants only."""

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the observations that `act` reads."""
        ...

    @property
    def command(self) -> Command:
        """Kind of command that `act` sends: joint angles in rad or torques in N·m."""
        ...

    @property
    def every(self) -> int:
        """Control steps between commands; in between the last command holds."""
        ...

    def init(self, count: int) -> Memory:
        """Return the memory at the start of `count` simulations."""
        ...

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """Return the command [S, J] of this step and the memory for the next."""
        ...

    def phase(self, memory: Memory) -> np.ndarray:
        """Return the phase [S] of its own cycle, in [0, 1); NaN for a controller without one."""
        ...


def opponent_of(creature: Creature, champion: Champion, step: float) -> ReferenceController:
    """Return the controller in NumPy of the opponent that a champion meets. step: s."""
    made: ReferenceController = controller_kind(champion.controller).part("opponent")(
        creature, champion, step
    )
    return made


def reference_of(creature: Creature, champion: Champion, step: float) -> ReferenceController:
    """Return the champion's controller in NumPy. step: s.

    Raises:
      UserError: the champion is not finite, or code of the user's own that was not named.
    """
    champion.check_finite(creature)
    made: ReferenceController = controller_kind(champion.controller).part("reference")(
        creature, champion, step
    )
    return made
