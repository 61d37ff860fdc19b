"""Padded topologies, and differences between two topologies.

Robots of one kind differ in how many shapes each of their parts has and in which parts come near
each other. A padded topology has a fixed number of places for both, and the numbers say what is in
them. It costs a little at every step, so only a program with the body as an input has it.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from mjxgait.physics.derived import Bars
from mjxgait.physics.lane_major.parameters import Parameters, Watched
from mjxgait.physics.lane_major.topology import Topology
from mjxgait.physics.lane_major.treematrix import ANY, BALL, FREE, HINGE, SLIDE, WatchedSlot

SHAPES, ON_TRUNK, BARS, PAIRS = 2, 4, 128, 256
"""Places are rounded up to multiples of these.

Shapes that are no feet on each body and on the trunk; bars; pairs of bars.
"""
FAR = 1e3
"""m above the ground, the height of an empty place."""


def make_room(topology: Topology, parameters: Parameters, feet: int) -> tuple[Topology, Parameters]:
    """Pad a body with places. feet: number of first watched shapes that stay as they are."""
    slots, rows = _places(topology, feet)
    padded = dataclasses.replace(
        topology, watched=slots, bar_body=(), first=(), second=(), open_pairs=True
    )
    return padded, dataclasses.replace(
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

    def padded(values: ArrayLike, more: int, fill: float = 0.0) -> np.ndarray:
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


KINDS = {FREE: "free", BALL: "ball", SLIDE: "slide", HINGE: "hinge"}
WORDS = {
    "contact_power": "the powers of the contacts' solimp",
    "limit_power": "the powers of the limits' solimp",
    "joint_dof": "the actuated joints",
    "joint_qpos": "the actuated joints",
    "bar_body": "the bars that are watched for overlap",
    "first": "the pairs that are watched for overlap",
    "second": "the pairs that are watched for overlap",
    "step": "the timestep",
    "line_iterations": "ls_iterations",
    "warm_start": "the warm start",
    "water": "whether it is in a fluid",
}


def difference(own: Topology, other: Topology) -> str:
    """Describe the first difference of `other` from `own`, as a sentence; empty if none."""
    return next(_differences(own, other), "")


def _differences(own: Topology, other: Topology) -> Iterator[str]:
    if len(own.bodies) != len(other.bodies):
        yield f"it has {len(other.bodies)} bodies, not {len(own.bodies)}"
        return
    for b, (ours, theirs) in enumerate(zip(own.bodies, other.bodies, strict=True)):
        name = f'body "{other.names[b]}"'
        if theirs.parent != ours.parent:
            has, had = (_named(other, parent) for parent in (theirs.parent, ours.parent))
            yield f"{name} hangs on {has}, not {had}"
        had, has = (", ".join(KINDS[j.kind] for j in x.joints) for x in (ours, theirs))
        if has != had:
            yield f"{name} has the joints ({has}), not ({had})"
        yield from _slots(own, other, b, name)
    if own.trunk != other.trunk:
        yield f"its trunk is {_named(other, other.trunk)}, not {_named(other, own.trunk)}"
    for name in (field.name for field in dataclasses.fields(own) if field.compare):
        had, has = getattr(own, name), getattr(other, name)
        if isinstance(had, int | float) and has != had:
            yield f"{WORDS.get(name, name)} differs ({has}, not {had})"
        elif has != had:
            yield f"{WORDS.get(name, name)} differ"


def _slots(own: Topology, other: Topology, b: int, name: str) -> Iterator[str]:
    """Compare the contacts, limits and watched geoms of a body."""
    ends = {True: "capsule ends", False: "spheres"}
    for capsule, word in ends.items():
        had, has = (
            sum(c.body == b and c.capsule == capsule for c in x.contacts) for x in (own, other)
        )
        if has != had:
            yield f"{name} touches the floor with {has} {word}, not {had}"
    had, has = (sum(x.dof_body[limit.dof] == b for limit in x.limits) for x in (own, other))
    if has != had:
        yield f"{name} has {has} joints with a limit, not {had}"
    shapes = [sorted(w.shape for w in x.watched if w.body == b) for x in (own, other)]
    if shapes[0] != shapes[1]:
        yield f"{name} has other shapes that are watched"


def _named(topology: Topology, body: int) -> str:
    return "the world" if body < 0 else f'"{topology.names[body]}"'
