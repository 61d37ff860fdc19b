"""Room for what other bodies of the same tree have: one program then serves them all.

Robots of one kind differ in how many shapes each of their parts has and in which parts come near
each other. A roomy topology has a fixed number of places for both, and the numbers say what is in
them. It costs a little at every step, so only a program whose body is an input has it.
"""

import dataclasses
from typing import Any

import numpy as np

from mjxgait.physics.lane_major.parameters import Parameters, Watched
from mjxgait.physics.lane_major.slots import ANY, WatchedSlot
from mjxgait.physics.lane_major.topology import Topology
from mjxgait.physics.overlap import Bars

SHAPES, ON_TRUNK, BARS, PAIRS = 2, 4, 128, 256
"""Multiples of which there are places: for shapes that are no feet on each body and on the trunk,
for bars, for pairs of bars.
"""
FAR = 1e3
"""m above the ground, where a place is that nothing is in."""


def make_room(topology: Topology, parameters: Parameters, feet: int) -> tuple[Topology, Parameters]:
    """A body with places to spare. feet: shapes, the first of the watched, that stay as they are."""
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
    """The slots, and which of the watched shapes is in each, -1 for none."""
    slots, rows = list(topology.watched[:feet]), list(range(feet))
    for body in range(len(topology.bodies)):
        others = range(feet, len(topology.watched))
        own = [g for g in others if topology.watched[g].body == body]
        room = _room(len(own), ON_TRUNK if body == topology.trunk else SHAPES)
        slots += [WatchedSlot(body, ANY)] * room
        rows += own + [-1] * (room - len(own))
    return tuple(slots), rows


def _room(count: int, step: int) -> int:
    """Places for so many: a multiple of the step, at least one."""
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
    """Places that nothing is in are points, and pairs of them never come near."""
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
