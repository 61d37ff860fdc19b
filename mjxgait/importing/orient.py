"""Finds where the front is, whether the body lives in a plane, and which joints mirror each
other.
"""

import numpy as np

from mjxgait.importing.body import Puppet
from mjxgait.importing.notes import Confidence, Notes

FRONT_WORDS, BACK_WORDS = (
    ("front", "fore", "head", "nose", "neck", "snout", "_fl", "_fr", "fl_", "fr_", "lf_", "rf_"),
    (
        "hind",
        "rear",
        "back",
        "tail",
        "_hl",
        "_hr",
        "hl_",
        "hr_",
        "rl_",
        "rr_",
        "lh_",
        "rh_",
    ),
)
FORWARDS = {
    "x": np.array([1.0, 0, 0]),
    "-x": np.array([-1.0, 0, 0]),
    "y": np.array([0, 1.0, 0]),
    "-y": np.array([0, -1.0, 0]),
}


def yaw_to(forward: np.ndarray) -> np.ndarray:
    """[3, 3] rotation about z that takes a horizontal forward [3] to +x."""
    x, y = forward[:2] / np.linalg.norm(forward[:2])
    return np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])


def find_forward(puppet: Puppet, q: np.ndarray, told: str | None, notes: Notes) -> np.ndarray:
    """[3] unit vector in the world of the pose."""
    xpos, _ = puppet.pose(q)
    if told:
        notes.guess("forward", told, "high", "as told")
        return FORWARDS[told]
    sure: Confidence
    sides = {name: puppet.mirror(FORWARDS[name], q) is not None for name in ("x", "y")}
    axes = puppet.data.xaxis[1:]
    if is_planar(puppet, q) is not None:
        lateral = int(np.abs(axes[0][:2]).argmax())
        name, sure, why = ("x", "y")[1 - lateral], "high", "all hinges turn about the other axis"
    elif sides["x"] != sides["y"]:
        name, sure, why = (
            ("x" if sides["x"] else "y"),
            "high",
            "the body is its own mirror image about it",
        )
    elif sides["x"]:
        name, sure, why = "x", "medium", "the body is as symmetric along y; x is the convention"
    else:
        spread = np.ptp(xpos, axis=0)
        name = "x" if spread[0] >= 0.8 * spread[1] else "y"
        sure, why = "low", "no plane of symmetry was found; the longer side"
    sign, evidence = _front(puppet, xpos, FORWARDS[name])
    if sign < 0:
        name = f"-{name}"
    notes.guess(
        "forward",
        name,
        "medium" if sure == "high" and not evidence else sure,
        why + (f"; {evidence}" if evidence else ""),
    )
    return FORWARDS[name]


def _front(puppet: Puppet, xpos: np.ndarray, axis: np.ndarray) -> tuple[int, str]:
    """Which end is the front, and what says so."""
    score = 0.0
    for body, at in zip(puppet.bodies, xpos, strict=True):
        name = body.name.lower()
        along = float((at - xpos[0]) @ axis)
        word = any(w in name for w in FRONT_WORDS) - any(w in name for w in BACK_WORDS)
        score += word * along
    if abs(score) > 1e-3:
        return int(np.sign(score)), "the names of front and rear parts"
    # Toes point forward: where feet reach from the ankle.
    toes = 0.0
    poses = puppet.pose(puppet.data.qpos[7:])
    for f, sole in enumerate(puppet.sole_points(*poses)):
        ankle = puppet.data.xanchor[puppet.leg(f)[-1] + 1]
        toes += float((sole.mean(0) - ankle) @ axis)
    height = max(float(np.ptp(xpos[:, 2])), 1e-6)
    if abs(toes) > 0.02 * height * len(puppet.feet) and len(puppet.feet) <= 2:
        return int(np.sign(toes)), "toes point that way"
    return 1, ""


def is_planar(puppet: Puppet, q: np.ndarray) -> np.ndarray | None:
    """The lateral axis [3] of a body whose hinges are all parallel and whose feet are, or are
    kept, in one plane; else None.
    """
    poses = puppet.pose(q)
    axes = puppet.data.xaxis[1:]
    if np.abs(axes @ axes[0]).min() < 0.99 or abs(axes[0][2]) > 0.1:
        return None
    middles = [
        float((sole.max(0) + sole.min(0)) @ axes[0]) / 2 for sole in puppet.sole_points(*poses)
    ]
    height = max(float(np.ptp(poses[0][:, 2])), 1e-6)
    return axes[0] if np.ptp(middles) < (0.4 if puppet.in_plane else 0.05) * height else None


def planar_pairs(puppet: Puppet, q: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Partner and sign [J] of a planar body with two alike legs from one hip; None when it has
    none.
    """
    if len(puppet.feet) != 2:
        return None
    puppet.pose(q)
    one, other = (puppet.leg(f) for f in range(2))
    partner, sign = np.arange(len(puppet.joints)), np.ones(len(puppet.joints), dtype=int)
    own, others = [j for j in one if j not in other], [j for j in other if j not in one]
    if len(own) != len(others) or not own:
        return None
    for a, b in zip(own, others, strict=True):
        apart = (puppet.data.xanchor[a + 1] - puppet.data.xanchor[b + 1])[[0, 2]]
        same = (
            puppet.joints[a].low == puppet.joints[b].low
            and puppet.joints[a].high == puppet.joints[b].high
        )
        if (
            np.linalg.norm(apart) > 0.05 * float(np.ptp(puppet.data.xpos[1:], axis=0).max() + 1e-6)
            or not same
        ):
            return None
        partner[a], partner[b] = b, a
        sign[a] = sign[b] = int(np.sign(puppet.data.xaxis[a + 1] @ puppet.data.xaxis[b + 1]))
    return partner, sign


def find_mirror(
    puppet: Puppet, q: np.ndarray, planar: bool, notes: Notes
) -> tuple[np.ndarray, np.ndarray] | None:
    """Partner and sign [J] of a body that faces +x, or None for one that is not symmetric."""
    if planar:
        found = planar_pairs(puppet, q)
        notes.guess(
            "mirror",
            "two alike legs" if found else "none",
            "high",
            "the legs of a body in a plane are compared",
        )
        return found
    found = puppet.mirror(np.array([1.0, 0, 0]), q)
    if found is not None and not _mirrors(puppet, q, *found):
        found = None
        reason = "the joints pair up, but equal angles do not mirror the pose (their zeros differ)"
    elif found is not None and _names_disagree(puppet.names, found[0]):
        found = None
        reason = "the geometry and the names left and right contradict each other"
    else:
        reason = (
            "partners found from the anchors and axes of the joints"
            if found
            else "some joint has no mirror image"
        )
    notes.guess("mirror", "symmetric" if found else "none", "high" if found else "medium", reason)
    return found


def _mirrors(puppet: Puppet, q: np.ndarray, partner: np.ndarray, sign: np.ndarray) -> bool:
    """Whether mirrored angles give the mirrored pose, tried on a random pose."""
    trial = q + np.random.default_rng(1).uniform(-0.3, 0.3, len(q))
    puppet.pose(trial)
    anchors = puppet.data.xanchor[1:] - puppet.data.xpos[1]
    puppet.pose(sign * trial[partner])
    mirrored = (puppet.data.xanchor[1:] - puppet.data.xpos[1])[partner] * [1, -1, 1]
    size = float(np.ptp(anchors, axis=0).max())
    return bool(np.linalg.norm(mirrored - anchors, axis=1).max() < 0.05 * size + 1e-6)


def _names_disagree(names: list[str], partner: np.ndarray) -> bool:
    for j, name in enumerate(names):
        swapped = name.replace("left", "\0").replace("right", "left").replace("\0", "right")
        if swapped not in (name, names[partner[j]]) and swapped in names:
            return True
    return False
