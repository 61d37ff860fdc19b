"""Mirror partners of joints, the joints that step under a fall, and arms that swing."""

from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.anatomy import Stepping
from mjxgait.creature.creature import SLIDE
from mjxgait.creature.settings import CreatureSettings, Swing
from mjxgait.errors import UserError, did_you_mean


def mirrored(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    settings: CreatureSettings,
    joints: list[int],
    axes: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Partner [J] and sign [J] of each joint: as the file states, else from the geometry.

    Without symmetry each joint is its own partner. joints: [J] ids. axes: rows forward, left, up in
    the trunk's frame.

    Raises:
      UserError: names the joints that contradict each other.
    """
    names = [model.joint(j).name for j in joints]
    partner, sign = np.arange(len(joints)), np.ones(len(joints), dtype=int)
    if not settings.mirror.symmetric:
        return partner, sign
    for pair in settings.mirror.pairs:
        for name in (pair.joint, pair.partner):
            _check_known(name, names, "mirror.pairs")
        partner[names.index(pair.joint)], sign[names.index(pair.joint)] = (
            names.index(pair.partner),
            pair.sign,
        )
    stated = {pair.joint for pair in settings.mirror.pairs}
    free = np.array([i for i, name in enumerate(names) if name not in stated], dtype=int)
    if len(free):
        trunk, chosen = model.body(settings.creature.trunk).id, [joints[i] for i in free]
        frame = axes @ data.xmat[trunk].reshape(3, 3).T
        carried = data.subtree_com[model.jnt_bodyid[chosen]]
        anchors, directions, carried = (
            (data.xanchor[chosen] - data.xpos[trunk]) @ frame.T,
            data.xaxis[chosen] @ frame.T,
            (carried - data.xpos[trunk]) @ frame.T,
        )
        near = 0.02 * float(np.ptp(data.xanchor[joints], axis=0).max() + 0.05)
        found, sign[free] = geometry.mirror_map(
            anchors,
            directions,
            model.jnt_type[chosen] == SLIDE,
            carried,
            [names[i] for i in free],
            near,
        )
        partner[free] = free[found]
    _check_names(names, partner)
    return partner, sign


def _check_known(name: str, names: list[str], key: str) -> None:
    if name not in names:
        raise UserError(f'{key}: no joint is called "{name}"; {did_you_mean(name, names)}')


def _check_names(names: list[str], partner: np.ndarray) -> None:
    """Refuse names that contradict the geometry."""
    for name, other in zip(names, (names[p] for p in partner), strict=True):
        swapped = other_side(name)
        if swapped != name and swapped in names and swapped != other:
            raise UserError(
                f'joint "{name}" mirrors to "{other}" by its geometry but to "{swapped}" by its '
                "name; settle it in [mirror] pairs"
            )


def other_side(name: str) -> str:
    """Return the name with left and right exchanged."""
    return name.replace("left", "\0").replace("right", "left").replace("\0", "right")


def stepping_of(
    model: mujoco.MjModel,
    ahead: np.ndarray,
    aside: np.ndarray,
    turn: np.ndarray,
    joints: list[int],
    feet: list[int],
) -> Stepping | None:
    """Stepping of a body with these weights [J]; None where all are zero.

    Args:
      joints: [J] ids. feet: bodies of the feet.

    Raises:
      UserError: names a joint that has a weight and moves no foot, or several.
    """
    weights = (ahead != 0) | (aside != 0) | (turn != 0)
    if not weights.any():
        return None
    chains = [geometry.ancestors(model, body) for body in feet]
    legs = []
    for joint, weighs in zip(joints, weights, strict=True):
        moved = [f for f, chain in enumerate(chains) if int(model.jnt_bodyid[joint]) in chain]
        if weighs and len(moved) != 1:
            raise UserError(
                f'stepping: joint "{model.joint(joint).name}" moves {len(moved)} feet; give '
                "weights to joints that move one"
            )
        legs.append(moved[0] if moved else 0)
    return Stepping(ahead, aside, turn, tuple(legs))


def swings_of(
    settings: Mapping[str, Swing], names: list[str]
) -> tuple[tuple[int, int, float], ...]:
    """Joints [J] that swing with others; see `Joints.swings`.

    Raises:
      UserError: names a joint that the creature lacks, or a leg's joint that itself swings along.
    """
    for name in (*settings, *(swing.leg for swing in settings.values())):
        _check_known(name, names, "swing")
    for arm, swing in settings.items():
        if swing.leg in settings:
            raise UserError(
                f'swing: "{arm}" swings with "{swing.leg}", which itself swings with another '
                "joint; name a joint of a leg"
            )
    return tuple(
        (names.index(arm), names.index(swing.leg), swing.share) for arm, swing in settings.items()
    )
