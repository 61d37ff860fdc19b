"""Reason in words for a motion so far from a walk that most measures have no value."""

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.reference.measure import Recording
from mjxgait.reference.strides import stride_starts

LEFT = 0.05
"""Share of the certificate's minimum speed below which a creature has not left its place."""


def obstacle(whole: Recording, config: CertificateConfig) -> str | None:
    """Return the first reason that a recorded motion is no walk; None if it strides ahead."""
    fell = _fell(whole, config)
    if fell is not None:
        when = "in the first second, " if fell < 1 else ""
        return f"fell {when}after {fell:.1f} s"
    seconds = (len(whole.trunk_pos) - 1) * whole.time_step
    way = float(whole.trunk_pos[-1, 0] - whole.trunk_pos[0, 0])
    due = config.progress.speed * whole.dimensions.body_length * seconds
    if abs(way) < LEFT * due:
        return f"never left its place: {way:.2f} m in {seconds:.0f} s"
    if way < 0:
        return f"went backwards, {-way:.2f} m in {seconds:.0f} s"
    if len(stride_starts(whole.window(config.warmup))) < 2:
        return f"went {way:.2f} m without a stride: no foot leaves the floor and comes down again"
    return None


def _fell(whole: Recording, config: CertificateConfig) -> float | None:
    """Time in s until the trunk tips over or is too low or too high; None if it stays up."""
    low, high = config.upright.height
    height = whole.trunk_pos[:, 2] / whole.dimensions.stand_height
    up = (whole.trunk_up >= config.upright.min_up) & (height >= low) & (height <= high)
    return None if up.all() else float(np.argmin(up)) * whole.time_step
