"""The reference plant: MJX's own functions, one step split around the controller, mapped over lanes in front."""

import contextlib
import dataclasses
import io
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.overlap import Crossings
from mjxgait.physics.layout import SenseLayout
from mjxgait.physics.overlap import deepest
from mjxgait.types import BodyState, Sensed

with contextlib.redirect_stdout(
    io.StringIO()
):  # MJX prints that Warp, which nobody asked for, is not installed
    from mujoco import mjx


@dataclasses.dataclass(frozen=True, eq=False)
class MjxPlant:
    """Plain MJX behind the `Plant` protocol.

    Attributes:
      model, data: of MJX; data is the template whose state each lane replaces.
      layout: which parts of the model are sensed.
      reach: r [G], b [G, 3], e [G, 3] of the watched geoms' support functions.
      crossings: which parts may be in each other; None looks at none.
      note: see `Plant.note`.
    """

    model: mjx.Model
    data: mjx.Data
    layout: SenseLayout
    reach: tuple[np.ndarray, np.ndarray, np.ndarray]
    crossings: Crossings | None = None
    note: str = ""
    lane_axis: int = 0

    def forward(self, state: BodyState) -> tuple[Sensed, Any]:
        """See `Plant.forward`."""
        return jax.vmap(self._forward)(state)

    def solve_damped(self, workings: Any, damping: jax.Array, force: jax.Array) -> jax.Array:
        """See `Plant.solve_damped`."""

        def solve(data: mjx.Data, damping: jax.Array, rhs: jax.Array) -> jax.Array:
            mass = mjx.full_m(self.model, data) + jnp.diag(damping)
            return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(mass), rhs)

        return jax.vmap(solve)(workings, damping, force)

    def advance(self, state: BodyState, workings: Any, torque: jax.Array) -> BodyState:
        """See `Plant.advance`."""
        return jax.vmap(self._advance)(state, workings, torque)

    def overlap(self, state: BodyState) -> jax.Array:
        """See `Plant.overlap`."""
        if self.crossings is None or not len(self.crossings.first):
            return jnp.full_like(state.friction, -jnp.inf)
        return jax.vmap(partial(self._overlap, self.crossings))(state.qpos)

    def _overlap(self, crossings: Crossings, qpos: jax.Array) -> jax.Array:
        data = mjx.kinematics(self.model, self.data.replace(qpos=qpos))
        rot = data.xmat[crossings.body]
        centre, half = (
            jnp.einsum("sij,sj->si", rot, np.float32(x)) for x in (crossings.centre, crossings.half)
        )
        return deepest(crossings, data.xpos[crossings.body] + centre, half)

    def _with_friction(self, friction: jax.Array) -> mjx.Model:
        return self.model.replace(
            geom_friction=self.model.geom_friction * jnp.stack([friction, 1.0, 1.0])
        )

    def _forward(self, state: BodyState) -> tuple[Sensed, mjx.Data]:
        model = self._with_friction(state.friction)
        data = self.data.replace(qpos=state.qpos, qvel=state.qvel, qacc_warmstart=state.warmstart)
        data = mjx.fwd_velocity(model, mjx.fwd_position(model, data))
        layout = self.layout
        offset = data.xpos[layout.trunk] - data.subtree_com[self.model.body_rootid[layout.trunk]]
        spin, shift = data.cvel[layout.trunk, :3], data.cvel[layout.trunk, 3:]
        sensed = Sensed(
            joint_pos=data.qpos[layout.qpos_adr],
            joint_vel=data.qvel[layout.dof_adr],
            bias=data.qfrc_bias - data.qfrc_passive,
            trunk_pos=data.xpos[layout.trunk],
            trunk_rot=data.xmat[layout.trunk],
            trunk_vel=shift + jnp.cross(spin, offset),
            trunk_angvel=spin,
            geom_pos=data.geom_xpos[layout.watched],
            geom_low=self._lowest(data.geom_xpos[layout.watched], data.geom_xmat[layout.watched]),
        )
        return sensed, data

    def _lowest(self, pos: jax.Array, rot: jax.Array) -> jax.Array:
        r, box, ellipsoid = self.reach
        down = rot[:, 2, :]
        return (
            pos[:, 2]
            - r
            - jnp.sum(jnp.abs(down) * box, axis=1)
            - jnp.linalg.norm(down * ellipsoid, axis=1)
        )

    def _advance(self, state: BodyState, data: mjx.Data, torque: jax.Array) -> BodyState:
        model = self._with_friction(state.friction)
        data = mjx.fwd_acceleration(model, data.replace(qfrc_applied=torque))
        touches = data._impl.efc_J.size > 0
        data = mjx.solve(model, data) if touches else data.replace(qacc=data.qacc_smooth)
        data = mjx.euler(model, data)
        return BodyState(
            data.qpos, data.qvel, data.qacc_warmstart, data.qfrc_constraint, state.friction
        )


def mjx_plant(
    model: mujoco.MjModel,
    layout: SenseLayout,
    crossings: Crossings | None = None,
    note: str = "",
) -> MjxPlant:
    """A plant for any model that MJX accepts.

    Raises:
      NotImplementedError: MJX's own words on what it does not support.
    """
    device_model = mjx.put_model(model, impl="jax")
    data = mjx.make_data(device_model, impl="jax")
    extents = [
        geometry.support_extents(model.geom_type[g], model.geom_size[g]) for g in layout.watched
    ]
    r, box, ellipsoid = (np.array(column, np.float32) for column in zip(*extents, strict=True))
    return MjxPlant(device_model, data, layout, (r, box, ellipsoid), crossings, note)
