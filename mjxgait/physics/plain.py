"""The reference plant: MJX's own functions, mapped over lanes in front.

One step is split around the controller.
"""

import dataclasses
from typing import Any, Self

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.creature.overlap import Crossings
from mjxgait.physics.layout import OtherTopology, SenseLayout
from mjxgait.physics.overlap import deepest, single
from mjxgait.physics.plain_numbers import (
    ModelNumbers,
    heavier,
    mjx,
    model_difference,
    read_numbers,
    reweighed,
)
from mjxgait.types import BodyState, Number, Sensed


@dataclasses.dataclass(frozen=True, eq=False)
class MjxPlant:
    """Plain MJX behind the `Plant` protocol.

    Attributes:
      model, data: of MJX; data is the template whose state each lane replaces.
      layout: which parts of the model are sensed.
      parameters: of the body that all lanes have.
      crossings: which parts may be in each other; None looks at none.
      note: see `Plant.note`.
    """

    model: mjx.Model
    data: mjx.Data
    layout: SenseLayout
    parameters: ModelNumbers
    crossings: Crossings | None = None
    note: str = ""
    lane_axis: int = 0

    def parameters_of(
        self, model: mujoco.MjModel, layout: SenseLayout, crossings: Crossings | None = None
    ) -> ModelNumbers:
        """See `Plant.parameters_of`."""
        device_model = mjx.put_model(model, impl="jax")
        told = model_difference(self.model, device_model)
        told = told or _sense_difference(self.layout, layout, self.crossings, crossings)
        if told:
            raise OtherTopology(told)
        # In NumPy, for arrays of MJX belong to one device.
        return jax.device_get(read_numbers(model, device_model, layout, crossings))

    def with_parameters(self, parameters: ModelNumbers) -> Self:
        """See `Plant.with_parameters`."""
        return dataclasses.replace(self, parameters=parameters)

    def heavier(self, parameters: ModelNumbers, factor: Number) -> ModelNumbers:
        """See `Plant.heavier`."""
        return reweighed(self.model, self.data, heavier(parameters, factor))

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
        crossings = self.crossings
        if crossings is None or not len(crossings.first):
            return jnp.full_like(state.friction, -jnp.inf)
        return jax.vmap(lambda state: self._overlap(state, crossings))(state)

    def _overlap(self, state: BodyState, crossings: Crossings) -> jax.Array:
        numbers = self._numbers(state)
        data = mjx.kinematics(numbers.put_in(self.model), self.data.replace(qpos=state.qpos))
        rot, bars = data.xmat[crossings.body], numbers.bars
        centre, half = (jnp.einsum("sij,sj->si", rot, single(x)) for x in (bars.centre, bars.half))
        middle = data.xpos[crossings.body] + centre
        return deepest(crossings.first, crossings.second, bars, middle, half)

    def _numbers(self, state: BodyState) -> ModelNumbers:
        """Of this lane's body: its own, or the plant's."""
        return self.parameters if state.parameters is None else state.parameters

    def _model(self, state: BodyState) -> mjx.Model:
        model = self._numbers(state).put_in(self.model)
        return model.replace(
            geom_friction=model.geom_friction * jnp.stack([state.friction, 1.0, 1.0])
        )

    def _forward(self, state: BodyState) -> tuple[Sensed, mjx.Data]:
        model = self._model(state)
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
            geom_low=_lowest(
                self._numbers(state), data.geom_xpos[layout.watched], data.geom_xmat[layout.watched]
            ),
        )
        return sensed, data

    def _advance(self, state: BodyState, data: mjx.Data, torque: jax.Array) -> BodyState:
        model = self._model(state)
        data = mjx.fwd_acceleration(model, data.replace(qfrc_applied=torque))
        touches = data._impl.efc_J.size > 0
        data = mjx.solve(model, data) if touches else data.replace(qacc=data.qacc_smooth)
        data = mjx.euler(model, data)
        return BodyState(
            data.qpos,
            data.qvel,
            data.qacc_warmstart,
            data.qfrc_constraint,
            state.friction,
            state.parameters,
        )


def _lowest(numbers: ModelNumbers, pos: jax.Array, rot: jax.Array) -> jax.Array:
    """[G] m of geoms at these places, by their support functions."""
    down = rot[:, 2, :]
    return (
        pos[:, 2]
        - numbers.radius
        - jnp.sum(jnp.abs(down) * numbers.box, axis=1)
        - jnp.linalg.norm(down * numbers.ellipsoid, axis=1)
    )


def _sense_difference(
    own: SenseLayout, other: SenseLayout, pairs: Crossings | None, others: Crossings | None
) -> str:
    """The first thing that is looked at elsewhere; empty if there is none."""
    for field in dataclasses.fields(SenseLayout):
        if not np.array_equal(getattr(own, field.name), getattr(other, field.name)):
            return f"other parts of it are sensed ({field.name})"
    for name in ("body", "first", "second"):
        mine, theirs = ([] if x is None else getattr(x, name) for x in (pairs, others))
        if not np.array_equal(mine, theirs):
            return "other pairs of its parts are watched for overlap"
    return ""


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
    numbers = read_numbers(model, device_model, layout, crossings)
    return MjxPlant(device_model, data, layout, numbers, crossings, note)
