"""Differences of two topologies, in words."""

import dataclasses
from collections.abc import Iterator

from mjxgait.physics.lane_major.slots import (
    BALL,
    FREE,
    HINGE,
    SLIDE,
)
from mjxgait.physics.lane_major.topology import Topology

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
