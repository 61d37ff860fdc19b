"""Role of each joint in a leg, and the range that it gets.

`J` active joints.
"""

import numpy as np

from mjxgait.errors import listed
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.notes import Notes
from mjxgait.importer.soles import Stance, lowest_part

RANGES = {
    "stride": 40.0,
    "lift": 40.0,
    "side": 15.0,
    "twist": 12.0,
    "ankle": 25.0,
    "spine": 15.0,
    "distal": 20.0,
    "other": 20.0,
}
"""deg to both sides of the standing angle, by role.

`distal`: a third swing joint down the leg (hock, pastern). It gets a smaller range, or the limb
flails. One-legged bodies use the full range.
"""
SWINGING = 2
"""Joints of a leg that swing it widely."""
ENDLESS = 6.0
"""rad, width from which a range counts as unlimited."""
LEAST_BEND = 3.0
"""deg that a knee stays away from straight."""
ROLES = ("stride", "side", "lift")


def roles_of(
    kinematics: KinematicModel, q: np.ndarray, stance: Stance
) -> tuple[list[str], np.ndarray]:
    """Role of each joint, and the mean motion [J, 3] m/rad that it gives its feet."""
    soles = kinematics.sole_points(*kinematics.pose(q))
    middles = [lowest_part(sole, stance.hip).mean(0) for sole in soles]
    moves = np.array([kinematics.jacobian(f, middle) for f, middle in enumerate(middles)])
    carried = np.abs(moves).sum(2) > 0
    mean = moves.sum(0) / np.maximum(carried.sum(0), 1)[:, None]
    axes = np.abs(kinematics.data.xaxis[1:])
    roles = []
    for j in range(len(q)):
        size = float(np.linalg.norm(mean[j]))
        legs = [f for f in range(len(kinematics.feet)) if j in kinematics.leg(f)]
        if not legs:
            roles.append("other")
        elif len(legs) > 1:
            roles.append("spine")
        elif size < 0.2 * stance.hip:
            roles.append("ankle" if axes[j][1] > 0.7 else "twist")
        else:
            roles.append(
                ROLES[int((np.abs(mean[j]) * [1.3, 1.0, 1.0]).argmax())]
            )  # a tie is a stride
    chains = [kinematics.leg(f) for f in range(len(kinematics.feet))]
    for leg in chains if len(chains) > 1 else []:
        for j in [j for j in leg if roles[j] in ("stride", "lift")][SWINGING:]:
            roles[j] = "distal"
    return roles, mean


def ranges_of(kinematics: KinematicModel, q: np.ndarray, roles: list[str]) -> np.ndarray:
    """Ranges [J, 2] deg about the standing angle, within the limits."""
    half = np.array([RANGES[role] for role in roles])
    low = np.maximum(
        -half, np.degrees(np.where(np.isfinite(kinematics.low), kinematics.low, -1e3) - q)
    )
    high = np.minimum(
        half, np.degrees(np.where(np.isfinite(kinematics.high), kinematics.high, 1e3) - q)
    )
    return np.stack([np.minimum(low, 0.0), np.maximum(high, 0.0)], 1)


def one_sided(
    kinematics: KinematicModel, q: np.ndarray, ranges: np.ndarray, notes: Notes
) -> np.ndarray:
    """Keep a knee without stated limits on the side to which it is bent in the stance.

    ranges: [J, 2] deg; returned with these knees' ranges cut.
    """
    sided, found = [], ranges.copy()
    soles = kinematics.sole_points(*kinematics.pose(q))
    for f, sole in enumerate(soles):
        leg = kinematics.leg(f)
        path = np.concatenate([kinematics.data.xanchor[[j + 1 for j in leg]], sole.mean(0)[None]])
        parts = np.diff(path, axis=0)
        sizes = np.linalg.norm(parts, axis=1)
        if len(sizes) < 2:
            continue
        k = int((sizes[:-1] + sizes[1:]).argmax())
        knee, axis = leg[k + 1], kinematics.data.xaxis[leg[k + 1] + 1]
        if kinematics.high[knee] - kinematics.low[knee] < ENDLESS:
            continue
        thigh, shank = parts[k], parts[k + 1]
        straight = np.degrees(np.arctan2(axis @ np.cross(shank, thigh), shank @ thigh))
        if abs(straight) < LEAST_BEND:
            continue
        end = straight - np.sign(straight) * LEAST_BEND
        low, high = found[knee]
        found[knee] = (low, min(high, end)) if straight > 0 else (max(low, end), high)
        if (found[knee] != (low, high)).any():
            sided.append(kinematics.names[knee])
    if sided:
        notes.guess(
            "side of knees",
            "as they stand",
            "medium",
            f"the file has no limits for {listed(sided)}: no further than straight",
        )
    return found
