"""Numbers of a body: everything that may differ between two models of one topology.

Letters: `B` bodies without the world, `N` joints, `C` contacts, `M` limits, `G` watched geoms,
`S` bars and `Q` pairs of them (`Crossings`). Shapes are those of one body; with a body per
lane, the lanes are one more, innermost axis.
"""

import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.overlap import Crossings
from mjxgait.physics.derived import Bars, ObservationLayout, read_bars, resized_bars, whole
from mjxgait.physics.lane_major.lanes import columns, constants
from mjxgait.physics.lane_major.model import (
    Model,
    Softened,
    contact_softness,
    geom_weights,
    limit_softness,
    mixed,
)
from mjxgait.physics.lane_major.topology import Topology, contact_ends, joints_of, limited_joints
from mjxgait.physics.lane_major.treematrix import HINGE, SLIDE, Ends
from mjxgait.types import Number, pytree


@pytree
class Softness:
    """Softness of n constraints (`Softened`): stiffness, damping, margin [n]; impedance [n, 4]."""

    stiffness: Number
    damping: Number
    impedance: Number
    margin: Number


@pytree
class Contacts:
    """Spheres that may touch the floor, z = 0.

    center: [C, 3] m in the body's frame. axis: [C, 3] of the capsule that the sphere ends; MuJoCo
    aligns the friction directions with it; unused for a sphere. radius: [C] m. friction: [C].
    weight: [C] 1/kg, body_invweight0, the inverse mass seen by the contact.
    """

    center: Number
    axis: Number
    radius: Number
    friction: Number
    weight: Number
    softness: Softness


@pytree
class Limits:
    """Ranges of hinges and slides. low, high: [M] rad, m. weight: [M] dof_invweight0."""

    low: Number
    high: Number
    weight: Number
    softness: Softness


@pytree
class Watched:
    """Sensed geoms, each a support function (`geometry.support_extents`).

    pos: [G, 3] m in the body's frame. rot: [G, 3, 3] the geom's axes there. radius: [G] m.
    box, ellipsoid: [G, 3] m.
    """

    pos: Number
    rot: Number
    radius: Number
    box: Number
    ellipsoid: Number


@pytree
class Parameters:
    """All numbers of a body.

    pos: [B, 3] m, rot: [B, 3, 3] axes; of each body's frame in its parent's.
    mass: [B] kg. com: [B, 3] m, inertia: [B, 3] kg·m², axes: [B, 2, 3] the first two principal
      axes; in the body's own frame.
    joint_axis: [N, 3], joint_anchor: [N, 3] m, both in the body's frame. reference: [N] rad, m,
      position of a slide or hinge at rest.
    armature, spring, spring_reference, damping: [nv]; the spring is linear in the position.
    gravity: [3] m/s². density: [] kg/m³, viscosity: [] kg/(m s), of the fluid. impratio: []
      MuJoCo's.
    """

    pos: Number
    rot: Number
    mass: Number
    com: Number
    inertia: Number
    axes: Number
    joint_axis: Number
    joint_anchor: Number
    reference: Number
    armature: Number
    spring: Number
    spring_reference: Number
    damping: Number
    gravity: Number
    density: Number
    viscosity: Number
    impratio: Number
    contacts: Contacts
    limits: Limits
    watched: Watched
    bars: Bars


def read_parameters(
    model: Model, layout: ObservationLayout, crossings: Crossings | None
) -> Parameters:
    """Read the numbers of a model, in NumPy.

    Raises:
      UnsupportedModel: the lane-major physics does not support something that the model uses.
    """
    bodies = range(1, model.nbody)
    joints = [j for b in bodies for j in joints_of(model, b)]
    of_dof, address = model.dof_jntid, model.jnt_qposadr
    off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    return Parameters(
        pos=_snapped(model.body_pos[1:]),
        rot=_turned(model.body_quat[1:]),
        mass=np.array(model.body_mass[1:]),
        com=_snapped(model.body_ipos[1:]),
        inertia=_snapped(model.body_inertia[1:]),
        axes=_turned(model.body_iquat[1:])[:, :2],
        joint_axis=_snapped(model.jnt_axis[joints]).reshape(-1, 3),
        joint_anchor=_snapped(model.jnt_pos[joints]).reshape(-1, 3),
        reference=np.array([_reference(model, j) for j in joints]),
        armature=_snapped(model.dof_armature),
        spring=_snapped(model.jnt_stiffness[of_dof].reshape(-1)),
        spring_reference=_snapped(model.qpos_spring[address[of_dof]]),
        damping=_snapped(model.dof_damping),
        gravity=np.zeros(3) if off else _snapped(model.opt.gravity),
        density=np.array(float(model.opt.density)),
        viscosity=np.array(float(model.opt.viscosity)),
        impratio=np.array(float(model.opt.impratio)),
        contacts=_contacts(model),
        limits=_limits(model),
        watched=_watched(model, layout),
        bars=_bars(crossings),
    )


def _snapped(values: np.ndarray) -> np.ndarray:
    """Make numbers within rounding of -1, 0 and 1 exact, so that they fold as constants."""
    return np.array(constants(np.asarray(values))).reshape(np.shape(values))


def _turned(quats: np.ndarray) -> np.ndarray:
    """Axes [n, 3, 3] of the frames of n quaternions."""
    return np.array([columns(quat) for quat in quats]).reshape(-1, 3, 3)


def _reference(model: Model, joint: int) -> float:
    has_one = model.jnt_type[joint] in (SLIDE, HINGE)
    return float(model.qpos0[model.jnt_qposadr[joint]]) if has_one else 0.0


def _contacts(model: Model) -> Contacts:
    ends = contact_ends(model)
    geoms = [end.geom for end in ends]
    axis = np.array([_long_axis(model, geom) for geom in geoms]).reshape(-1, 3)
    return Contacts(
        center=_snapped(np.array([_center(model, end) for end in ends]).reshape(-1, 3)),
        axis=_snapped(axis),
        radius=np.array(model.geom_size[geoms, 0]),
        friction=np.array([float(mixed(model, end.floor, end.geom)[0]) for end in ends]),
        weight=geom_weights(model, geoms),
        softness=_softness([contact_softness(model, end.floor, end.geom) for end in ends]),
    )


def _center(model: Model, end: Ends) -> np.ndarray:
    half = model.geom_size[end.geom][1] * _long_axis(model, end.geom)
    return model.geom_pos[end.geom] + end.side * half if end.side else model.geom_pos[end.geom]


def _long_axis(model: Model, geom: int) -> np.ndarray:
    return np.array(columns(model.geom_quat[geom]))[2]


def _limits(model: Model) -> Limits:
    joints = limited_joints(model)
    return Limits(
        low=np.array(model.jnt_range[joints, 0]),
        high=np.array(model.jnt_range[joints, 1]),
        weight=np.array(model.dof_invweight0[model.jnt_dofadr[joints]]),
        softness=_softness([limit_softness(model, j) for j in joints]),
    )


def _softness(each: list[Softened]) -> Softness:
    return Softness(
        stiffness=np.array([s.stiffness for s in each]),
        damping=np.array([s.damping for s in each]),
        impedance=np.array([s.impedance for s in each]).reshape(-1, 4),
        margin=np.array([s.margin for s in each]),
    )


def _bars(crossings: Crossings | None) -> Bars:
    bars = read_bars(crossings)
    centre, half = (_snapped(np.asarray(x)) for x in (bars.centre, bars.half))
    return dataclasses.replace(bars, centre=centre, half=half)


def _watched(model: Model, layout: ObservationLayout) -> Watched:
    geoms = [int(g) for g in layout.watched]
    extents = [geometry.support_extents(model.geom_type[g], model.geom_size[g]) for g in geoms]
    radius, box, ellipsoid = (np.array(column) for column in zip(*extents, strict=True))
    return Watched(
        pos=_snapped(model.geom_pos[geoms]),
        rot=_turned(model.geom_quat[geoms]),
        radius=_snapped(radius),
        box=_snapped(box),
        ellipsoid=_snapped(ellipsoid),
    )


def with_length_scale(topology: Topology, parameters: Parameters, factor: Number) -> Parameters:
    """Multiply lengths by factor [B], masses by its cube, inertias by its fifth power.

    The weights are not recomputed yet.
    """
    of_world = jnp.append(jnp.asarray(factor, jnp.float32), 1.0)
    every = of_world[:-1]

    def of(bodies: list[int]) -> Number:
        return of_world[np.array(bodies, int)]

    joints = [b for b, body in enumerate(topology.bodies) for _ in body.joints]
    contact = of([slot.body for slot in topology.contacts])
    seen = of([slot.body for slot in topology.watched])
    old, contacts, watched = parameters, parameters.contacts, parameters.watched
    return dataclasses.replace(
        old,
        pos=old.pos * of([body.parent for body in topology.bodies])[:, None],
        mass=old.mass * every**3,
        com=old.com * every[:, None],
        inertia=old.inertia * every[:, None] ** 5,
        joint_anchor=old.joint_anchor * of(joints)[:, None],
        contacts=dataclasses.replace(
            contacts, center=contacts.center * contact[:, None], radius=contacts.radius * contact
        ),
        watched=dataclasses.replace(
            watched,
            pos=watched.pos * seen[:, None],
            radius=watched.radius * seen,
            box=watched.box * seen[:, None],
            ellipsoid=watched.ellipsoid * seen[:, None],
        ),
        bars=_bars_resized(topology, old.bars, of_world),
    )


def _bars_resized(topology: Topology, old: Bars, of_world: jax.Array) -> Bars:
    if old.body is None or old.first is None or old.second is None:
        factor = of_world[np.array(topology.bar_body, int)]
        return resized_bars(old, topology.first, topology.second, factor)
    return resized_bars(old, old.first, old.second, of_world[whole(old.body)])
