"""Overlays of a scene: goals on the floor, and a bar on two posts.

They collide with nothing and are in no simulation.
"""

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.reference.bar import RADIUS
from mjxgait.reference.layout import StartFrame, start_frame

GEOM = mujoco.mjtGeom
GOAL_COLOUR, BAR_COLOUR, POST_COLOUR = (
    [0.10, 0.55, 0.50, 1.0],
    [0.95, 0.70, 0.15, 1.0],
    [0.55, 0.57, 0.60, 1.0],
)
DISC = 0.25, 0.004
"""Radius in body lengths and half the height in m of a goal."""
BODY = "marks"


def marked(
    creature: Creature, goals: np.ndarray, floor: np.ndarray, bar: np.ndarray | None
) -> mujoco.MjSpec:
    """Return the creature's model with the goals and the bar as its last body.

    Args:
      goals: [goals] m ahead of the start. floor: [goals] m, height of the floor there. bar: [2] m
        ahead of the start and above the floor, of its lower edge.
    """
    spec, start = mujoco.MjSpec.from_string(creature.files["creature.xml"]), start_frame(creature)
    body = spec.worldbody.add_body(name=BODY)
    radius = DISC[0] * creature.frame.body_length
    for ahead, level in zip(goals, floor, strict=True):
        place = [*_ahead(start, ahead)[:2], level + DISC[1]]
        _add(body, GEOM.mjGEOM_CYLINDER, GOAL_COLOUR, pos=place, size=[radius, DISC[1], 0])
    if bar is not None:
        _add_bar(body, start, float(bar[0]), float(bar[1]), 1.2 * creature.frame.body_length)
    return spec


def _add_bar(
    body: mujoco.MjsBody, start: StartFrame, ahead: float, height: float, half: float
) -> None:
    """Add a bar on posts that rise above it. half: m, half its width."""
    middle, up = _ahead(start, ahead), np.array([0.0, 0.0, height + RADIUS])
    ends = [middle + side * half * start.left for side in (1, -1)]
    across = np.concatenate([end + up for end in ends])
    _add(body, GEOM.mjGEOM_CAPSULE, BAR_COLOUR, fromto=across, size=[RADIUS, 0, 0])
    for end in ends:
        post = np.concatenate([end, end + 1.15 * up])
        _add(body, GEOM.mjGEOM_CAPSULE, POST_COLOUR, fromto=post, size=[0.7 * RADIUS, 0, 0])


def _ahead(start: StartFrame, distance: float) -> np.ndarray:
    """Place [3] m on the floor, ahead of the start."""
    place: np.ndarray = start.place * [1, 1, 0] + distance * start.forward
    return place


def _add(body: mujoco.MjsBody, kind: mujoco.mjtGeom, colour: list[float], **given: object) -> None:
    body.add_geom(type=kind, rgba=colour, contype=0, conaffinity=0, group=1, **given)
