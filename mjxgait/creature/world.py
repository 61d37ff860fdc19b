"""Check of the world around the creature: only a flat floor, and geoms that nothing touches."""

import mujoco
import numpy as np

from mjxgait.errors import UserError

WAY_OUT = "evolution knows one creature on a flat floor and nothing else"


def check_world(model: mujoco.MjModel, trunk: int, floor: int) -> None:
    """Refuse what evolution would ignore: other moving bodies, and touchable geoms but the floor.

    Args:
      trunk: body id. floor: geom id.

    Raises:
      UserError: names the body or geom, and the remedy.
    """
    own = int(model.body_treeid[trunk])
    for body in np.flatnonzero(model.body_treeid >= 0):
        if own >= 0 and int(model.body_treeid[body]) != own:
            raise UserError(
                f'body "{model.body(body).name or body}" moves but is no part of '
                f'"{model.body(trunk).name}": {WAY_OUT}; '
                "take the body out of creature.xml, or join it to the creature"
            )
    still = model.body_weldid[model.geom_bodyid] == 0
    for geom in np.flatnonzero(still):
        if geom != floor and _can_be_touched(model, int(geom), still):
            raise UserError(
                f"{_called(model, int(geom))} stands in the world where the creature can touch it: "
                f"{WAY_OUT}; take the geom out of creature.xml, or make it decoration with "
                'contype="0" conaffinity="0"'
            )


def _can_be_touched(model: mujoco.MjModel, geom: int, still: np.ndarray) -> bool:
    """True if MuJoCo would collide the geom with something that moves."""
    masks = (model.geom_contype[geom] & model.geom_conaffinity) | (
        model.geom_contype & model.geom_conaffinity[geom]
    )
    pairs = np.stack([model.pair_geom1, model.pair_geom2], 1)
    return bool((masks[~still] != 0).any() or (pairs == geom).any())


def _called(model: mujoco.MjModel, geom: int) -> str:
    if name := model.geom(geom).name:
        return f'geom "{name}"'
    body = model.body(model.geom_bodyid[geom]).name
    return f'a geom without name (number {geom}, in body "{body}")'
