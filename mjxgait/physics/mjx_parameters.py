"""Numbers of a body for plain MJX: leaves of its model, and shapes of what is sensed."""

import contextlib
import dataclasses
import io
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.overlap import Crossings
from mjxgait.physics.derived import (
    Bars,
    ObservationLayout,
    inverse_weights,
    read_bars,
    resized_bars,
    weight_groups,
)
from mjxgait.types import Number, pytree

with contextlib.redirect_stdout(
    io.StringIO()
):  # MJX prints that Warp, which is not used, is not installed
    from mujoco import mjx

PARTS = {
    "body": ("pos", "quat", "ipos", "iquat", "mass", "subtreemass", "inertia", "invweight0"),
    "jnt": ("pos", "axis", "range", "stiffness", "margin", "solref", "solimp"),
    "dof": ("armature", "damping", "frictionloss", "solref", "solimp", "invweight0"),
    "geom": ("pos", "quat", "size", "rbound", "friction", "margin", "gap", "solmix"),
}
NUMBERS = (
    "qpos0",
    "qpos_spring",
    "geom_solref",
    "geom_solimp",
    *(f"{part}_{name}" for part, names in PARTS.items() for name in names),
)
"""Fields of a model that may differ between two models of one program; no others may."""
OPTIONS = ("gravity", "impratio")
"""Fields of a model's options that may differ likewise."""
UNSEEN = ("cam_", "light_", "mat_", "tex_", "name", "site_", "key_", "text_", "tuple_", "numeric_")
"""Prefixes of fields that do not affect motion."""
UNUSED = {
    *("geom_rgba", "geom_matid", "geom_aabb", "geom_sameframe", "geom_rbound_hfield", "dof_M0"),
    *("body_margin", "body_simple", "body_sameframe", "stat", "names", "paths", "signature"),
}
PARTS_OF_MODEL = {"opt", "_impl"}
"""Parts that are compared separately."""


@pytree
class ModelNumbers:
    """Numbers of a body.

    model: `NUMBERS` by name, and options: `OPTIONS` by name, as in MJX.
    radius [G], box, ellipsoid [G, 3]: of the watched geoms' support functions. bars: see `Bars`.
    """

    model: Mapping[str, Number]
    options: Mapping[str, Number]
    radius: Number
    box: Number
    ellipsoid: Number
    bars: Bars

    def put_in(self, model: mjx.Model) -> mjx.Model:
        """Return the model with these numbers."""
        numbers, options = jax.tree.map(jnp.asarray, (self.model, self.options))
        return model.replace(**numbers, opt=model.opt.replace(**options))


def read_numbers(
    model: mujoco.MjModel,
    device_model: mjx.Model,
    layout: ObservationLayout,
    crossings: Crossings | None,
) -> ModelNumbers:
    """Read the numbers of a model; device_model: the same on the device."""
    extents = [
        geometry.support_extents(model.geom_type[g], model.geom_size[g]) for g in layout.watched
    ]
    radius, box, ellipsoid = (np.array(part, np.float32) for part in zip(*extents, strict=True))
    return ModelNumbers(
        {name: getattr(device_model, name) for name in NUMBERS},
        {name: getattr(device_model.opt, name) for name in OPTIONS},
        radius,
        box,
        ellipsoid,
        read_bars(crossings),
    )


def model_difference(own: mjx.Model, other: mjx.Model) -> str:
    """Describe the first difference of `other` from `own` besides numbers; empty if none."""
    left_out = {*NUMBERS, *OPTIONS} | UNUSED | PARTS_OF_MODEL
    pairs = [(own, other), (own.opt, other.opt), (own._impl, other._impl)]
    for mine, theirs in pairs:
        for name in (field.name for field in dataclasses.fields(mine)):
            if name in left_out or name.startswith(UNSEEN):
                continue
            if not _equal(getattr(mine, name), getattr(theirs, name)):
                return f"its {name} differs"
    shapes = ((name, getattr(own, name), getattr(other, name)) for name in NUMBERS)
    return next((f"its {name} differs in shape" for name, a, b in shapes if a.shape != b.shape), "")


def _equal(a: object, b: object) -> bool:
    ours, theirs = jax.tree.leaves(a), jax.tree.leaves(b)
    return len(ours) == len(theirs) and all(map(np.array_equal, ours, theirs))


def reweighed(model: mjx.Model, data: mjx.Data, numbers: ModelNumbers) -> ModelNumbers:
    """Recompute what follows from one body's masses and lengths.

    data: any of this model.
    """
    below = _below(model)
    subtree = jnp.dot(below, numbers.model["body_mass"], precision="highest")
    numbers = _with(numbers, body_subtreemass=subtree)
    model = numbers.put_in(model)
    data = mjx.com_pos(model, mjx.kinematics(model, data.replace(qpos=model.qpos0)))
    mass = mjx.full_m(model, mjx.crb(model, data))
    turn, shift = data.cdof[:, :3], data.cdof[:, 3:]
    lever = data.xipos - data.subtree_com[model.body_rootid]
    moved = shift + jnp.cross(turn, lever[:, None])
    moves = below.T[:, model.dof_bodyid] > 0
    jacobian = jnp.concatenate([moved, jnp.broadcast_to(turn, moved.shape)], axis=2)
    jacobian = jnp.where(moves[:, :, None], jacobian, 0.0).swapaxes(1, 2)
    bodies, dofs = inverse_weights(mass, jacobian, weight_groups(model.jnt_type))
    return _with(numbers, body_invweight0=bodies, dof_invweight0=dofs)


def _with(numbers: ModelNumbers, **changed: Number) -> ModelNumbers:
    return dataclasses.replace(numbers, model={**numbers.model, **changed})


def with_mass_scale(numbers: ModelNumbers, factor: Number) -> ModelNumbers:
    """Multiply masses and inertias by factor, [] or [nbody - 1]; nothing else changes yet."""
    bodies = len(numbers.model["body_mass"]) - 1
    every = jnp.concatenate([jnp.ones(1), jnp.broadcast_to(factor, (bodies,))])
    return _with(
        numbers,
        body_mass=numbers.model["body_mass"] * every,
        body_inertia=numbers.model["body_inertia"] * every[:, None],
    )


def with_length_scale(
    model: mjx.Model,
    layout: ObservationLayout,
    crossings: Crossings | None,
    numbers: ModelNumbers,
    factor: Number,
) -> ModelNumbers:
    """Multiply lengths by factor [nbody - 1], masses by its cube, inertias by its fifth power.

    The weights are not recomputed yet.
    """
    every = jnp.concatenate([jnp.ones(1), jnp.asarray(factor, jnp.float32)])
    old, geom, joint = numbers.model, every[model.geom_bodyid], every[model.jnt_bodyid]
    large = _with(
        numbers,
        body_pos=old["body_pos"] * every[model.body_parentid][:, None],
        body_ipos=old["body_ipos"] * every[:, None],
        body_mass=old["body_mass"] * every**3,
        body_inertia=old["body_inertia"] * every[:, None] ** 5,
        jnt_pos=old["jnt_pos"] * joint[:, None],
        geom_pos=old["geom_pos"] * geom[:, None],
        geom_size=old["geom_size"] * geom[:, None],
        geom_rbound=old["geom_rbound"] * geom,
    )
    watched = geom[layout.watched]
    bars = numbers.bars
    if crossings is not None and len(crossings.first):
        bars = resized_bars(bars, crossings.first, crossings.second, every[crossings.body])
    return dataclasses.replace(
        large,
        radius=numbers.radius * watched,
        box=numbers.box * watched[:, None],
        ellipsoid=numbers.ellipsoid * watched[:, None],
        bars=bars,
    )


def _below(model: mjx.Model) -> np.ndarray:
    """[nbody, nbody] matrix, 1 where the second body is the first or its descendant."""
    below = np.eye(model.nbody, dtype=np.float32)
    for b in range(model.nbody - 1, 0, -1):
        below[model.body_parentid[b]] += below[b]
    return below
