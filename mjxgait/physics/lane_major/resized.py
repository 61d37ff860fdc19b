"""Numbers of a body with scaled parts, for the lane-major physics."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.physics.lane_major.parameters import Parameters
from mjxgait.physics.lane_major.topology import Topology
from mjxgait.physics.overlap import Bars, resized_bars, whole
from mjxgait.types import Number


def resized(topology: Topology, parameters: Parameters, factor: Number) -> Parameters:
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
        bars=_bars(topology, old.bars, of_world),
    )


def _bars(topology: Topology, old: Bars, of_world: jax.Array) -> Bars:
    if old.body is None or old.first is None or old.second is None:
        factor = of_world[np.array(topology.bar_body, int)]
        return resized_bars(old, topology.first, topology.second, factor)
    return resized_bars(old, old.first, old.second, of_world[whole(old.body)])
