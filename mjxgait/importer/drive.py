"""Joint gains and torque limits, and how the joints steer, balance and step.

`J` active joints.
"""

import dataclasses
from collections.abc import Collection

import mujoco
import numpy as np

from mjxgait.errors import listed
from mjxgait.importer.arms import ratios
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.notes import Confidence, Notes
from mjxgait.importer.roles import one_sided, ranges_of, roles_of
from mjxgait.importer.soles import Stance
from mjxgait.importer.stance import stance_of
from mjxgait.importer.weights import Weights, balance, steering, stepping

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
SPRAWL = 2.0
"""Factor on a foot's distance beside a hinge, where that is more than the hip height: how far out
the weight acts on a sprawling leg. The hinges of upright legs are within half a hip height.
"""
SWING = 0.35
"""rad, amplitude at which the torque limit must swing a joint's own inertia at that frequency."""
LEAST_DAMPING = 0.5
"""Damping ratio of a joint on its own."""
LEAST_INERTIA = 2.0
"""Least inertia of a joint, in units of time step times kd.

Stable PD ignores contact forces, and so gives way by I / (I + h kd).
"""
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
    bend: Weights = dataclasses.field(default_factory=dict)
    stride: Weights = dataclasses.field(default_factory=dict)
    pitch: Weights = dataclasses.field(default_factory=dict)
    roll: Weights = dataclasses.field(default_factory=dict)
    ahead: Weights = dataclasses.field(default_factory=dict)
    aside: Weights = dataclasses.field(default_factory=dict)
    turn: Weights = dataclasses.field(default_factory=dict)
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
    roles, moves = roles_of(kinematics, q, stance)
    arms = np.maximum(stance.hip, SPRAWL * _beside(kinematics, stance))
    weight = stronger * kinematics.mass * GRAVITY * arms
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
    ranges = one_sided(kinematics, q, ranges_of(kinematics, q, roles), notes)
    drive = Drive(roles, kp, kd, torque, ranges)
    _add_armature(kinematics, drive, inertia, notes)
    reason = f"weight {kinematics.mass * GRAVITY:.3g} N times hip height {stance.hip:.3g} m"
    reason += "; longer arms where legs sprawl" if (arms > stance.hip).any() else ""
    reason += f", and {stronger:g} times as much, because it sank" if stronger > 1 else ""
    reason += "; more where a joint's own inertia needs it" if (kp == quick).any() else ""
    notes.guess("kp, kd", f"{np.median(kp):.3g}, {np.median(kd):.3g}", "medium", reason)
    _report_torque(torque, stated, notes)
    notes.guess(
        "range", "by what each joint does", "low", "40 degrees and less, within the file's limits"
    )
    if not planar:
        drive.stride, drive.bend = steering(kinematics, stance, roles)
    drive.pitch, drive.roll = balance(kinematics, stance, roles, moves, planar)
    drive.must_step = _must_step(kinematics, stance)
    if drive.must_step:
        drive.ahead, drive.aside, drive.turn = stepping(kinematics, stance, roles, moves, planar)
    return drive


def step_if_narrow(kinematics: KinematicModel, q: np.ndarray, drive: Drive, notes: Notes) -> None:
    """Set the stepping weights of a body that stands, in a pose [J], if its feet are close."""
    stance = stance_of(kinematics, q)
    sides = [kinematics.data.xpos[group[0] + 1][1] for group in kinematics.feet]
    track = float(np.abs(sides).mean()) / stance.hip
    if drive.must_step or track > NARROW:
        return
    moves = roles_of(kinematics, q, stance)[1]
    drive.ahead, drive.aside, drive.turn = stepping(kinematics, stance, drive.role, moves, False)
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

    swings: joints by which arms swing; those of one arm together turn it about the y axis.
    """
    names, axes, data = kinematics.names, kinematics.data.xaxis[1:], kinematics.data
    mujoco.mj_comPos(kinematics.model, data)
    for left in (1, -1):
        arm = [j for j, n in enumerate(names) if n in swings and left * data.xanchor[j + 1][1] > 0]
        legs = [leg for leg, weight in drive.stride.items() if left * weight < 0]
        if not (arm and legs):
            continue
        shoulder = int(kinematics.model.jnt_bodyid[arm[0] + 1])
        along = data.subtree_com[shoulder] - data.xanchor[arm[0] + 1]
        turns, _ = ratios(axes[arm], along, np.array([0.0, 1.0, 0.0]))
        same = float(np.sign(axes[names.index(legs[0])][1]))
        for j, turn in zip(arm, turns, strict=True):
            drive.swing[names[j]] = (legs[0], round(same * ARM * float(turn), 3))
    if drive.swing:
        arms = listed(list(drive.swing))
        notes.guess("swing", arms, "medium", "arms swing with the leg of the other side")


def _beside(kinematics: KinematicModel, stance: Stance) -> np.ndarray:
    """Return the distance [J] m, level and from a hinge's axis, of the farthest foot on it."""
    soles = kinematics.sole_points(stance.xpos, stance.xrot)
    lifts = [kinematics.jacobian(f, sole.mean(0))[:, 2] for f, sole in enumerate(soles)]
    found: np.ndarray = np.abs(lifts).max(0)
    return found


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


def _report_torque(torque: np.ndarray, stated: np.ndarray, notes: Notes) -> None:
    """Note the torque limits [J], and what became of those that the file states, else infinite."""
    known, used = np.isfinite(stated), torque == stated
    cut, raised = known & (torque < stated), known & (torque > stated)
    said = [f"stated for {known.sum()} of {len(torque)} joints"]
    said += [f"cut for {cut.sum()} to three times what walking needs"] if cut.any() else []
    said += [f"too little for {raised.sum()}"] if raised.any() else []
    said += ["else from weight times hip height"] if raised.any() or not known.all() else []
    sure: Confidence = "high" if used.all() else "medium"
    notes.guess("torque_limit", f"{torque.min():.3g} to {torque.max():.3g}", sure, "; ".join(said))


def _must_step(kinematics: KinematicModel, stance: Stance) -> bool:
    """Return whether the body stands on one foot in each step: at most two feet, side by side."""
    ahead = [kinematics.data.xpos[group[0] + 1][0] for group in kinematics.feet]
    return len(kinematics.feet) <= STEPPERS and bool(np.ptp(ahead) < APART * stance.hip)
