"""Padded topologies: one program serves all bodies of the same tree.

Robots of one kind differ in how many shapes each of their parts has and in which parts come near
each other. A padded topology has a fixed number of places for both, and the numbers say what is in
them. It costs a little at every step, so only a program with the body as an input has it.
"""

import dataclasses
from typing import Any

import numpy as np

from mjxgait.physics.lane_major.parameters import Parameters, Watched
from mjxgait.physics.lane_major.slots import ANY, WatchedSlot
from mjxgait.physics.lane_major.topology import Topology
from mjxgait.physics.overlap import Bars

SHAPES, ON_TRUNK, BARS, PAIRS = 2, 4, 128, 256
"""Places are rounded up to multiples of these.

Shapes that are no feet on each body and on the trunk; bars; pairs of bars.
"""
FAR = 1e3
"""m above the ground, the height of an empty place."""


def make_room(topology: Topology, parameters: Parameters, feet: int) -> tuple[Topology, Parameters]:
    """Pad a body with places. feet: number of first watched shapes that stay as they are."""
    slots, rows = _places(topology, feet)
    roomy = dataclasses.replace(
        topology, watched=slots, bar_body=(), first=(), second=(), open_pairs=True
    )
    return roomy, dataclasses.replace(
        parameters,
        watched=_watched(parameters.watched, rows),
        bars=_bars(topology, parameters.bars),
    )


def _places(topology: Topology, feet: int) -> tuple[tuple[WatchedSlot, ...], list[int]]:
    """Slots, and the watched shape in each, -1 for none."""
    slots, rows = list(topology.watched[:feet]), list(range(feet))
    for body in range(len(topology.bodies)):
        others = range(feet, len(topology.watched))
        own = [g for g in others if topology.watched[g].body == body]
        room = _room(len(own), ON_TRUNK if body == topology.trunk else SHAPES)
        slots += [WatchedSlot(body, ANY)] * room
        rows += own + [-1] * (room - len(own))
    return tuple(slots), rows


def _room(count: int, step: int) -> int:
    """Round a count up to a multiple of the step, at least one step."""
    return max(-(-count // step), 1) * step


def _watched(known: Watched, rows: list[int]) -> Watched:
    empty = Watched(
        pos=np.zeros((1, 3)),
        rot=np.eye(3)[None],
        radius=np.array([-FAR]),
        box=np.zeros((1, 3)),
        ellipsoid=np.zeros((1, 3)),
    )
    fields = (field.name for field in dataclasses.fields(Watched))
    return Watched(
        **{
            name: np.concatenate([getattr(known, name), getattr(empty, name)])[rows]
            for name in fields
        }
    )


def _bars(topology: Topology, known: Bars) -> Bars:
    """Pad the bars: empty places are points, and pairs of them never come near."""
    more_bars, more_pairs = (
        _room(count, step) - count
        for count, step in ((len(topology.bar_body), BARS), (len(topology.first), PAIRS))
    )

    def padded(values: Any, more: int, fill: float = 0.0) -> np.ndarray:
        known = np.asarray(values, float)
        return np.concatenate([known, np.full((more, *known.shape[1:]), fill)])

    return Bars(
        centre=padded(known.centre, more_bars),
        half=padded(known.half, more_bars),
        radius=padded(known.radius, more_bars),
        reach=padded(known.reach, more_pairs, -FAR),
        body=padded(np.array(topology.bar_body), more_bars),
        first=padded(np.array(topology.first), more_pairs),
        second=padded(np.array(topology.second), more_pairs),
    )
