"""Forward direction, planarity and mirrored joints of a body."""

import re

import numpy as np

from mjxgait.creature.geometry import off_axis
from mjxgait.creature.joints import other_side
from mjxgait.errors import listed
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.notes import Confidence, Notes

FRONT_WORDS, BACK_WORDS = (
    ("front", "fore", "head", "nose", "neck", "snout"),
    ("hind", "rear", "back", "tail"),
)
FRONT_CORNERS, BACK_CORNERS = (
    {"fl", "fr", "lf", "rf"},
    {"hl", "hr", "rl", "rr", "bl", "br", "lh", "rh", "lb", "rb"},
)
LEFT_WORDS, RIGHT_WORDS = (
    {"left", "l", "fl", "lf", "ml", "lm", "hl", "lh", "rl", "bl", "lb"},
    {"right", "r", "fr", "rf", "mr", "rm", "hr", "rh", "rr", "br", "rb"},
)
"""Whole words of a name, as between underscores."""
ASKEW = 0.5
"""Largest share of the way between the sides along one axis that may lie along the other."""
CLEARLY, MOSTLY, NAMED = 1.1, 2.0, 4.0
"""Ratio of the foot swings along the two axes from which the larger one is the walking axis.

The first holds where symmetry does not separate the axes, the second where it speaks for the other
axis, the third where names of left and right parts do: lifting and bending a leg that sprawls swing
its foot sideways.
"""
SHANK = 0.25
"""Share of a leg's length from which its last part is a shank, not a foot."""
ROUGHLY = 5.0
"""Factor on the usual tolerance for nearly mirrored bodies."""
MOST_ALONE = 0.25
"""Share of the joints that may have no mirror image in a body that still counts as symmetric."""
SIDES = "the names of left and right parts"
"""Evidence for a direction, in words."""
WIDEST = 1.4
"""rad, largest hinge range that counts: a leg swings no farther in a stride."""
FORWARDS = {
    "x": np.array([1.0, 0, 0]),
    "-x": np.array([-1.0, 0, 0]),
    "y": np.array([0, 1.0, 0]),
    "-y": np.array([0, -1.0, 0]),
}


def yaw_to(forward: np.ndarray) -> np.ndarray:
    """Rotation [3, 3] about z that turns a horizontal forward [3] to +x."""
    x, y = forward[:2] / np.linalg.norm(forward[:2])
    return np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])


def find_forward(
    kinematics: KinematicModel, q: np.ndarray, given: str | None, notes: Notes
) -> np.ndarray:
    """Forward unit vector [3] in the world of the pose."""
    xpos, _ = kinematics.pose(q)
    if given:
        notes.guess("forward", given, "high", "as given")
        return FORWARDS[given]
    name, sure, why = _axis(kinematics, q)
    sign, evidence = _front(kinematics, xpos, FORWARDS[name])
    if sign < 0:
        name = f"-{name}"
    notes.guess(
        "forward",
        name,
        "medium" if sure == "high" and not evidence else sure,
        why + (f"; {evidence}" if evidence not in ("", why) else ""),
    )
    return FORWARDS[name]


def _axis(kinematics: KinematicModel, q: np.ndarray) -> tuple[str, Confidence, str]:
    """Walking axis (x or y), its confidence and the reason."""
    axes = kinematics.data.xaxis[1:]
    if is_planar(kinematics, q) is not None:
        lateral = int(np.abs(axes[0][:2]).argmax())
        return ("x", "y")[1 - lateral], "high", "all hinges turn about the other axis"
    alike = {name: _two_sided(kinematics, FORWARDS[name], q) for name in ("x", "y")}
    along_x, along_y = swings(kinematics, q)
    name, other = ("x", "y") if along_x >= along_y else ("y", "x")
    farther = max(along_x, along_y) / max(min(along_x, along_y), 1e-9)
    swung = f"the hinges swing the feet {min(farther, 99):.1f} times as far along {name}"
    if alike["x"] == alike["y"]:
        if farther <= NAMED and (facing := _faces(kinematics)) is not None:
            return ("x", "y")[int(np.abs(facing).argmax())], "high", SIDES
        if farther > CLEARLY:
            return name, "high" if alike["x"] else "medium", swung
        if alike["x"]:
            return "x", "low", "symmetry and hinges are as good along y; x is the convention"
        spread = np.ptp(kinematics.data.xpos[1:], axis=0)
        name = "x" if spread[0] >= 0.8 * spread[1] else "y"
        return name, "low", "no plane of symmetry was found; the longer side"
    if farther > MOSTLY and not alike[name]:
        return name, "medium", f"{swung}, though the body is its own mirror image about {other}"
    return ("x" if alike["x"] else "y"), "high", "the body is its own mirror image about it"


def _two_sided(kinematics: KinematicModel, forward: np.ndarray, q: np.ndarray) -> bool:
    """Return whether the left and right sides mirror each other.

    A biped seen from the side also equals its mirror image, but there each leg is its own partner.
    """
    found = kinematics.mirror(forward, q)
    return found is not None and bool((found[0] != np.arange(len(found[0]))).any())


def swings(kinematics: KinematicModel, q: np.ndarray) -> tuple[float, float]:
    """Foot swing in m along x and along y, summed over the hinges of the legs."""
    soles = kinematics.sole_points(*kinematics.pose(q))
    width = np.minimum(kinematics.high - kinematics.low, WIDEST)[:, None]
    ways = [
        np.abs(kinematics.jacobian(f, sole[sole[:, 2].argmin()])) * width
        for f, sole in enumerate(soles)
    ]
    x, y, _ = np.sum(ways, axis=(0, 1))
    return float(x), float(y)


def _front(kinematics: KinematicModel, xpos: np.ndarray, axis: np.ndarray) -> tuple[int, str]:
    """Sign of the front along the axis, and its evidence in words."""
    score = 0.0
    for body, at in zip(kinematics.bodies, xpos, strict=True):
        score += _named_front(body.name) * float((at - xpos[0]) @ axis)
    if abs(score) > 1e-3:
        return int(np.sign(score)), "the names of front and rear parts"
    facing = _faces(kinematics)
    if facing is not None and facing @ axis:
        return int(facing @ axis), SIDES
    if len(kinematics.feet) > 2:
        return 1, ""
    # Toes reach forward from the ankle; a leg's last part that is a shank hangs back from the knee.
    toes = shanks = 0.0
    poses = kinematics.pose(kinematics.data.qpos[7:])
    for f, sole in enumerate(kinematics.sole_points(*poses)):
        anchors = kinematics.data.xanchor[[j + 1 for j in kinematics.leg(f)]]
        last = sole.mean(0) - anchors[-1]
        length = np.linalg.norm(np.diff(anchors, axis=0), axis=1).sum() + np.linalg.norm(last)
        if np.linalg.norm(last) > SHANK * length:
            shanks += float(last @ axis)
        else:
            toes += float(last @ axis)
    least = 0.02 * max(float(np.ptp(xpos[:, 2])), 1e-6) * len(kinematics.feet)
    for reach, evidence in ((toes, "toes point that way"), (-shanks, "knees point that way")):
        if abs(reach) > least:
            return int(np.sign(reach)), evidence
    return 1, ""


def _faces(kinematics: KinematicModel) -> np.ndarray | None:
    """Forward [3] by the names of left and right parts; None if they do not say it."""
    sides = np.array([_named_left(body.name) for body in kinematics.bodies])
    if not (sides > 0).any() or not (sides < 0).any():
        return None
    places = kinematics.data.xpos[1:]
    left = places[sides > 0].mean(0) - places[sides < 0].mean(0)
    ahead = np.array([left[1], -left[0], 0.0])
    near, far = np.sort(np.abs(ahead[:2]))
    if near > ASKEW * far or far < 1e-3:
        return None
    faces: np.ndarray = np.where(np.abs(ahead) == far, np.sign(ahead), 0.0)
    return faces


def _named_left(name: str) -> int:
    """Return 1 for the name of a left part, -1 for a right one, else 0."""
    name = name.lower()
    words = _words(name)
    left = "left" in name or bool(words & LEFT_WORDS)
    return left - ("right" in name or bool(words & RIGHT_WORDS))


def _words(name: str) -> set[str]:
    return set(re.split(r"[^a-z]+", name))


def _named_front(name: str) -> int:
    """Return 1 for the name of a front part, -1 for a rear one, else 0."""
    name = name.lower()
    words = _words(name)
    front = any(w in name for w in FRONT_WORDS) or bool(words & FRONT_CORNERS)
    back = any(w in name for w in BACK_WORDS) or bool(words & BACK_CORNERS)
    return front - back


def is_planar(kinematics: KinematicModel, q: np.ndarray) -> np.ndarray | None:
    """Lateral axis [3] of a planar body; else None.

    Its hinges are all parallel and its feet lie, or are kept, in one plane.
    """
    poses = kinematics.pose(q)
    axes = kinematics.data.xaxis[1:]
    if np.abs(axes @ axes[0]).min() < 0.99 or abs(axes[0][2]) > 0.1:
        return None
    middles = [
        float((sole.max(0) + sole.min(0)) @ axes[0]) / 2 for sole in kinematics.sole_points(*poses)
    ]
    height = max(float(np.ptp(poses[0][:, 2])), 1e-6)
    return axes[0] if np.ptp(middles) < (0.4 if kinematics.in_plane else 0.05) * height else None


def planar_pairs(kinematics: KinematicModel, q: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Partner and sign [J] of a planar body with two alike legs on one hip; else None."""
    if len(kinematics.feet) != 2:
        return None
    kinematics.pose(q)
    one, other = (kinematics.leg(f) for f in range(2))
    partner, sign = np.arange(len(kinematics.joints)), np.ones(len(kinematics.joints), dtype=int)
    own, others = [j for j in one if j not in other], [j for j in other if j not in one]
    if len(own) != len(others) or not own:
        return None
    for a, b in zip(own, others, strict=True):
        apart = (kinematics.data.xanchor[a + 1] - kinematics.data.xanchor[b + 1])[[0, 2]]
        same = kinematics.low[a] == kinematics.low[b] and kinematics.high[a] == kinematics.high[b]
        if (
            np.linalg.norm(apart)
            > 0.05 * float(np.ptp(kinematics.data.xpos[1:], axis=0).max() + 1e-6)
            or not same
        ):
            return None
        partner[a], partner[b] = b, a
        sign[a] = sign[b] = int(
            np.sign(kinematics.data.xaxis[a + 1] @ kinematics.data.xaxis[b + 1])
        )
    return partner, sign


def find_mirror(
    kinematics: KinematicModel, q: np.ndarray, planar: bool, notes: Notes
) -> tuple[np.ndarray, np.ndarray] | None:
    """Partner and sign [J] of a body that faces +x; None if it is not symmetric."""
    if planar:
        found = planar_pairs(kinematics, q)
        notes.guess(
            "mirror",
            "two alike legs" if found else "none",
            "high",
            "the legs of a body in a plane are compared",
        )
        return found
    found, lone = kinematics.mirror(np.array([1.0, 0, 0]), q), ""
    if found is None:
        found, lone = _nearly_mirrored(kinematics, q)
    if found is not None and not _mirrors(kinematics, q, *found):
        found = None
        reason = "the joints pair up, but equal angles do not mirror the pose (their zeros differ)"
    elif found is not None and _names_disagree(kinematics.names, found[0]):
        found = None
        reason = "the geometry and the names left and right contradict each other"
    else:
        reason = lone or "partners found from the anchors and axes of the joints"
    sure: Confidence = "high" if found and not lone else "medium"
    notes.guess("mirror", "symmetric" if found else "none", sure, reason)
    return found


def _nearly_mirrored(
    kinematics: KinematicModel, q: np.ndarray
) -> tuple[tuple[np.ndarray, np.ndarray] | None, str]:
    """Partner and sign [J] of a nearly symmetric body, and its differences in words.

    Joints without a mirror image pair up by name. A joint without a partner keeps its own angle in
    the mirrored half of a cycle. None if too many joints have no image.
    """
    partner, sign = kinematics.images(np.array([1.0, 0, 0]), q, ROUGHLY)
    lone = np.flatnonzero(partner < 0)
    if len(lone) > MOST_ALONE * len(partner):
        return None, f"{listed([kinematics.names[j] for j in lone])}: without a mirror image"
    axes = kinematics.data.xaxis[1:]
    alone = []
    for j in lone:
        other = other_side(kinematics.names[j])
        partner[j] = k = kinematics.names.index(other) if other in kinematics.names else j
        if k == j:
            alone.append(kinematics.names[j])
            sign[j] = 1
        else:
            sign[j] = 1 if axes[j] * [-1, 1, -1] @ axes[k] >= 0 else -1
    rough = [kinematics.names[j] for j in lone if kinematics.names[j] not in alone]
    said = [f"{listed(rough)} are paired by their names, not each other's image"] if rough else []
    said += (
        [f"{listed(alone)} has no partner, its angle is the same in both halves"] if alone else []
    )
    return (partner, sign), "; ".join(
        said
    ) or "partners found, though the sides are not quite alike"


def _mirrors(
    kinematics: KinematicModel, q: np.ndarray, partner: np.ndarray, sign: np.ndarray
) -> bool:
    """Return whether mirrored angles give the mirrored pose, tried on a random pose.

    Joints beside the plane of symmetry without a partner are ignored.
    """
    trial = q + np.random.default_rng(1).uniform(-0.3, 0.3, len(q))
    kinematics.pose(trial)
    anchors = kinematics.data.xanchor[1:] - kinematics.data.xpos[1]
    axes = kinematics.data.xaxis[1:].copy()
    kinematics.pose(sign * trial[partner])
    image = kinematics.data.xanchor[1:] - kinematics.data.xpos[1]
    # Of a hinge's anchor only its line counts.
    off = off_axis(image[partner] * [1, -1, 1] - anchors, axes)
    most = 0.05 * float(np.ptp(anchors, axis=0).max()) + 1e-6
    lone = (partner == np.arange(len(q))) & (np.abs(anchors[:, 1]) > most)
    return bool(off[~lone].max(initial=0.0) < most)


def _names_disagree(names: list[str], partner: np.ndarray) -> bool:
    return any(
        other_side(name) in names and other_side(name) not in (name, names[partner[j]])
        for j, name in enumerate(names)
    )
