"""Weights by which joints steer, balance and step (docs/reference/controller.md), by joint name.

`J` active joints.
"""

from collections.abc import Sequence

import numpy as np

from mjxgait.importer.body import KinematicModel
from mjxgait.importer.soles import Stance

WEAKEST = 0.3
"""Least foot motion of a stepping joint, m per rad and hip height."""
UPRIGHT = 0.7
"""Cosine to the vertical from which a joint turns the parts below it."""
Weights = dict[str, float]


def steering(
    kinematics: KinematicModel, stance: Stance, roles: Sequence[str]
) -> tuple[Weights, Weights]:
    """Weights of stride and bend: left legs stride longer, and a spine joint bends about z."""
    stride, bend = Weights(), Weights()
    for f in range(len(kinematics.feet)):
        side = float(kinematics.data.xpos[kinematics.feet[f][0] + 1][1])
        own = [j for j in kinematics.leg(f) if roles[j] == "stride"]
        if own and abs(side) > 0.02 * stance.hip:
            stride[kinematics.names[own[0]]] = 0.5 if side > 0 else -0.5
    spine = [
        j
        for j, role in enumerate(roles)
        if role == "spine" and abs(kinematics.data.xaxis[j + 1][2]) > UPRIGHT
    ]
    behind = [j for j in spine if kinematics.data.xanchor[j + 1][0] < kinematics.data.xpos[1][0]]
    if behind:
        # Positive yaw about -z swings the hind part to the left, which curves the body to the
        # right.
        bend[kinematics.names[behind[0]]] = 0.5 * float(
            np.sign(kinematics.data.xaxis[behind[0] + 1][2])
        )
    return stride, bend


def stepping(
    kinematics: KinematicModel,
    stance: Stance,
    roles: Sequence[str],
    moves: np.ndarray,
    planar: bool,
) -> tuple[Weights, Weights, Weights]:
    """Weights of steps ahead, aside and in a turn.

    The highest joints of a leg that swing the foot forward and sideways place it under the fall.
    The highest upright joint turns it.
    """
    ahead, aside, turn = Weights(), Weights(), Weights()
    for f in range(len(kinematics.feet)):
        shared = {
            j for other in range(len(kinematics.feet)) if other != f for j in kinematics.leg(other)
        }
        leg = [j for j in kinematics.leg(f) if j not in shared]
        for role, axis, table in (("stride", 0, ahead), ("side", 1, aside)):
            if role == "side" and planar:
                continue
            way = {j: float(moves[j][axis]) / stance.hip for j in leg}
            own = [j for j in way if roles[j] == role and abs(way[j]) > WEAKEST]
            if own:
                table[kinematics.names[own[0]]] = round(1 / way[own[0]], 3)
        upright = {j: float(kinematics.data.xaxis[j + 1][2]) for j in leg}
        if turns := [j for j in upright if abs(upright[j]) > UPRIGHT]:
            turn[kinematics.names[turns[0]]] = float(np.sign(upright[turns[0]]))
    return ahead, aside, turn


def balance(
    kinematics: KinematicModel,
    stance: Stance,
    roles: Sequence[str],
    moves: np.ndarray,
    planar: bool,
) -> tuple[Weights, Weights]:
    """Weights of pitch and roll.

    Nose down: front feet push down, hind feet give way, toes press. Right side down: the feet move
    right, under the fall.
    """
    pitch, roll = Weights(), Weights()
    middle = np.mean([kinematics.data.xpos[g[0] + 1][0] for g in kinematics.feet])
    for f, group in enumerate(kinematics.feet):
        leg, ahead = kinematics.leg(f), float(kinematics.data.xpos[group[0] + 1][0] - middle)
        sides = [j for j in leg if roles[j] == "side"]
        if sides and not planar:
            roll[kinematics.names[sides[0]]] = -float(np.sign(moves[sides[0]][1]))
        ankles = [j for j in leg if roles[j] == "ankle"]
        if len(kinematics.feet) <= 2 and ankles:
            pitch[kinematics.names[ankles[-1]]] = float(
                np.sign(kinematics.data.xaxis[ankles[-1] + 1][1])
            )
        elif abs(ahead) > 0.2 * stance.hip:
            own = [j for j in leg if roles[j] in ("lift", "stride")]
            if own:
                j = max(own, key=lambda j: abs(float(moves[j][2])))
                pitch[kinematics.names[j]] = -float(np.sign(moves[j][2]) * np.sign(ahead))
    return pitch, roll
