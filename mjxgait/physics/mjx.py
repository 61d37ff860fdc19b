"""Reference plant: MJX's own functions, mapped over lanes in front.

One step is split around the controller.
"""

import dataclasses
from typing import Self

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.creature.ground.surface import (
    Ground,
    clearance,
    contact,
    height,
    pulled,
)
from mjxgait.creature.overlap import Crossings
from mjxgait.physics.derived import ObservationLayout, OtherTopology, deepest, single
from mjxgait.physics.mjx_parameters import (
    ModelNumbers,
    mjx,
    model_difference,
    read_numbers,
    reweighed,
    with_length_scale,
    with_mass_scale,
)
from mjxgait.types import BodyState, Number, Sensed

GEOM = mujoco.mjtGeom


@dataclasses.dataclass(frozen=True, eq=False)
class MjxPlant:
    """Plain MJX behind the `Plant` protocol.

    Attributes:
      model, data: of MJX; each lane replaces the state of data.
      layout: the parts of the model that are sensed.
      parameters: of the body that all lanes share.
      crossings: the pairs of parts to check for overlap; None checks none.
      note: see `Plant.note`.
    """

    model: mjx.Model
    data: mjx.Data
    layout: ObservationLayout
    parameters: ModelNumbers
    crossings: Crossings | None = None
    note: str = ""
    lane_axis: int = 0

    def parameters_of(
        self, model: mujoco.MjModel, layout: ObservationLayout, crossings: Crossings | None = None
    ) -> ModelNumbers:
        """See `ModelPlant.parameters_of`."""
        device_model = mjx.put_model(model, impl="jax")
        reason = model_difference(self.model, device_model)
        reason = reason or _sense_difference(self.layout, layout, self.crossings, crossings)
        if reason:
            raise OtherTopology(reason)
        # In NumPy, because an array of MJX belongs to one device.
        return jax.device_get(read_numbers(model, device_model, layout, crossings))

    def with_parameters(self, parameters: ModelNumbers) -> Self:
        """See `ModelPlant.with_parameters`."""
        return dataclasses.replace(self, parameters=parameters)

    def with_mass_scale(self, parameters: ModelNumbers, factor: Number) -> ModelNumbers:
        """See `ModelPlant.with_mass_scale`."""
        return reweighed(self.model, self.data, with_mass_scale(parameters, factor))

    def with_length_scale(self, parameters: ModelNumbers, factor: Number) -> ModelNumbers:
        """See `ModelPlant.with_length_scale`."""
        large = with_length_scale(self.model, self.layout, self.crossings, parameters, factor)
        return reweighed(self.model, self.data, large)

    def forward(self, state: BodyState) -> tuple[Sensed, mjx.Data]:
        """See `Plant.forward`."""
        return jax.vmap(self._forward)(state)

    def solve_damped(self, step_data: mjx.Data, damping: jax.Array, force: jax.Array) -> jax.Array:
        """See `Plant.solve_damped`."""

        def solve(data: mjx.Data, damping: jax.Array, rhs: jax.Array) -> jax.Array:
            mass = mjx.full_m(self.model, data) + jnp.diag(damping)
            return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(mass), rhs)

        return jax.vmap(solve)(step_data, damping, force)

    def advance(self, state: BodyState, step_data: mjx.Data, torque: jax.Array) -> BodyState:
        """See `Plant.advance`."""
        return jax.vmap(self._advance)(state, step_data, torque)

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
        """Numbers of this lane's body: its own, or the plant's."""
        return self.parameters if state.parameters is None else state.parameters

    def _model(self, state: BodyState) -> mjx.Model:
        model = self._numbers(state).put_in(self.model)
        gravity = jnp.stack(pulled(state.ground, tuple(model.opt.gravity)))
        return model.replace(
            geom_friction=model.geom_friction * jnp.stack([state.friction, 1.0, 1.0]),
            opt=model.opt.replace(gravity=gravity),
        )

    def _forward(self, state: BodyState) -> tuple[Sensed, mjx.Data]:
        model = self._model(state)
        data = self.data.replace(qpos=state.qpos, qvel=state.qvel, qacc_warmstart=state.warmstart)
        data = mjx.fwd_position(model, data)
        if state.ground is not None:
            data = mjx.make_constraint(model, self._laid(model, data, state.ground))
        data = mjx.fwd_velocity(model, data)
        layout = self.layout
        trunk = data.xpos[layout.trunk]
        offset = trunk - data.subtree_com[self.model.body_rootid[layout.trunk]]
        spin, shift = data.cvel[layout.trunk, :3], data.cvel[layout.trunk, 3:]
        sensed = Sensed(
            joint_pos=data.qpos[layout.qpos_adr],
            joint_vel=data.qvel[layout.dof_adr],
            bias=data.qfrc_bias - data.qfrc_passive,
            trunk_pos=trunk,
            trunk_rot=data.xmat[layout.trunk],
            trunk_vel=shift + jnp.cross(spin, offset),
            trunk_angvel=spin,
            geom_pos=data.geom_xpos[layout.watched],
            geom_low=self._lows(state, data),
            floor=None if state.ground is None else height(state.ground, *trunk[:2]),
        )
        return sensed, data

    def _lows(self, state: BodyState, data: mjx.Data) -> jax.Array:
        """Heights [G] m of the watched geoms above the ground."""
        numbers, watched = self._numbers(state), self.layout.watched
        pos, rot = data.geom_xpos[watched], data.geom_xmat[watched]
        if state.ground is None:
            return _lowest(numbers, pos, rot)
        x, y, z = _cores(numbers, pos, rot).T
        return clearance(state.ground, x, y, z, numbers.radius)

    def _laid(self, model: mjx.Model, data: mjx.Data, ground: Ground) -> mjx.Data:
        """Move the contacts with the floor onto the ground.

        MJX found each contact with the plane z = 0. The centre of a sphere, or a corner of a geom
        without a radius, lies above the contact's middle by the radius plus half the distance.
        """
        touching = data._impl.contact
        one, other = touching.geom.T
        types, round_ones = np.asarray(model.geom_type), (GEOM.mjGEOM_SPHERE, GEOM.mjGEOM_CAPSULE)
        on_floor = jnp.asarray(types == GEOM.mjGEOM_PLANE)[one]
        radius = jnp.where(jnp.asarray(np.isin(types, round_ones)), model.geom_size[:, 0], 0)[other]
        up = radius + 0.5 * touching.dist
        x, y, z = (touching.pos + up[:, None] * jnp.array([0.0, 0.0, 1.0])).T
        found = contact(ground, x, y, z, radius)
        frame = jnp.stack([jnp.stack(axis, 1) for axis in found[1:]], 1)
        deep = (radius + 0.5 * found.distance)[:, None]
        middle = jnp.stack([x, y, z], 1) - deep * frame[:, 0]
        moved = touching.replace(
            dist=jnp.where(on_floor, found.distance, touching.dist),
            pos=jnp.where(on_floor[:, None], middle, touching.pos),
            frame=jnp.where(on_floor[:, None, None], frame, touching.frame),
        )
        return data.tree_replace({"_impl.contact": moved})

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
            state.ground,
        )


def _lowest(numbers: ModelNumbers, pos: jax.Array, rot: jax.Array) -> jax.Array:
    """Heights [G] m of geoms at these places, by their support functions."""
    down = rot[:, 2, :]
    return (
        pos[:, 2]
        - numbers.radius
        - jnp.sum(jnp.abs(down) * numbers.box, axis=1)
        - jnp.linalg.norm(down * numbers.ellipsoid, axis=1)
    )


def _cores(numbers: ModelNumbers, pos: jax.Array, rot: jax.Array) -> jax.Array:
    """Lowest points [G, 3] m of geoms at these places without their radii."""
    down = rot[:, 2, :]
    stretched = down * numbers.ellipsoid
    reach = jnp.maximum(jnp.linalg.norm(stretched, axis=1, keepdims=True), 1e-6)
    own = jnp.sign(down) * numbers.box + stretched * numbers.ellipsoid / reach
    return pos - jnp.einsum("gij,gj->gi", rot, own)


def _sense_difference(
    own: ObservationLayout,
    other: ObservationLayout,
    pairs: Crossings | None,
    others: Crossings | None,
) -> str:
    """Describe the first difference in what is sensed or watched for overlap; empty if none."""
    for field in dataclasses.fields(ObservationLayout):
        if not np.array_equal(getattr(own, field.name), getattr(other, field.name)):
            return f"other parts of it are sensed ({field.name})"
    for name in ("body", "first", "second"):
        mine, theirs = ([] if x is None else getattr(x, name) for x in (pairs, others))
        if not np.array_equal(mine, theirs):
            return "other pairs of its parts are watched for overlap"
    return ""


def mjx_plant(
    model: mujoco.MjModel,
    layout: ObservationLayout,
    crossings: Crossings | None = None,
    note: str = "",
) -> MjxPlant:
    """Make a plant for any model that MJX accepts.

    Raises:
      NotImplementedError: MJX does not support the model; the message is MJX's.
    """
    device_model = mjx.put_model(model, impl="jax")
    data = mjx.make_data(device_model, impl="jax")
    numbers = read_numbers(model, device_model, layout, crossings)
    return MjxPlant(device_model, data, layout, numbers, crossings, note)
