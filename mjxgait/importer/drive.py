"""Joint gains, torque limits and ranges, and the joints that steer and balance.

`J` active joints.
"""

import dataclasses
from collections.abc import Collection

import mujoco
import numpy as np

from mjxgait.errors import listed
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.notes import Confidence, Notes
from mjxgait.importer.soles import Stance, lowest_part
from mjxgait.importer.stance import stance_of

GRAVITY = 9.81
STIFFNESS, LEAST_STIFFNESS, MOST_STIFFNESS = 12.0, 2.5, 6.0
"""kp in units of weight times hip height: the first over the number of feet, within the others."""
STRENGTH, LEAST_STRENGTH, MOST_STRENGTH = 2.0, 0.5, 1.0
"""Torque limit, in the same units."""
DAMPING = 0.015
"""kd in units of kp, s. Stable PD needs 0.0075 at a step of 5 ms."""
QUICKNESS = 5.0
"""Least natural frequency of a joint, in units of that of a pendulum of the hip height.

A slower joint cannot follow a stride.
"""
SWING = 0.35
"""rad, amplitude at which the torque limit must swing a joint's own inertia at that frequency."""
LEAST_DAMPING = 0.5
"""Damping ratio of a joint on its own."""
LEAST_INERTIA = 2.0
"""Least inertia of a joint, in units of time step times kd.

Stable PD ignores contact forces, and so gives way by I / (I + h kd).
"""
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
NARROW = 0.28
"""Half the distance of left and right feet, in hip heights, below which a character on more feet
also places its feet under a fall: it tips over its legs before a stride ends.
"""
ARM = 0.6
"""Angle of an arm over that of the leg it swings with."""
STEPPERS, APART = 2, 0.5
"""Most feet of a body that must step to catch a fall.

A body with more feet, or with feet this many hip heights apart along x, stands.
"""
WEAKEST = 0.3
"""Least foot motion of a stepping joint, m per rad and hip height."""
ENDLESS = 6.0
"""rad, width from which a range counts as unlimited."""
LEAST_BEND = 3.0
"""deg that a knee stays away from straight."""
UPRIGHT = 0.7
"""Cosine to the vertical from which a joint turns the parts below it."""
ROLES = ("stride", "side", "lift")


@dataclasses.dataclass(eq=False)
class Drive:
    """Joint roles, gains, torque limits and ranges, and the weights of steering and balance.

    role: of each joint. kp, kd, torque: [J]. ranges: [J, 2] deg. The dicts map joint names to
    weights (docs/reference/controller.md); `swing` those of arms to a leg's joint and a share.
    must_step: whether it stands on one foot in each step.
    """

    role: list[str]
    kp: np.ndarray
    kd: np.ndarray
    torque: np.ndarray
    ranges: np.ndarray
    bend: dict[str, float] = dataclasses.field(default_factory=dict)
    stride: dict[str, float] = dataclasses.field(default_factory=dict)
    pitch: dict[str, float] = dataclasses.field(default_factory=dict)
    roll: dict[str, float] = dataclasses.field(default_factory=dict)
    ahead: dict[str, float] = dataclasses.field(default_factory=dict)
    aside: dict[str, float] = dataclasses.field(default_factory=dict)
    turn: dict[str, float] = dataclasses.field(default_factory=dict)
    swing: dict[str, tuple[str, float]] = dataclasses.field(default_factory=dict)
    must_step: bool = False


def plan_drive(
    kinematics: KinematicModel,
    q: np.ndarray,
    stance: Stance,
    planar: bool,
    notes: Notes,
    stronger: float = 1.0,
) -> Drive:
    """Plan the drive of a body that faces +x in its standing pose [J].

    stronger: factor of the gains, and of the torque limits that the file does not state, for a body
    that sinks: legs far apart bear the weight on longer arms than the hip height.
    """
    feet = len(kinematics.feet)
    roles, moves = _roles(kinematics, q, stance)
    weight = stronger * kinematics.mass * GRAVITY * stance.hip
    inertia = _own_inertia(kinematics)
    quick = QUICKNESS**2 * GRAVITY / stance.hip * inertia
    # Arms and the like bear no weight.
    borne = weight * np.array([role != "other" for role in roles])
    kp = np.maximum(borne * np.clip(STIFFNESS / feet, LEAST_STIFFNESS, MOST_STIFFNESS), quick)
    kd = np.maximum(DAMPING * kp, 2 * LEAST_DAMPING * np.sqrt(kp * inertia))
    own = np.maximum(borne * np.clip(STRENGTH / feet, LEAST_STRENGTH, MOST_STRENGTH), SWING * quick)
    stated = kinematics.effort
    # The file's torque is used where it is plausible for a walk: 0 and 1000 N·m often mean
    # "unknown".
    torque = np.where(np.isfinite(stated) & (stated > 0.15 * own), np.minimum(stated, 3 * own), own)
    drive = Drive(roles, kp, kd, torque, _ranges(kinematics, q, roles))
    _bend_one_way(kinematics, q, drive, notes)
    _add_armature(kinematics, drive, inertia, notes)
    reason = f"weight {kinematics.mass * GRAVITY:.3g} N times hip height {stance.hip:.3g} m"
    reason += f", and {stronger:g} times as much, because it sank" if stronger > 1 else ""
    reason += "; more where a joint's own inertia needs it" if (kp == quick).any() else ""
    notes.guess("kp, kd", f"{np.median(kp):.3g}, {np.median(kd):.3g}", "medium", reason)
    _tell_torque(torque, stated, notes)
    notes.guess(
        "range", "by what each joint does", "low", "40 degrees and less, within the file's limits"
    )
    if not planar:
        _steering(kinematics, stance, drive)
    _balance(kinematics, stance, drive, moves, planar)
    drive.must_step = _must_step(kinematics, stance)
    if drive.must_step:
        _stepping(kinematics, stance, drive, moves, planar)
    return drive


def step_if_narrow(kinematics: KinematicModel, q: np.ndarray, drive: Drive, notes: Notes) -> None:
    """Set the stepping weights of a body that stands, in a pose [J], if its feet are close."""
    stance = stance_of(kinematics, q)
    sides = [kinematics.data.xpos[group[0] + 1][1] for group in kinematics.feet]
    track = float(np.abs(sides).mean()) / stance.hip
    if drive.must_step or track > NARROW:
        return
    _stepping(kinematics, stance, drive, _roles(kinematics, q, stance)[1], planar=False)
    notes.guess(
        "stepping",
        "feet land under a fall",
        "medium",
        f"left and right feet are {2 * track:.2f} hip heights apart: it tips over its legs",
    )


def swing_arms(
    kinematics: KinematicModel, drive: Drive, swings: Collection[str], notes: Notes
) -> None:
    """Let each arm that can move swing with the leg of the other side.

    swings: joints by which arms swing.
    """
    names, axes = kinematics.names, kinematics.data.xaxis[1:]
    for j, name in enumerate(names):
        side = float(kinematics.data.xanchor[j + 1][1])
        legs = [leg for leg, weight in drive.stride.items() if weight * side < 0]
        if name in swings and legs:
            same = float(np.sign(axes[j] @ axes[names.index(legs[0])]))
            drive.swing[name] = (legs[0], same * ARM)
    if drive.swing:
        arms = listed(list(drive.swing))
        notes.guess("swing", arms, "medium", "arms swing with the leg of the other side")


def _own_inertia(kinematics: KinematicModel) -> np.ndarray:
    """Inertia [J] kg m² that each joint moves when the body floats free in the latest pose.

    It includes the armature.
    """
    mujoco.mj_forward(kinematics.model, kinematics.data)
    mass = np.zeros((kinematics.model.nv, kinematics.model.nv))
    mujoco.mj_fullM(kinematics.model, kinematics.data, mass)
    return 1 / np.diag(np.linalg.inv(mass))[6:]


def _add_armature(kinematics: KinematicModel, drive: Drive, own: np.ndarray, notes: Notes) -> None:
    """Raise the armature of light joints so that stable PD can hold the weight with them.

    own: [J] inertia. The added armature is like the rotor of a motor of that strength.
    """
    least = LEAST_INERTIA * kinematics.model.opt.timestep * drive.kd
    raised = []
    for joint, has, wants in zip(kinematics.joints, own, least, strict=True):
        if has < wants:
            joint.armature += float(wants - has)
            raised.append(joint.name)
    if raised:
        notes.change(
            f"armature of {listed(raised)} raised to {float(least.max()):.2g} kg m² or less",
            "lighter joints cannot hold the weight with stable PD",
        )


def _roles(
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


def _ranges(kinematics: KinematicModel, q: np.ndarray, roles: list[str]) -> np.ndarray:
    """Ranges [J, 2] deg about the standing angle, within the limits."""
    half = np.array([RANGES[role] for role in roles])
    low = np.maximum(
        -half, np.degrees(np.where(np.isfinite(kinematics.low), kinematics.low, -1e3) - q)
    )
    high = np.minimum(
        half, np.degrees(np.where(np.isfinite(kinematics.high), kinematics.high, 1e3) - q)
    )
    return np.stack([np.minimum(low, 0.0), np.maximum(high, 0.0)], 1)


def _bend_one_way(kinematics: KinematicModel, q: np.ndarray, drive: Drive, notes: Notes) -> None:
    """Keep a knee without stated limits on the side to which it is bent in the stance."""
    sided = []
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
        low, high = drive.ranges[knee]
        drive.ranges[knee] = (low, min(high, end)) if straight > 0 else (max(low, end), high)
        if (drive.ranges[knee] != (low, high)).any():
            sided.append(kinematics.names[knee])
    if sided:
        notes.guess(
            "side of knees",
            "as they stand",
            "medium",
            f"the file has no limits for {listed(sided)}: no further than straight",
        )


def _tell_torque(torque: np.ndarray, stated: np.ndarray, notes: Notes) -> None:
    """Note the torque limits [J], and what became of those that the file states, else infinite."""
    known, used = np.isfinite(stated), torque == stated
    cut, raised = known & (torque < stated), known & (torque > stated)
    said = [f"stated for {known.sum()} of {len(torque)} joints"]
    said += [f"cut for {cut.sum()} to three times what walking needs"] if cut.any() else []
    said += [f"too little for {raised.sum()}"] if raised.any() else []
    said += ["else from weight times hip height"] if raised.any() or not known.all() else []
    sure: Confidence = "high" if used.all() else "medium"
    notes.guess("torque_limit", f"{torque.min():.3g} to {torque.max():.3g}", sure, "; ".join(said))


def _steering(kinematics: KinematicModel, stance: Stance, drive: Drive) -> None:
    """Set the steering weights: left legs stride longer, and a spine joint bends about z."""
    for f in range(len(kinematics.feet)):
        side = float(kinematics.data.xpos[kinematics.feet[f][0] + 1][1])
        own = [j for j in kinematics.leg(f) if drive.role[j] == "stride"]
        if own and abs(side) > 0.02 * stance.hip:
            drive.stride[kinematics.names[own[0]]] = 0.5 if side > 0 else -0.5
    spine = [
        j
        for j, role in enumerate(drive.role)
        if role == "spine" and abs(kinematics.data.xaxis[j + 1][2]) > UPRIGHT
    ]
    behind = [j for j in spine if kinematics.data.xanchor[j + 1][0] < kinematics.data.xpos[1][0]]
    if behind:
        # Positive yaw about -z swings the hind part to the left, which curves the body to the
        # right.
        drive.bend[kinematics.names[behind[0]]] = 0.5 * float(
            np.sign(kinematics.data.xaxis[behind[0] + 1][2])
        )


def _must_step(kinematics: KinematicModel, stance: Stance) -> bool:
    """Return whether the body stands on one foot in each step: at most two feet, side by side."""
    ahead = [kinematics.data.xpos[group[0] + 1][0] for group in kinematics.feet]
    return len(kinematics.feet) <= STEPPERS and bool(np.ptp(ahead) < APART * stance.hip)


def _stepping(
    kinematics: KinematicModel, stance: Stance, drive: Drive, moves: np.ndarray, planar: bool
) -> None:
    """Set the stepping weights.

    The highest joints of a leg that swing the foot forward and sideways place it under the fall.
    The highest upright joint turns it.
    """
    for f in range(len(kinematics.feet)):
        shared = {
            j for other in range(len(kinematics.feet)) if other != f for j in kinematics.leg(other)
        }
        leg = [j for j in kinematics.leg(f) if j not in shared]
        for role, axis, table in (("stride", 0, drive.ahead), ("side", 1, drive.aside)):
            if role == "side" and planar:
                continue
            way = {j: float(moves[j][axis]) / stance.hip for j in leg}
            own = [j for j in way if drive.role[j] == role and abs(way[j]) > WEAKEST]
            if own:
                table[kinematics.names[own[0]]] = round(1 / way[own[0]], 3)
        upright = {j: float(kinematics.data.xaxis[j + 1][2]) for j in leg}
        if turns := [j for j in upright if abs(upright[j]) > UPRIGHT]:
            drive.turn[kinematics.names[turns[0]]] = float(np.sign(upright[turns[0]]))


def _balance(
    kinematics: KinematicModel, stance: Stance, drive: Drive, moves: np.ndarray, planar: bool
) -> None:
    """Set the balance weights.

    Nose down: front feet push down, hind feet give way, toes press. Right side down: the feet move
    right, under the fall.
    """
    middle = np.mean([kinematics.data.xpos[g[0] + 1][0] for g in kinematics.feet])
    for f, group in enumerate(kinematics.feet):
        leg, ahead = kinematics.leg(f), float(kinematics.data.xpos[group[0] + 1][0] - middle)
        sides = [j for j in leg if drive.role[j] == "side"]
        if sides and not planar:
            drive.roll[kinematics.names[sides[0]]] = -float(np.sign(moves[sides[0]][1]))
        ankles = [j for j in leg if drive.role[j] == "ankle"]
        if len(kinematics.feet) <= 2 and ankles:
            drive.pitch[kinematics.names[ankles[-1]]] = float(
                np.sign(kinematics.data.xaxis[ankles[-1] + 1][1])
            )
        elif abs(ahead) > 0.2 * stance.hip:
            own = [j for j in leg if drive.role[j] in ("lift", "stride")]
            if own:
                j = max(own, key=lambda j: abs(float(moves[j][2])))
                drive.pitch[kinematics.names[j]] = -float(np.sign(moves[j][2]) * np.sign(ahead))
