"""Poses of the bodies, and motions of their degrees of freedom.

All quantities are in axes parallel to the world's. The origin is the root body's own position (the
world's if the root is not free), so that float32 stays exact however far a creature has walked.
Vectors are arrays [3, L], or constants.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.physics.derived import single, whole
from mjxgait.physics.lane_major.lanes import (
    Column,
    Pin,
    Scalar,
    Vector,
    add,
    axes,
    cross,
    mul,
    pinned_by,
    plus,
    rotation,
    scale,
    sin_cos,
    sub,
    table,
    turn,
)
from mjxgait.physics.lane_major.structure import Body, Joint, Structure, scalars
from mjxgait.physics.lane_major.treematrix import BALL, FREE, HINGE, SLIDE
from mjxgait.types import Number

UNITS: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
IDENTITY: tuple[np.ndarray, ...] = tuple(
    np.eye(3, dtype=np.float32)[:, j : j + 1] for j in range(3)
)


@dataclasses.dataclass(frozen=True)
class Pose:
    """Pose of a body.

    origin: of its tree, in the world. pos: from the origin to the body frame. rot: the frame's
    three axes.
    """

    origin: Column
    pos: Column
    rot: tuple[Column, ...]

    def point(self, local: Vector) -> Column:
        """A point of the body, from the origin."""
        return add(self.pos, turn(self.rot, local))

    def far_point(self, local: Vector) -> Column:
        """A point of the body in the world."""
        return add(self.origin, self.point(local))


WORLD = Pose(0.0, 0.0, IDENTITY)


@dataclasses.dataclass(frozen=True)
class Freedom:
    """Degree of freedom: a turn about `axis` through `anchor`, or a shift along `slide`.

    The other fields are zero.
    """

    axis: Column = 0.0
    anchor: Column = 0.0
    slide: Column = 0.0


@dataclasses.dataclass(frozen=True)
class Motion:
    """Velocities of one body or of n. spin: angular; shift: of the body's point at the origin."""

    spin: tuple[Scalar, Scalar, Scalar]
    shift: tuple[Scalar, Scalar, Scalar]

    @property
    def parts(self) -> tuple[Scalar, ...]:
        """All six components."""
        return (*self.spin, *self.shift)


def posture(structure: Structure, qpos: jax.Array, pin: Pin) -> tuple[list[Pose], list[Freedom]]:
    """Forward kinematics of qpos [nq, L]: pose of every body, and every degree of freedom."""
    poses: list[Pose] = []
    freedoms: list[Freedom] = []
    for body in structure.bodies:
        pose = _placed(body, WORLD if body.parent < 0 else poses[body.parent])
        for joint in body.joints:
            pose, own = _MOVES[joint.kind](joint, _pinned(pose, pin), qpos, pin)
            freedoms.extend(own)
        poses.append(_pinned(pose, pin))
    return poses, freedoms


def motions(freedoms: Sequence[Freedom], like: jax.Array, pin: Pin) -> Motion:
    """Motion that each degree of freedom gives its body and all below at unit velocity.

    Components [nv, L].
    """
    axis, anchor, slide = (
        table([getattr(f, part) for f in freedoms], like) for part in ("axis", "anchor", "slide")
    )
    axis = pin(axis)
    shift = plus(cross(axes(anchor), axes(axis)), axes(slide))
    return Motion(axes(axis), pin(shift))


def _pinned(pose: Pose, pin: Pin) -> Pose:
    return Pose(pose.origin, pin(pose.pos), pin(pose.rot))


def _placed(body: Body, parent: Pose) -> Pose:
    return Pose(
        parent.origin,
        parent.point(body.pos),
        tuple(turn(parent.rot, column) for column in body.rot),
    )


def unit_quaternion(quat: jax.Array | Sequence[jax.Array]) -> tuple[jax.Array, ...]:
    """Normalise a quaternion (w, x, y, z)."""
    norm = jnp.sqrt(quat[0] * quat[0] + quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3])
    return tuple(q / norm for q in quat)


def _free(joint: Joint, pose: Pose, qpos: jax.Array, pin: Pin) -> tuple[Pose, list[Freedom]]:
    q = joint.qpos
    rot = tuple(jnp.stack(pin(column)) for column in rotation(unit_quaternion(qpos[q + 3 : q + 7])))
    shifts = [Freedom(slide=axis[:, 0]) for axis in IDENTITY]
    return Pose(qpos[q : q + 3], 0.0, rot), [*shifts, *(Freedom(axis=axis) for axis in rot)]


def _ball(joint: Joint, pose: Pose, qpos: jax.Array, pin: Pin) -> tuple[Pose, list[Freedom]]:
    anchor = pin(pose.point(joint.anchor))
    own = pin(rotation(unit_quaternion(qpos[joint.qpos : joint.qpos + 4])))
    rot = pin(tuple(turn(pose.rot, column) for column in own))
    return Pose(pose.origin, sub(anchor, turn(rot, joint.anchor)), rot), [
        Freedom(axis=axis, anchor=anchor) for axis in rot
    ]


def _hinge(joint: Joint, pose: Pose, qpos: jax.Array, pin: Pin) -> tuple[Pose, list[Freedom]]:
    anchor, axis = pin((pose.point(joint.anchor), turn(pose.rot, joint.axis)))
    angle = qpos[joint.qpos] - joint.reference
    sin, cos = pin(sin_cos(angle))
    rot = tuple(turn(pose.rot, column) for column in _about(joint.axis, sin, cos))
    return Pose(pose.origin, sub(anchor, turn(rot, joint.anchor)), rot), [
        Freedom(axis=axis, anchor=anchor)
    ]


def _slide(joint: Joint, pose: Pose, qpos: jax.Array, pin: Pin) -> tuple[Pose, list[Freedom]]:
    axis = pin(turn(pose.rot, joint.axis))
    travel = qpos[joint.qpos] - joint.reference
    return Pose(pose.origin, add(pose.pos, mul(axis, travel)), pose.rot), [Freedom(slide=axis)]


_MOVES = {FREE: _free, BALL: _ball, HINGE: _hinge, SLIDE: _slide}


def _about(axis: Vector, sin: jax.Array, cos: jax.Array) -> list[tuple[Scalar, ...]]:
    """Rotation about a unit axis (Rodrigues), as columns.

    cos 1 + sin [axis]x + (1 - cos) axis axis^T
    """

    def column(unit: Vector, along: Scalar) -> tuple[Scalar, ...]:
        skew = cross(axis, unit)
        outer = scale(along, axis)
        return tuple(
            add(outer[i], mul(sub(unit[i], outer[i]), cos), mul(skew[i], sin)) for i in range(3)
        )

    return [column(unit, axis[j]) for j, unit in enumerate(UNITS)]


def bar_places(
    structure: Structure, qpos: jax.Array, like: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Each bar's middle, from its tree's origin, and from there to one end: [S, 3, L] m.

    Args:
      qpos: [nq, L]. like: any finite [L].
    """
    poses, _ = posture(structure, qpos, pinned_by(like))
    if structure.topology.open_pairs:
        return _looked_up(structure, poses, like)
    bodies = [poses[body] for body in structure.topology.bar_body]
    bars = structure.exact.bars
    middles = zip(bodies, scalars(bars.centre), strict=True)
    ends = zip(bodies, scalars(bars.half), strict=True)
    return (
        table([pose.point(local) for pose, local in middles], like),
        table([turn(pose.rot, local) for pose, local in ends], like),
    )


def _looked_up(
    structure: Structure, poses: Sequence[Pose], like: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Look up the places of bars with body indices that are numbers of the program."""
    bars = structure.exact.bars
    assert bars.body is not None
    body = whole(bars.body[..., 0])
    places = table([pose.pos for pose in poses], like)[body]
    axes = [table([pose.rot[j] for pose in poses], like)[body] for j in range(3)]

    def turned(local: Number) -> jax.Array:
        x, y, z = (single(local[:, j, None]) for j in range(3))
        return axes[0] * x + axes[1] * y + axes[2] * z

    return places + turned(bars.centre), turned(bars.half)
