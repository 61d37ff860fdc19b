"""The span after which a motion is most like it was: a loop of a body without a cycle in its brain.

Letters: `T` frames, `J` joints.
"""

import numpy as np

SETTLED = 2.0
"""Time before the first frame of a loop in s, if the motion is long enough."""
MIN_SECONDS, MAX_SECONDS = 1.0, 5.0
"""Shortest and longest loop in s."""
EACH = 0.02
"""Time between frames that are compared in s."""
LOOKAHEAD = 0.06
"""Weight of a speed against an angle in s: two poses are alike if they go on alike."""


def most_alike(
    angles: np.ndarray, attitude: np.ndarray, time_step: float
) -> tuple[int, int] | None:
    """Return the two frames, a loop apart, with the most similar poses; None: too short a motion.

    angles: [T, J] rad. attitude: [T, 9] the trunk's rotation. time_step: s.
    """
    every = max(round(EACH / time_step), 1)
    pose = np.concatenate([angles, attitude], axis=1)
    state = np.concatenate([pose, LOOKAHEAD * np.gradient(pose, time_step, axis=0)], axis=1)
    state = state[::every]
    step = every * time_step
    settled = min(round(SETTLED / step), max(len(state) - round(2 * MAX_SECONDS / step), 0))
    state = state[settled:]
    if len(state) <= round(MIN_SECONDS / step) + 1:
        return None
    squares = (state**2).sum(1)
    apart = squares[:, None] + squares - 2 * state @ state.T
    gap = np.arange(len(state)) - np.arange(len(state))[:, None]
    apart[(gap * step < MIN_SECONDS) | (gap * step > MAX_SECONDS)] = np.inf
    first, last = divmod(int(apart.argmin()), len(state))
    return every * (settled + first), every * (settled + last)
