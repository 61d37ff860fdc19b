"""Forces of a fluid at rest on bodies that move in it: MuJoCo's inertia-box model.

Each body counts as a box of its own mass and inertia, about its centre of mass and along its
principal axes. Viscosity acts as on a sphere of the box's mean side, density as on the box's faces
(MuJoCo documentation, "Computation", "Fluid forces", "Inertia model"). There is no lift, and
no buoyancy (which is zero without gravity).
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.physics.lane_major.dynamics import (
    Inertia,
    by_dof,
    pack,
    unpack,
    up,
)
from mjxgait.physics.lane_major.kinematics import Motion, Pose
from mjxgait.physics.lane_major.lanes import (
    Pin,
    Vector,
    cross,
    dot,
    plus,
    scale,
    table,
    total,
    turn_each,
)
from mjxgait.physics.lane_major.structure import Structure
from mjxgait.types import Number


def fluid_force(
    structure: Structure,
    poses: Sequence[Pose],
    body: Inertia,
    freedom: Motion,
    moving: Sequence[jax.Array],
    pin: Pin,
) -> jax.Array:
    """Generalised force [nv, L] of the fluid.

    freedom, moving: from `motions` and `bias_force`.
    """
    x, velocity = structure.columns, unpack(pin(jnp.stack(moving)))
    frame = principal_axes(structure, poses, velocity.spin[0], pin)
    centre = scale(1 / at_least(x.mass, mujoco.mjMINVAL), body.moment)
    drift = plus(velocity.shift, cross(velocity.spin, centre))
    spin, slide = (tuple(dot(axis, v) for axis in frame) for v in (velocity.spin, drift))
    moment, force = box_resistance(
        box_sides(x.mass, x.inertia), x.density, x.viscosity, spin, slide
    )
    torque, push = (
        tuple(total([along[j] * frame[j][i] for j in range(3)]) for i in range(3))
        for along in (moment, force)
    )
    wrench = [*plus(torque, cross(centre, push)), *push]
    gathered = by_dof(structure, up(structure, pack(wrench, pin), pin), pin)
    return dot(freedom.parts, unpack(gathered).parts)


def principal_axes(
    structure: Structure, poses: Sequence[Pose], like: jax.Array, pin: Pin
) -> tuple[Vector, Vector, Vector]:
    """Every body's three principal axes in the world, components [B, L] each."""
    rot = [pin(table([pose.rot[j] for pose in poses], like)) for j in range(3)]
    first, second = (turn_each(rot, structure.columns.axes[:, n]) for n in (0, 1))
    return first, second, cross(first, second)


def box_sides(mass: Number, inertia: Number) -> tuple[Number, Number, Number]:
    """Sides in m of boxes of masses [B, 1 or L] and inertias [B, 3, 1 or L]."""

    def side(j: int) -> Number:
        left = inertia.sum(1) - 2 * inertia[:, j]
        return (6 * at_least(left, mujoco.mjMINVAL) / at_least(mass, mujoco.mjMINVAL)) ** 0.5

    return side(0), side(1), side(2)


def at_least(number: Number, least: float) -> Number:
    """Return the larger number, a constant for constants."""
    larger = np.maximum if isinstance(number, np.ndarray) else jnp.maximum
    return larger(number, least)


def box_resistance(
    sides: Sequence[Number], density: Number, viscosity: Number, spin: Vector, slide: Vector
) -> tuple[Vector, Vector]:
    """Moment and force on boxes along their own axes.

    spin, slide: rad/s and m/s along the same axes. density: kg/m³. viscosity: kg/(m s).
    """
    a, b, c = sides
    diameter = (a + b + c) / 3
    roll, drag = np.pi * diameter**3 * viscosity, 3 * np.pi * diameter * viscosity
    faces = (b * c, a * c, a * b)
    levers = (a * (b**4 + c**4), b * (a**4 + c**4), c * (a**4 + b**4))

    def against(v: jax.Array, linear: Number, square: Number) -> jax.Array:
        return v * -(linear + square * density * jnp.abs(v))

    mx, my, mz = (against(v, roll, lever / 64) for v, lever in zip(spin, levers, strict=True))
    fx, fy, fz = (against(v, drag, face / 2) for v, face in zip(slide, faces, strict=True))
    return (mx, my, mz), (fx, fy, fz)
