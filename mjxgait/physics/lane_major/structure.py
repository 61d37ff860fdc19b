"""Body as the equations read it: its topology joined with its numbers.

A number is a Python float if it is a constant of the program (zeros and ones then cost nothing,
see `lanes`). Otherwise it is an array: [1] for all lanes, [L] with a body per lane.
"""

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.creature import geometry
from mjxgait.physics.lane_major.lanes import Scalar, Vector
from mjxgait.physics.lane_major.parameters import Parameters
from mjxgait.physics.lane_major.topology import Topology
from mjxgait.physics.lane_major.treematrix import ANY, Carriers, ContactSlot, LimitSlot, Sparsity
from mjxgait.types import Number

Frame = tuple[Vector, ...]
"""Axes, each a vector."""


@dataclasses.dataclass(frozen=True)
class Joint:
    """Joint: see `JointSlot` and `Parameters`; axis, anchor: in the body's frame."""

    kind: int
    qpos: int
    dof: int
    axis: Vector
    anchor: Vector
    reference: Scalar


@dataclasses.dataclass(frozen=True)
class Body:
    """Body. parent: index among the bodies, -1 for the world. pos, rot: in the parent's frame."""

    parent: int
    pos: Vector
    rot: Frame
    joints: tuple[Joint, ...]


@dataclasses.dataclass(frozen=True)
class Geom:
    """Watched geom: its body (-1: world), its place there, and its support function."""

    body: int
    pos: Vector
    rot: Frame
    radius: Scalar
    box: Vector
    ellipsoid: Vector


@dataclasses.dataclass(frozen=True, eq=False)
class Structure:
    """Topology joined with numbers; made by `join`.

    columns: all numbers with an axis of lanes, 1 or L long, in the precision of the states; NumPy
      if constant.
    exact: the same, constants in double precision.
    """

    topology: Topology
    columns: Parameters
    exact: Parameters

    @property
    def pattern(self) -> Sparsity:
        """Sparsity of the mass matrix."""
        return self.topology.pattern

    @property
    def carriers(self) -> Carriers:
        """Part of the tree that moves contacts."""
        return self.topology.carriers

    @property
    def contacts(self) -> tuple[ContactSlot, ...]:
        """Contacts, in the order of their bodies."""
        return self.topology.contacts

    @property
    def iterations(self) -> int:
        """Maximum number of iterations of the contact solver."""
        return self.topology.iterations

    @property
    def line_iterations(self) -> int:
        """Maximum number of steps of its line search."""
        return self.topology.line_iterations

    @property
    def limits(self) -> tuple[LimitSlot, ...]:
        """Limits of hinges and slides."""
        return self.topology.limits

    @functools.cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Bodies, parents first."""
        x, joints = self.exact, iter(self._joints())
        return tuple(
            Body(
                slot.parent,
                scalars(x.pos[b]),
                scalars(x.rot[b]),
                tuple(next(joints) for _ in slot.joints),
            )
            for b, slot in enumerate(self.topology.bodies)
        )

    @property
    def gravity(self) -> Vector:
        """Gravity in m/s²."""
        x, y, z = scalars(self.exact.gravity)
        return x, y, z

    @property
    def impratio(self) -> Scalar:
        """MuJoCo's ratio of frictional to normal impedance."""
        return scalars(self.exact.impratio)

    def _joints(self) -> tuple[Joint, ...]:
        x = self.exact
        return tuple(
            Joint(
                slot.kind,
                slot.qpos,
                slot.dof,
                axis=scalars(x.joint_axis[n]),
                anchor=scalars(x.joint_anchor[n]),
                reference=scalars(x.reference[n]),
            )
            for n, slot in enumerate(self.topology.joints)
        )

    @functools.cached_property
    def geoms(self) -> tuple[Geom, ...]:
        """Watched geoms; extents that a shape does not have are zero."""
        x = self.exact.watched
        return tuple(
            Geom(
                slot.body,
                scalars(x.pos[g]),
                scalars(x.rot[g]),
                *_extents(
                    slot.shape, scalars(x.radius[g]), scalars(x.box[g]), scalars(x.ellipsoid[g])
                ),
            )
            for g, slot in enumerate(self.topology.watched)
        )


def join(
    topology: Topology, parameters: Parameters, dtype: np.dtype, per_lane: bool = False
) -> Structure:
    """Join a topology with numbers.

    per_lane: whether the last axis of the numbers is the lanes; then they are no constants.
    """

    def columned(number: Number, precision: np.dtype | None = None) -> Number:
        if per_lane:
            return jnp.asarray(number, dtype)
        constant = isinstance(number, np.ndarray)
        return (np.asarray(number, precision) if constant else number)[..., None]

    exact = jax.tree.map(columned, parameters)
    columns = jax.tree.map(lambda number: columned(number, dtype), parameters)
    return Structure(topology, columns, exact)


def _extents(
    shape: int, radius: Scalar, box: Vector, ellipsoid: Vector
) -> tuple[Scalar, Vector, Vector]:
    """Set what a shape does not have to a plain zero, so that it folds."""
    if shape == ANY:
        return radius, box, ellipsoid
    has_radius, has_box, has_ellipsoid = geometry.support_extents(shape, np.ones(3))

    def kept(values: Vector, has: np.ndarray) -> Vector:
        x, y, z = (value if there else 0.0 for value, there in zip(values, has, strict=True))
        return x, y, z

    return radius if has_radius else 0.0, kept(box, has_box), kept(ellipsoid, has_ellipsoid)


def scalars(numbers: Number) -> Any:
    """Convert numbers [..., 1 or L] to nested tuples of scalars, the last axis but L innermost."""
    if np.ndim(numbers) > 1:
        return tuple(scalars(numbers[n]) for n in range(numbers.shape[0]))
    return float(numbers[0]) if isinstance(numbers, np.ndarray) else numbers
